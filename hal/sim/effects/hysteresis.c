/* Bend depends on where it comes from, not on how fast: a sum of play operators on the bend vector (Prandtl
 * 1928, Ishlinskii 1944; vector play as in Krejci 1996). Loops are closed and centred on the nominal curve.
 *
 * All plays have the same weight; `memory` times the bend limit is the greatest radius, or what a wide loop needs. Form 0: radii in a geometric
 * series, so that loops of all sizes up to the memory are about as wide for their size, as rubber's are. Form 1: radii spread
 * evenly, so that the bend lags by nearly the same once it has moved by the memory: short cycles hardly open. `width` is the
 * opening of a cycle from zero to the bend limit at half height, over that limit. */
#include <math.h>

#include "sim/effect.h"

enum { WIDTH, MEMORY };
enum { ALL_SIZES, ONE_SIZE };

#define PLAYS 5
#define WIDTH_MOST 0.2
/* At 1 / PLAYS the bend would stand still wherever the load turns round, and beyond it go on the wrong way: no weight comes
 * near. A loop so wide has a memory that is long enough for it, whatever shorter one is asked for. Below the least memory that may
 * be asked for it is not rubber any more but something that sticks and slips. */
#define WEIGHT_MOST 0.195

/* Radii over the memory. */
#define SMALLER 1.7
static const double shares[2][PLAYS] = {
    [ALL_SIZES] = {1.0, 1.0 / SMALLER, 1.0 / (SMALLER * SMALLER), 1.0 / (SMALLER * SMALLER * SMALLER),
                   1.0 / (SMALLER * SMALLER * SMALLER * SMALLER)},
    [ONE_SIZE] = {0.2, 0.4, 0.6, 0.8, 1.0}};

/* Over the bend limit: what is asked for, or with a smooth bend the least that opens as far under the greatest weight. Plays of
 * small radii open a cycle by twice their sum. */
static double memory_of(size_t form, const double *parameter) {
    double sum = 0.0;
    for (size_t i = 0; i < PLAYS; i++) {
        sum += shares[form][i];
    }
    const double least = parameter[WIDTH] / (2.0 * WEIGHT_MOST * sum), share = least / parameter[MEMORY];
    const double fourth = share * share * share * share;
    return parameter[MEMORY] * sqrt(sqrt(sqrt(1.0 + fourth * fourth)));
}

/* A play of radius r, weight one, opens a cycle of length one by 2 r, or by what is left of the cycle: plays of long memory open
 * it less, and their weight is bent smoothly to the greatest one. */
static double weight_of(size_t form, double width, double memory) {
    double opening = 0.0, small = 0.0;
    for (size_t i = 0; i < PLAYS; i++) {
        const double radius = shares[form][i] * memory;
        small += 2.0 * radius;
        opening += fmax(fmin(2.0 * radius, 1.0 - 2.0 * radius), 0.0);
    }
    const double least = fmin(width / small, WEIGHT_MOST), room = fmax(WEIGHT_MOST - least, 1e-6);
    const double more = (width / opening - least) / room, fourth = more * more * more * more;
    return least + room * more / sqrt(sqrt(sqrt(1.0 + fourth * fourth)));
}

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
    const double memory = memory_of(signals->form, parameter), weight = weight_of(signals->form, parameter[WIDTH], memory);
    const double limit_rad = (double)signals->table->module.bend_limit_rad;
    for (size_t i = 0; i < PLAYS; i++) {
        double *follower = &state[2 * i];
        follow(follower, bend, shares[signals->form][i] * memory * limit_rad);
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
    .forms = 2,
    .form_what = {"loops of all sizes, as wide for their size", "loops of one size: the bend lags by as much in any long cycle"},
    .remembers = true,
    .parameter_count = 2,
    .parameter = {[WIDTH] = {"width", "1", 0.0, WIDTH_MOST, 0.06, 0.0},
                  [MEMORY] = {"memory", "1", 0.05, 2.0, 0.3, NAN}},
    .doubt = {[WIDTH] = 0.3, [MEMORY] = 0.5}, /* loops of other shapes: Bouc (1967), Wen (1976) */
    .shape = lag};

EFFECT_REGISTER(hysteresis);
