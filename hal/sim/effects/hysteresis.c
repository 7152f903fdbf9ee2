/* Bend depends on where it comes from, not on how fast: a sum of play operators on the bend vector (Prandtl
 * 1928, Ishlinskii 1944; vector play as in Krejci 1996). Loops are closed and centred on the nominal curve.
 *
 * The plays' radii are spread evenly on a logarithmic scale below `memory` times the bend limit, all with the
 * same weight. A cycle then opens a loop that is about `width` of its own size, as rubber's are, or once it
 * is much longer than the memory, one of constant size. */
#include <math.h>

#include "sim/effect.h"

enum { WIDTH, MEMORY };

#define PLAYS 5
#define RADII_RATIO 1.7
/* Opening at half height over the length of a cycle from 0 to the bend limit, for plays of weight one and a
 * memory of 0.3: a play of radius r opens 2 r, or what is left of the cycle. */
#define OPENING 1.154
/* At OPENING / PLAYS the bend would stand still wherever the load turns round, and beyond it go on the wrong
 * way. */
#define WIDTH_MOST 0.2

/* The follower stays within the radius of what it follows. */
static void follow(double follower[2], const double target[2], double radius) {
    const double x = target[0] - follower[0], y = target[1] - follower[1], distance = hypot(x, y);
    if (distance > radius) {
        follower[0] = target[0] - radius * x / distance;
        follower[1] = target[1] - radius * y / distance;
    }
}

static void lag(double *state, const double *parameter, struct effect_signals *signals) {
    const double bend[2] = {signals->shape->bend_x_rad, signals->shape->bend_y_rad};
    const double weight = parameter[WIDTH] / OPENING;
    double radius = parameter[MEMORY] * (double)signals->table->module.bend_limit_rad;
    for (size_t i = 0; i < PLAYS; i++, radius /= RADII_RATIO) {
        double *follower = &state[2 * i];
        follow(follower, bend, radius);
        signals->shape->bend_x_rad -= weight * (bend[0] - follower[0]);
        signals->shape->bend_y_rad -= weight * (bend[1] - follower[1]);
    }
}

static const struct effect_kind hysteresis = {
    .name = "hysteresis",
    .what = "bend lags behind on the way up and on the way down, at any rate",
    .signature = "too little bend while it grows, too much while it shrinks, by the same amount in fast "
                 "and slow cycles and without change in a hold; some bend is left after venting. Creep and "
                 "lags make loops as well, but of a width that depends on the rate",
    .stage = EFFECT_STAGE_BODY,
    .scope = EFFECT_GLOBAL,
    .parameter_count = 2,
    .parameter = {[WIDTH] = {"width", "1", 0.0, WIDTH_MOST, 0.06, 0.0},
                  [MEMORY] = {"memory", "1", 0.02, 2.0, 0.3, NAN}},
    .shape = lag};

EFFECT_REGISTER(hysteresis);
