/* Two chambers next to the wanted direction do the bending, the third holds the co-contraction.
 *
 * Newton on the two pressures, from the last answer or from a superposition of single chambers; where it does not
 * arrive inside the limits, nested bisection over the share of the two chambers (direction) and their common level
 * (bend), which needs no slope and cannot leave the limits. The section's threefold symmetry gives the sector: alone,
 * chamber k moves the tip towards 180 + 120 k degrees. */
#include "control/bend_inverse.h"

#include <string.h>

#include "control/real_math.h"

#define NEWTON_ITERATIONS 10u
#define HALVINGS 5u
#define RESIDUAL_WANTED_RAD 3e-5f
#define RESIDUAL_ACCEPTED_RAD 3e-4f
#define BISECTIONS 13u
#define POLISH_SHARE 0.05f /* a bracketed bend this near to the wanted one is worth Newton's last steps */
#define NO_BEND_RAD 1e-6f
#define SIN_120_DEG 0.866025404f
#define THIRD_OF_TURN 2.0943951f

struct inverse {
    const struct bend_table *table;
    float target[2];     /* bend vector: bend (rad) times the direction's unit vector */
    float bend_rad;
    float direction_rad;
    float floor_pa;      /* co-contraction */
    float ceiling_pa;    /* working pressure, or the table's end */
    uint32_t lead;       /* chamber whose push lies clockwise of the direction */
    uint32_t follow;     /* and the one counter-clockwise of it */
    float share_of_turn; /* direction from the lead's push, 0 to 120 degrees, rad */
    uint32_t evaluations;
};

struct point {
    float pressure_pa[3];
    float bend[2];        /* bend vector, rad */
    float slope[2][2];    /* by the lead's and the follower's pressure, rad/Pa */
    float residual_rad;
    bool valid;
};

static void set_pressures(const struct inverse *inverse, float lead_pa, float follow_pa, struct point *point) {
    for (uint32_t c = 0; c < 3u; c++) {
        point->pressure_pa[c] = inverse->floor_pa;
    }
    point->pressure_pa[inverse->lead] = real_clamp(lead_pa, inverse->floor_pa, inverse->ceiling_pa);
    point->pressure_pa[inverse->follow] = real_clamp(follow_pa, inverse->floor_pa, inverse->ceiling_pa);
}

static void evaluate(struct inverse *inverse, struct point *point, bool with_slope) {
    static const enum bend_table_channel channels[2] = {BEND_TABLE_CURVATURE_X, BEND_TABLE_CURVATURE_Y};
    const struct bend_table *table = inverse->table;
    const float length_m = table->module.active_length_m;
    struct bend_table_stencil stencil;
    bend_table_locate(table, point->pressure_pa, &stencil);
    for (uint32_t i = 0; i < 2u; i++) {
        if (with_slope) {
            float gradient[3];
            point->bend[i] = length_m * bend_table_gradient(table, &stencil, channels[i], gradient);
            point->slope[i][0] = length_m * gradient[inverse->lead];
            point->slope[i][1] = length_m * gradient[inverse->follow];
        } else {
            point->bend[i] = length_m * bend_table_value(table, &stencil, channels[i]);
        }
    }
    point->residual_rad = real_hypot(point->bend[0] - inverse->target[0], point->bend[1] - inverse->target[1]);
    point->valid = bend_table_is_valid(table, &stencil);
    inverse->evaluations++;
}

/* --- where to start --- */

/* Pressure at which the lead chamber alone (over the floor) bends by `bend_rad`, by bisection to a 64th of the range:
 * a start, not an answer. */
