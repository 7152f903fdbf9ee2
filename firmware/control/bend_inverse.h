/* From a wanted bend to three chamber pressures, by inverting the bend table.
 *
 * Always answers and never exceeds a limit: a bend that cannot be reached is answered with the nearest one in the same
 * direction, and a flag. Warm-started Newton on the C1 table, bracketed fallback. Not here: tip feedback (tip_loop.h). */
#ifndef TRIBEND_BEND_INVERSE_H
#define TRIBEND_BEND_INVERSE_H

#include "control/bend_table.h"

struct bend_inverse_request {
    float bend_rad;          /* >= 0 */
    float direction_rad;     /* any; where the tip moves */
    float co_contraction_pa; /* >= 0: every chamber has at least this pressure */
};

enum bend_inverse_flag {
    BEND_INVERSE_LIMITED_BEND = 1u << 0,     /* cut to the module's bend limit */
    BEND_INVERSE_LIMITED_PRESSURE = 1u << 1, /* cut by working pressure or the table's valid domain */
    BEND_INVERSE_LIMITED_CO_CONTRACTION = 1u << 2,
    BEND_INVERSE_NOT_FINITE = 1u << 3        /* the request held a NaN or an infinity: answered with no bend */
};

struct bend_inverse_result {
    float pressure_pa[3];
    float bend_rad;      /* reached, through the forward table */
    float direction_rad;
    float residual_rad;  /* angle between the request (after limits) and what the table gives */
    uint32_t flags;
    uint32_t iterations; /* evaluations of the table */
};

/* `warm_pa` may be NULL; else a guess (the last answer). */
void bend_inverse_solve(const struct bend_table *table, const struct bend_inverse_request *request,
                        const float warm_pa[3], struct bend_inverse_result *result);

#endif
