#include "description/module_check.h"

#include <math.h>

#define POINTS_A_PIECE 60

/* Calls a condition for points along a cavity's outline; true as soon as one meets it. */
typedef bool (*point_condition)(const double point_m[2], const void *context);

static bool any_point(const struct cavity *cavity, point_condition condition, const void *context) {
    struct cavity_piece piece[CAVITY_PIECES_MAX];
    const size_t count = cavity_outline(cavity, piece);
    for (size_t i = 0; i < count; i++) {
        for (int k = 0; k < POINTS_A_PIECE; k++) {
            double point_m[2];
            cavity_piece_point(&piece[i], (double)k / POINTS_A_PIECE, point_m);
            if (condition(point_m, context)) {
                return true;
            }
        }
    }
    return false;
}

static bool touches_cavity(const double point_m[2], const void *context) {
    const struct cavity *other = context;
    return cavity_holds(other, point_m) || cavity_outline_distance(other, point_m) < MODULE_WALL_LEAST_M;
}

static bool beyond_radius(const double point_m[2], const void *context) {
    return hypot(point_m[0], point_m[1]) > *(const double *)context - MODULE_WALL_LEAST_M;
}

static bool within_radius(const double point_m[2], const void *context) {
    return hypot(point_m[0], point_m[1]) < *(const double *)context + MODULE_WALL_LEAST_M;
}

/* Is the circle of this radius met by the cavity's outline? */
static bool meets_circle(const struct cavity *cavity, double radius_m) {
    return any_point(cavity, beyond_radius, &radius_m) && any_point(cavity, within_radius, &radius_m);
}

static enum module_fault check_cavity(const struct module_description *module, const struct cavity *cavity,
                                      size_t *layer) {
    const double outer_m = 0.5 * module->outer_diameter_m, bore_m = 0.5 * module->bore_diameter_m;
    const double centre_m[2] = {0.0, 0.0};
    if (any_point(cavity, beyond_radius, &outer_m)) {
        return MODULE_CAVITY_LEAVES;
    }
    if (bore_m > 0.0 && (any_point(cavity, within_radius, &bore_m) || cavity_holds(cavity, centre_m))) {
        return MODULE_BORE_OPENS;
    }
    if (touches_cavity(centre_m, cavity)) {
        return MODULE_CENTRE_HOLLOW;
    }
    for (size_t l = 0; l < module->layer_count; l++) {
        *layer = l;
        if (meets_circle(cavity, module->layer[l].inner_radius_m) ||
            (module->layer[l].outer_radius_m < outer_m && meets_circle(cavity, module->layer[l].outer_radius_m))) {
            return MODULE_LAYER_CUT;
        }
    }
    return MODULE_SOUND;
}

enum module_fault module_check_section(const struct module_description *module, size_t *first, size_t *second) {
    for (size_t c = 0; c < MODULE_CHAMBERS; c++) {
        for (size_t k = 0; k < module->chamber[c].cavity_count; k++) {
            const struct cavity *cavity = &module->chamber[c].cavity[k];
            *first = c;
            *second = c;
            const enum module_fault fault = check_cavity(module, cavity, second);
            if (fault != MODULE_SOUND) {
                return fault;
            }
            for (size_t d = c; d < MODULE_CHAMBERS; d++) {
                for (size_t l = d == c ? k + 1 : 0; l < module->chamber[d].cavity_count; l++) {
                    const struct cavity *other = &module->chamber[d].cavity[l];
                    *second = d;
                    if (any_point(cavity, touches_cavity, other) || any_point(other, touches_cavity, cavity)) {
                        return MODULE_CAVITIES_OVERLAP;
                    }
                }
            }
        }
    }
    return MODULE_SOUND;
}
