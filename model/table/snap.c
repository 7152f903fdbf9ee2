#include "table/snap.h"

#include <math.h>
#include <string.h>

/* The curve is walked by volumes that grow by this factor, up to 200 times the first. */
#define VOLUME_FACTOR 1.04
#define STEPS_MAX 136
/* The volume axis starts where the pressure is this share of the limit point's, so that both grids know those states; */
#define START_SHARE 0.8
/* the other chambers' axes end at this share of it: they have not ballooned. */
#define OTHERS_SHARE 0.9
/* A curve that ends before the volume has grown by this factor beyond the limit point makes no grid. */
#define GROWTH_LEAST 1.3

struct curve {
    double pressure_pa[STEPS_MAX];
    double volume_m2[STEPS_MAX];
    size_t count;
    size_t top; /* index after which the pressure first falls, 0: none */
};

/* Greatest or least value of the parabola through three evenly spaced points, `middle` being the greatest or least. */
static double vertex(double before, double middle, double after) {
    const double slope = 0.5 * (after - before), bend = after - 2.0 * middle + before;
    return bend == 0.0 ? middle : middle - 0.5 * slope * slope / bend;
}

static void follow(struct section_solver *solver, double most_pa, double most_1pm, struct curve *curve,
                   struct snap *snap) {
    double volume_m2 = section_solver_chamber_area_m2(solver, 0);
    section_solver_reset(solver);
    for (size_t k = 0; k < STEPS_MAX; k++) {
        struct section_state state;
        if (!section_solver_move_to_volume(solver, volume_m2, 0.0, 0.0)) {
            return;
        }
        section_solver_state(solver, &state);
        const double p = state.pressure_pa[0];
        if (state.contact || !state.elliptic || (snap->jump_up_pa > 0.0 && p <= 0.0)) {
            return;
        }
        curve->pressure_pa[k] = p;
        curve->volume_m2[k] = volume_m2;
        curve->count = k + 1;
        if (k >= 2) {
            const double before = curve->pressure_pa[k - 2], middle = curve->pressure_pa[k - 1];
            if (curve->top == 0 && p < middle) {
                curve->top = k - 1;
                snap->jump_up_pa = vertex(before, middle, p);
            } else if (curve->top > 0 && snap->jump_down_pa == 0.0 && middle < before && p > middle) {
                snap->jump_down_pa = vertex(before, middle, p);
            }
        }
        if (p >= most_pa || hypot(state.curvature_x_1pm, state.curvature_y_1pm) >= most_1pm) {
            return;
        }
        volume_m2 *= VOLUME_FACTOR;
    }
}

void snap_find(struct section_solver *solver, double most_pa, double most_1pm, struct snap *snap) {
    struct curve curve = {.count = 0};
    memset(snap, 0, sizeof *snap);
    follow(solver, most_pa, most_1pm, &curve, snap);
    if (curve.top == 0 || curve.volume_m2[curve.count - 1] < GROWTH_LEAST * curve.volume_m2[curve.top]) {
        return;
    }
    size_t start = curve.top;
    while (start > 0 && curve.pressure_pa[start] > START_SHARE * snap->jump_up_pa) {
        start--;
    }
    const double ratio = curve.volume_m2[curve.count - 1] / curve.volume_m2[start];
    for (size_t v = 0; v < SNAP_VOLUMES; v++) {
        snap->volume_m2[v] = curve.volume_m2[start] * pow(ratio, (double)v / (double)(SNAP_VOLUMES - 1));
    }
    for (size_t i = 0; i < SNAP_OTHERS; i++) {
        snap->others_pa[i] = OTHERS_SHARE * snap->jump_up_pa * (double)i / (double)(SNAP_OTHERS - 1);
    }
}
