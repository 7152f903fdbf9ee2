/* From a wanted bend to three chamber pressures, by inverting the bend table.
 *
 * Always answers and never exceeds a limit: a bend that cannot be reached is answered with the greatest one in the same
 * direction that the limits and the table's valid domain allow, and a flag. The answer depends on the request alone,
 * not on earlier ones. The work comes in bounded parts, so that a control step can do one; offline,
 * bend_inverse_solve() does them all. Not here: tip feedback (tip_loop.h). */
#ifndef TRIBEND_BEND_INVERSE_H
#define TRIBEND_BEND_INVERSE_H

#include "control/bend_plane.h"

#define BEND_INVERSE_STEPS_MOST 40u /* of bend_inverse_step() until it is done */

struct bend_inverse_request {
    float bend_rad;          /* >= 0 */
    float direction_rad;     /* any; where the tip moves */
    float co_contraction_pa; /* >= 0: every chamber has at least this pressure */
};

enum bend_inverse_flag {
    BEND_INVERSE_LIMITED_BEND = 1u << 0,     /* cut to the module's bend limit */
    BEND_INVERSE_LIMITED_PRESSURE = 1u << 1, /* cut by working pressure or the table's valid domain */
    BEND_INVERSE_LIMITED_CO_CONTRACTION = 1u << 2,
    BEND_INVERSE_NOT_FINITE = 1u << 3 /* the request held a NaN or an infinity: answered with no bend */
};

struct bend_inverse_result {
    float pressure_pa[3];
    float bend_rad; /* reached, through the forward table */
    float direction_rad;
    float residual_rad; /* angle between the request (after limits) and what the table gives */
    uint32_t flags;
    uint32_t evaluations; /* of the table */
};

enum bend_inverse_stage {
    BEND_INVERSE_START = 0, /* find the cell, and a guess in it */
    BEND_INVERSE_SEARCH,    /* Newton on both pressures */
    BEND_INVERSE_LEAVE,     /* find where the wanted direction leaves what the limits allow */
    BEND_INVERSE_WALK,      /* from the limits back to the table's valid domain, cell by cell */
    BEND_INVERSE_EDGE,      /* Newton along the edge of what is allowed */
    BEND_INVERSE_REST,      /* no bend: the co-contraction alone */
    BEND_INVERSE_DONE
};

/* A request being worked on. */
struct bend_inverse {
    struct bend_plane plane;
    enum bend_inverse_stage stage;
    uint32_t flags;
    uint32_t evaluations;
    uint32_t edge_evaluations;
    uint32_t steps;
    float length_m;
    float ceiling_pa;          /* working pressure, or the table's end */
    float wanted;              /* curvature, 1/m */
    float toward[2];           /* unit vector of the direction */
    float pressure_pa[2];      /* of lead and follower: where the table is looked at next */
    float low_pa[2];           /* too little, as far as is known */
    float high_pa[2];          /* too much */
    float slack_pa[2];         /* by which the other chamber may shift that */
    uint32_t lead;             /* chamber */
    bool turned;               /* the neighbouring pair of chambers was tried */
    bool cornered;             /* the other edge was tried */
    bool capped;               /* a pressure reached the ceiling on the way */
    enum bend_plane_role edge; /* whose pressure is kept on the edge */
    uint32_t cell[2];          /* on the walk */
    /* the best point so far */
    bool found;
    float found_pa[3];
    float found_curvature[2];
    float found_residual_rad;
};

/* Take up a request: a bend vector (bend times the unit vector of the direction), rad. */
void bend_inverse_begin(struct bend_inverse *inverse, const struct bend_table *table, const float bend_rad[2],
                        float co_contraction_pa);
/* Work on it: the start, one look at the table, or some cells of the walk. True: it is done. The preview of a bend that
 * can be reached is a linear guess after the first step, and within 0.1 degree, mostly 0.005, after the second; the
 * third as a rule finds that so. */
bool bend_inverse_step(struct bend_inverse *inverse);
/* Pressures to go to already: the answer where it is done, else as far as start and Newton have come if that is within
 * the limits and the valid domain, and no pressure had to be cut on the way. False: there are none yet. */
bool bend_inverse_preview(const struct bend_inverse *inverse, float pressure_pa[3]);
/* The answer once it is done. */
void bend_inverse_finish(const struct bend_inverse *inverse, struct bend_inverse_result *result);
/* All of it at once. */
void bend_inverse_solve(const struct bend_table *table, const struct bend_inverse_request *request,
                        struct bend_inverse_result *result);

#endif
