#include "blind_field.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const enum bend_table_channel channel_of[BLIND_QUANTITY_COUNT] = {
    [BLIND_VOLUME_1] = BEND_TABLE_VOLUME_1,       [BLIND_VOLUME_2] = BEND_TABLE_VOLUME_2,
    [BLIND_VOLUME_3] = BEND_TABLE_VOLUME_3,       [BLIND_CURVATURE_X] = BEND_TABLE_CURVATURE_X,
    [BLIND_CURVATURE_Y] = BEND_TABLE_CURVATURE_Y, [BLIND_STRETCH] = BEND_TABLE_STRETCH};

bool blind_field_open(struct blind_field *field, const struct bend_table *table) {
    field->table = table;
    field->cells = (size_t)(table->nodes[0] - 1) * (table->nodes[1] - 1) * (table->nodes[2] - 1);
    field->cell = calloc(field->cells, sizeof *field->cell);
    return field->cell != NULL;
}

void blind_field_close(struct blind_field *field) {
    for (size_t i = 0; i < field->cells && field->cell != NULL; i++) {
        free(field->cell[i]);
    }
    free(field->cell);
    field->cell = NULL;
}

/* Slope at node `i` of the parabola through the node and its neighbours (at an end, its two nearest). */
static double slope_at(const float *axis, size_t nodes, const double *value, size_t first, size_t i) {
    const size_t middle = i == 0 ? 1 : (i == nodes - 1 ? nodes - 2 : i);
    const double before = (double)axis[middle] - (double)axis[middle - 1];
    const double after = (double)axis[middle + 1] - (double)axis[middle];
    const double rise_before = (value[middle - first] - value[middle - 1 - first]) / before;
    const double rise_after = (value[middle + 1 - first] - value[middle - first]) / after;
    const double curve = (rise_after - rise_before) / (before + after);
    if (i < middle) {
        return rise_before - curve * before;
    }
    return i > middle ? rise_after + curve * after : rise_before + curve * before;
}

static size_t first_of(size_t nodes, size_t cell) {
    const size_t wanted = cell == 0 ? 0 : cell - 1;
    return wanted > nodes - 4 ? nodes - 4 : wanted;
}

/* power[m][k]: what node k of the four contributes to the coefficient of t^m inside the cell. */
static void powers_of(const float *axis, size_t nodes, size_t cell, double power[4][4]) {
    const size_t first = first_of(nodes, cell);
    const double width = (double)axis[cell + 1] - (double)axis[cell];
    for (size_t k = 0; k < 4; k++) {
        double unit[4] = {0.0, 0.0, 0.0, 0.0};
        unit[k] = 1.0;
        const double start = unit[cell - first], rise = unit[cell + 1 - first] - start;
        const double out = width * slope_at(axis, nodes, unit, first, cell);
        const double in = width * slope_at(axis, nodes, unit, first, cell + 1);
        power[0][k] = start;
        power[1][k] = out;
        power[2][k] = 3.0 * rise - 2.0 * out - in;
        power[3][k] = out + in - 2.0 * rise;
    }
}

static struct blind_cell *make_cell(const struct bend_table *table, const size_t at[3]) {
    struct blind_cell *cell = calloc(1, sizeof *cell);
    double power[3][4][4];
    for (size_t a = 0; a < 3; a++) {
        powers_of(table->axis_pa[a], table->nodes[a], at[a], power[a]);
    }
    for (size_t q = 0; q < BLIND_QUANTITY_COUNT * 64 && cell != NULL; q++) {
        const float *node = table->channel[channel_of[q / 64]];
        const size_t i = q / 16 % 4, j = q / 4 % 4, k = q % 4;
        const size_t from = first_of(table->nodes[2], at[2]) +
                            table->nodes[2] * (first_of(table->nodes[1], at[1]) +
                                               table->nodes[1] * first_of(table->nodes[0], at[0]));
        double sum = 0.0;
        for (size_t n = 0; n < 64; n++) {
            const size_t ni = n / 16, nj = n / 4 % 4, nk = n % 4;
            sum += power[0][i][ni] * power[1][j][nj] * power[2][k][nk] *
                   (double)node[from + nk + table->nodes[2] * (nj + table->nodes[1] * ni)];
        }
        cell->coefficient[q / 64][i][j][k] = sum;
    }
    return cell;
}

