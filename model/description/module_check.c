#include "description/module_check.h"

#include <math.h>

#define CONTOUR_POINTS 180

/* Point `index` of a cavity's contour; a semicircle's last third runs along its flat side. */
static void contour_point(const struct cavity *cavity, int index, double point[2]) {
    const double share = (double)index / CONTOUR_POINTS;
    double along = cos(2.0 * M_PI * share), across = sin(2.0 * M_PI * share);
    if (cavity->shape == CAVITY_SEMICIRCLE) {
        const double turn = M_PI * (1.5 * share - 0.5);
        const bool round = share < 2.0 / 3.0;
        along = round ? cos(turn) : 0.0;
        across = round ? sin(turn) : 1.0 - 6.0 * (share - 2.0 / 3.0);
    }
    const double c = cos(cavity->orientation_rad), s = sin(cavity->orientation_rad);
    point[0] = cavity->centre_m[0] + cavity->radius_m * (c * along - s * across);
    point[1] = cavity->centre_m[1] + cavity->radius_m * (s * along + c * across);
}

/* Is the point inside the cavity grown by `margin_m`? */
static bool holds(const struct cavity *cavity, const double point[2], double margin_m) {
    const double x = point[0] - cavity->centre_m[0], y = point[1] - cavity->centre_m[1];
    const double along = x * cos(cavity->orientation_rad) + y * sin(cavity->orientation_rad);
    return hypot(x, y) < cavity->radius_m + margin_m && (cavity->shape == CAVITY_CIRCLE || along > -margin_m);
}

static bool overlap(const struct cavity *a, const struct cavity *b) {
    for (int i = 0; i < CONTOUR_POINTS; i++) {
        double point[2];
        contour_point(a, i, point);
        if (holds(b, point, MODULE_WALL_LEAST_M)) {
            return true;
        }
    }
    return holds(a, b->centre_m, 0.0) || holds(b, a->centre_m, 0.0);
}

static bool leaves(const struct cavity *cavity, double radius_m) {
    for (int i = 0; i < CONTOUR_POINTS; i++) {
        double point[2];
        contour_point(cavity, i, point);
        if (hypot(point[0], point[1]) > radius_m - MODULE_WALL_LEAST_M) {
            return true;
        }
    }
    return false;
}

enum module_fault module_check_section(const struct module_description *module, size_t *first, size_t *second) {
    const double centre[2] = {0.0, 0.0};
    for (size_t c = 0; c < MODULE_CHAMBERS; c++) {
        for (size_t k = 0; k < module->chamber[c].cavity_count; k++) {
            const struct cavity *cavity = &module->chamber[c].cavity[k];
            *first = c;
            *second = c;
            if (leaves(cavity, 0.5 * module->outer_diameter_m)) {
                return MODULE_CAVITY_LEAVES;
            }
            if (holds(cavity, centre, MODULE_WALL_LEAST_M)) {
                return MODULE_CENTRE_HOLLOW;
            }
            for (size_t d = c; d < MODULE_CHAMBERS; d++) {
                for (size_t l = d == c ? k + 1 : 0; l < module->chamber[d].cavity_count; l++) {
                    *second = d;
                    if (overlap(cavity, &module->chamber[d].cavity[l])) {
                        return MODULE_CAVITIES_OVERLAP;
                    }
                }
            }
        }
    }
    return MODULE_SOUND;
}