static float alone_pa(struct inverse *inverse, float bend_rad) {
    float low = inverse->floor_pa, high = inverse->ceiling_pa;
    for (uint32_t i = 0; i < 6u; i++) {
        struct point point;
        const float middle = 0.5f * (low + high);
        set_pressures(inverse, middle, inverse->floor_pa, &point);
        evaluate(inverse, &point, false);
        if (real_hypot(point.bend[0], point.bend[1]) < bend_rad) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return 0.5f * (low + high);
}

/* The wanted bend vector split into the two chambers' pushes, each as if alone. */
static void start_cold(struct inverse *inverse, struct point *point) {
    const float lead_bend = inverse->bend_rad * real_sin(THIRD_OF_TURN - inverse->share_of_turn) / SIN_120_DEG;
    const float follow_bend = inverse->bend_rad * real_sin(inverse->share_of_turn) / SIN_120_DEG;
    const float lead_pa = alone_pa(inverse, lead_bend);
    const float follow_pa = alone_pa(inverse, follow_bend);
    set_pressures(inverse, lead_pa, follow_pa, point);
}

/* --- Newton --- */

/* One step with halving until the residual falls; false when it does not. */
static bool improve(struct inverse *inverse, struct point *point) {
    const float (*s)[2] = (const float (*)[2])point->slope;
    const float determinant = s[0][0] * s[1][1] - s[0][1] * s[1][0];
    const float gap[2] = {inverse->target[0] - point->bend[0], inverse->target[1] - point->bend[1]};
    if (!(real_abs(determinant) > 1e-14f)) {
        return false;
    }
    const float lead_step = (gap[0] * s[1][1] - gap[1] * s[0][1]) / determinant;
    const float follow_step = (s[0][0] * gap[1] - s[1][0] * gap[0]) / determinant;
    float factor = 1.0f;
    for (uint32_t i = 0; i < HALVINGS; i++) {
        struct point next;
        set_pressures(inverse, point->pressure_pa[inverse->lead] + factor * lead_step,
                      point->pressure_pa[inverse->follow] + factor * follow_step, &next);
        evaluate(inverse, &next, true);
        if (next.residual_rad < point->residual_rad) {
            *point = next;
            return true;
        }
        factor *= 0.5f;
    }
    return false;
}

static void newton(struct inverse *inverse, struct point *point) {
    evaluate(inverse, point, true);
    for (uint32_t i = 0; i < NEWTON_ITERATIONS && point->residual_rad > RESIDUAL_WANTED_RAD; i++) {
        if (!improve(inverse, point)) {
            return;
        }
    }
}

/* --- bracketed fallback --- */

/* Both chambers at `level` of the way from floor to ceiling, `share` in [0, 1] of it from lead (0) to follower (1). */
static void at_share(struct inverse *inverse, float share, float level, struct point *point) {
    const float range_pa = level * (inverse->ceiling_pa - inverse->floor_pa);
    set_pressures(inverse, inverse->floor_pa + range_pa * real_min(1.0f, 2.0f - 2.0f * share),
                  inverse->floor_pa + range_pa * real_min(1.0f, 2.0f * share), point);
    evaluate(inverse, point, false);
}

/* Along one share: the level that gives the wanted bend, or the highest valid one below it. */
static void bisect_level(struct inverse *inverse, float share, struct point *point) {
    float low = 0.0f, high = 1.0f;
    at_share(inverse, share, 1.0f, point);
    if (point->valid && real_hypot(point->bend[0], point->bend[1]) <= inverse->bend_rad) {
        return;
    }
    for (uint32_t i = 0; i < BISECTIONS; i++) {
        const float middle = 0.5f * (low + high);
        at_share(inverse, share, middle, point);
        if (point->valid && real_hypot(point->bend[0], point->bend[1]) <= inverse->bend_rad) {
            low = middle;
        } else {
            high = middle;
        }
    }
    at_share(inverse, share, low, point);
}

/* Share by the direction that it gives. The answer has the wanted direction and the wanted or the greatest bend. */
static void bisect_share(struct inverse *inverse, struct point *point) {
    float low = 0.0f, high = 1.0f;
    for (uint32_t i = 0; i < BISECTIONS; i++) {
        const float middle = 0.5f * (low + high);
        bisect_level(inverse, middle, point);
        const float direction_rad = real_atan2(point->bend[1], point->bend[0]);
        if (real_wrap_angle(direction_rad - inverse->direction_rad) < 0.0f) {
            low = middle;
        } else {
            high = middle;
        }
    }
}

/* --- the request --- */

static uint32_t take_request(struct inverse *inverse, const struct bend_inverse_request *request) {
    const struct bend_table *table = inverse->table;
    const struct bend_table_module *module = &table->module;
    uint32_t flags = 0u;
    inverse->ceiling_pa = module->working_pressure_pa;
    for (uint32_t a = 0; a < 3u; a++) {
        inverse->ceiling_pa = real_min(inverse->ceiling_pa, table->axis_pa[a][table->nodes[a] - 1u]);
    }
    if (!real_is_finite(request->bend_rad) || !real_is_finite(request->direction_rad) ||
        !real_is_finite(request->co_contraction_pa)) {
        return BEND_INVERSE_NOT_FINITE;
    }
    inverse->direction_rad = real_wrap_angle(request->direction_rad);
    inverse->bend_rad = real_max(request->bend_rad, 0.0f);
    inverse->floor_pa = real_max(request->co_contraction_pa, 0.0f);
    if (inverse->bend_rad > module->bend_limit_rad) {
        inverse->bend_rad = module->bend_limit_rad;
        flags |= BEND_INVERSE_LIMITED_BEND;
    }
    if (inverse->floor_pa > inverse->ceiling_pa) {
        inverse->floor_pa = inverse->ceiling_pa;
        flags |= BEND_INVERSE_LIMITED_CO_CONTRACTION;
    }
    return flags;
}

static void choose_sector(struct inverse *inverse) {
    float turn = inverse->direction_rad - REAL_PI; /* from chamber 1's push, counter-clockwise, within one turn */
    turn = turn < 0.0f ? turn + 2.0f * REAL_PI : turn;
    inverse->lead = turn < THIRD_OF_TURN ? 0u : (turn < 2.0f * THIRD_OF_TURN ? 1u : 2u);
    inverse->follow = (inverse->lead + 1u) % 3u;
    inverse->share_of_turn = real_clamp(turn - (float)inverse->lead * THIRD_OF_TURN, 0.0f, THIRD_OF_TURN);
    inverse->target[0] = inverse->bend_rad * real_cos(inverse->direction_rad);
    inverse->target[1] = inverse->bend_rad * real_sin(inverse->direction_rad);
}

static void solve(struct inverse *inverse, const float warm_pa[3], struct point *point) {
    if (inverse->bend_rad < NO_BEND_RAD) {
        set_pressures(inverse, inverse->floor_pa, inverse->floor_pa, point);
        evaluate(inverse, point, false);
        return;
    }
    point->residual_rad = 2.0f * inverse->bend_rad + 1.0f;
    point->valid = false;
    if (warm_pa != NULL && real_is_finite(warm_pa[inverse->lead]) && real_is_finite(warm_pa[inverse->follow])) {
        set_pressures(inverse, warm_pa[inverse->lead], warm_pa[inverse->follow], point);
        newton(inverse, point);
    }
    if (!(point->residual_rad <= RESIDUAL_ACCEPTED_RAD) || !point->valid) {
        start_cold(inverse, point);
        newton(inverse, point);
    }
    if (!(point->residual_rad <= RESIDUAL_ACCEPTED_RAD) || !point->valid) {
        bisect_share(inverse, point);
        struct point polished = *point;
        if (polished.residual_rad < POLISH_SHARE * inverse->bend_rad) {
            newton(inverse, &polished);
            if (polished.valid && polished.residual_rad < point->residual_rad) {
                *point = polished;
            }
        }
    }
}

void bend_inverse_solve(const struct bend_table *table, const struct bend_inverse_request *request,
                        const float warm_pa[3], struct bend_inverse_result *result) {
    struct inverse inverse;
    struct point point;
    (void)memset(&inverse, 0, sizeof inverse);
    (void)memset(&point, 0, sizeof point);
    inverse.table = table;
    result->flags = take_request(&inverse, request);
    choose_sector(&inverse);
    solve(&inverse, warm_pa, &point);
    if (point.residual_rad > RESIDUAL_ACCEPTED_RAD) {
        result->flags |= BEND_INVERSE_LIMITED_PRESSURE;
    }
    for (uint32_t c = 0; c < 3u; c++) {
        result->pressure_pa[c] = point.pressure_pa[c];
    }
    result->bend_rad = real_hypot(point.bend[0], point.bend[1]);
    result->direction_rad = real_atan2(point.bend[1], point.bend[0]);
    result->residual_rad = point.residual_rad;
    result->iterations = inverse.evaluations;
}
