#include "blind_excitation.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "blind_plant.h"

#define RIGHT_ANGLE (0.5 * M_PI)
#define TARGET_S (1e-6 * BLIND_TARGET_US)

double blind_pressure_most_pa(struct blind_field *field) {
    const struct bend_table *table = field->table;
    const double end_pa = fmin(0.95 * (double)table->axis_pa[0][table->nodes[0] - 1],
                               (double)table->module.working_pressure_pa);
    double low = 0.0, high = end_pa;
    for (int i = 0; i < 40; i++) {
        const double at[3] = {0.5 * (low + high), 0.0, 0.0};
        double bend[2] = {0.0, 0.0}, stretch = 1.0;
        const bool known = blind_field_bend(field, at, bend, &stretch);
        *(known && hypot(bend[0], bend[1]) < RIGHT_ANGLE ? &low : &high) = at[0];
    }
    return high;
}

enum segment { SEGMENT_STEP, SEGMENT_RAMP, SEGMENT_SWING, SEGMENT_VENT, SEGMENT_KINDS };

static enum segment draw_segment(struct blind_random *random) {
    const double u = blind_uniform(random, 0.0, 1.0);
    return u < 0.35 ? SEGMENT_STEP : (u < 0.6 ? SEGMENT_RAMP : (u < 0.75 ? SEGMENT_SWING : SEGMENT_VENT));
}

/* Fills one segment of a chamber, in shares of the greatest pressure; returns its end. */
static size_t fill_segment(struct blind_excitation *excitation, size_t c, size_t from, struct blind_random *random,
                           bool large) {
    enum segment kind = draw_segment(random);
    if (large && kind == SEGMENT_VENT) {
        kind = SEGMENT_STEP;
    }
    const size_t length = (size_t)(blind_log_uniform(random, 0.6, 4.0) / TARGET_S);
    const size_t end = from + length < excitation->count ? from + length : excitation->count;
    const double level = large ? blind_uniform(random, 0.8, 1.0) : blind_uniform(random, 0.2, 1.0);
    const double start = from > 0 ? excitation->target_pa[from - 1][c] : 0.0;
    const double rate_hz = blind_log_uniform(random, 0.2, 1.0);
    for (size_t i = from; i < end; i++) {
        const double share = (double)(i - from + 1) / (double)length, since_s = (double)(i - from) * TARGET_S;
        double value = kind == SEGMENT_VENT ? 0.0 : level;
        if (kind == SEGMENT_RAMP) {
            value = start + (level - start) * share;
        } else if (kind == SEGMENT_SWING) {
            value = level * (0.55 - 0.45 * cos(2.0 * M_PI * rate_hz * since_s));
        }
        excitation->target_pa[i][c] = value;
    }
    return end;
}

static void fill_all(struct blind_excitation *excitation, struct blind_random *random) {
    const size_t rest = (size_t)(BLIND_REST_S / TARGET_S);
    const double vented_s = blind_chance(random, 0.5) ? blind_uniform(random, 1.5, 4.0) : 0.0;
    const size_t vented = (size_t)(vented_s / TARGET_S);
    for (size_t c = 0; c < 3; c++) {
        size_t at = rest + blind_below(random, (size_t)(2.0 / TARGET_S));
        for (size_t segment = 0; at < excitation->count; segment++) {
            at = fill_segment(excitation, c, at, random, segment % 4 == c);
        }
        for (size_t i = excitation->count - vented; i < excitation->count && vented < excitation->count; i++) {
            excitation->target_pa[i][c] = 0.0;
        }
    }
}

static void fill_hold(struct blind_excitation *excitation, struct blind_random *random, size_t chambers) {
    const size_t rest = (size_t)(BLIND_REST_S / TARGET_S);
    const double level = blind_uniform(random, 0.7, 1.0);
    for (size_t i = rest; i < excitation->count; i++) {
        for (size_t c = 0; c < chambers; c++) {
            excitation->target_pa[i][c] = level;
        }
    }
}

/* Makes shares pressures, no more of them than bends the module by a right angle. */
static void limit(struct blind_excitation *excitation, struct blind_field *field, double stiffness_scale,
                  double pressure_most_pa) {
    for (size_t i = 0; i < excitation->count; i++) {
        double scale = pressure_most_pa;
        for (int round = 0; round < 30; round++) {
            double load[3], bend[2] = {0.0, 0.0}, stretch = 1.0;
            for (size_t c = 0; c < 3; c++) {
                load[c] = scale * excitation->target_pa[i][c] / stiffness_scale;
            }
            if (!blind_field_bend(field, load, bend, &stretch) || hypot(bend[0], bend[1]) < RIGHT_ANGLE * 1.01) {
                break;
            }
            scale *= 0.98;
        }
        for (size_t c = 0; c < 3; c++) {
            excitation->target_pa[i][c] *= scale;
        }
    }
}

bool blind_excitation_open(struct blind_excitation *excitation, enum blind_excitation_kind kind, struct blind_random *random,
                           struct blind_field *field, double stiffness_scale, double pressure_most_pa, double seconds) {
    excitation->bend = NULL;
    excitation->count = (size_t)ceil(seconds / TARGET_S) + 1;
    excitation->target_pa = calloc(excitation->count, sizeof *excitation->target_pa);
    if (excitation->target_pa == NULL) {
        return false;
    }
    if (kind == BLIND_EXCITE_ALL) {
        fill_all(excitation, random);
    } else {
        fill_hold(excitation, random, kind == BLIND_EXCITE_ONE ? 1 : 3);
    }
    limit(excitation, field, stiffness_scale, pressure_most_pa);
    return true;
}

void blind_excitation_close(struct blind_excitation *excitation) {
    free(excitation->target_pa);
    free(excitation->bend);
    excitation->target_pa = NULL;
    excitation->bend = NULL;
}

double blind_holding_duty(double pressure_pa) {
    const double ambient = 101325.0, conductance = 2e-10, delays_share = 0.05; /* opens 1.5 ms late, closes 1 ms late */
    if (!(pressure_pa > 50.0)) {
        return 0.0;
    }
    const double fill = blind_flow_kgps(conductance, 0.3, ambient + 40000.0, ambient + pressure_pa, 293.15);
    const double vent = blind_flow_kgps(conductance, 0.3, ambient + pressure_pa, ambient, 293.15);
    return vent / (fill + vent) + delays_share;
}