struct place {
    size_t cell[3];
    double t[3];         /* 0..1 inside the cell */
    double width_pa[3];
    double beyond_pa[3]; /* outside the axis */
};

static void find_place(const struct bend_table *table, const double pressure_pa[3], struct place *place) {
    for (size_t a = 0; a < 3; a++) {
        const float *axis = table->axis_pa[a];
        const size_t last = table->nodes[a] - 1;
        const double inside = fmin(fmax(pressure_pa[a], (double)axis[0]), (double)axis[last]);
        size_t cell = 0;
        while (cell + 1 < last && inside >= (double)axis[cell + 1]) {
            cell++;
        }
        place->cell[a] = cell;
        place->width_pa[a] = (double)axis[cell + 1] - (double)axis[cell];
        place->t[a] = (inside - (double)axis[cell]) / place->width_pa[a];
        place->beyond_pa[a] = pressure_pa[a] - inside;
    }
}

static double polynomial(double coefficient[4][4][4], const double t[3], double slope[3]) {
    double value = 0.0, by1 = 0.0, by2 = 0.0, by3 = 0.0;
    for (size_t i = 4; i-- > 0;) {
        double plane = 0.0, plane2 = 0.0, plane3 = 0.0;
        for (size_t j = 4; j-- > 0;) {
            const double *c = coefficient[i][j];
            const double line = c[0] + t[2] * (c[1] + t[2] * (c[2] + t[2] * c[3]));
            const double line3 = c[1] + t[2] * (2.0 * c[2] + t[2] * 3.0 * c[3]);
            plane2 = plane2 * t[1] + plane;
            plane = plane * t[1] + line;
            plane3 = plane3 * t[1] + line3;
        }
        by1 = by1 * t[0] + value;
        value = value * t[0] + plane;
        by2 = by2 * t[0] + plane2;
        by3 = by3 * t[0] + plane3;
    }
    slope[0] = by1;
    slope[1] = by2;
    slope[2] = by3;
    return value;
}

bool blind_field_at(struct blind_field *field, const double pressure_pa[3], enum blind_quantity first, size_t count,
                    double *value, double (*gradient)[3]) {
    const struct bend_table *table = field->table;
    struct place place;
    find_place(table, pressure_pa, &place);
    struct blind_cell **cell =
        &field->cell[place.cell[2] + (table->nodes[2] - 1) * (place.cell[1] + (table->nodes[1] - 1) * place.cell[0])];
    if (*cell == NULL) {
        *cell = make_cell(table, place.cell);
    }
    if (*cell == NULL) {
        return false;
    }
    for (size_t q = 0; q < count; q++) {
        double slope[3];
        value[q] = polynomial((*cell)->coefficient[(size_t)first + q], place.t, slope);
        for (size_t a = 0; a < 3; a++) {
            slope[a] /= place.width_pa[a];
            value[q] += slope[a] * place.beyond_pa[a];
            if (gradient != NULL) {
                gradient[q][a] = slope[a];
            }
        }
    }
    return true;
}

bool blind_field_bend(struct blind_field *field, const double pressure_pa[3], double bend_rad[2], double *stretch) {
    double value[3];
    if (!blind_field_at(field, pressure_pa, BLIND_CURVATURE_X, 3, value, NULL)) {
        return false;
    }
    bend_rad[0] = value[0] * (double)field->table->module.active_length_m;
    bend_rad[1] = value[1] * (double)field->table->module.active_length_m;
    *stretch = value[2];
    return true;
}
