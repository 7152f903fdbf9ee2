#include "log/run_columns.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PA_PER_PSI 6894.757293168361 /* pound-force 4.4482216152605 N over (25.4 mm)^2 */

struct column {
    const char *name;
    enum run_dimension dimension;
};

static const struct column columns[] = {
    {"time_s", RUN_TIME},        {"valve1", RUN_NUMBER},      {"valve2", RUN_NUMBER},
    {"valve3", RUN_NUMBER},      {"p1_cmd_pa", RUN_PRESSURE}, {"p2_cmd_pa", RUN_PRESSURE},
    {"p3_cmd_pa", RUN_PRESSURE}, {"p1_pa", RUN_PRESSURE},     {"p2_pa", RUN_PRESSURE},
    {"p3_pa", RUN_PRESSURE},     {"supply_pa", RUN_PRESSURE}, {"tip_x_m", RUN_LENGTH},
    {"tip_y_m", RUN_LENGTH},     {"tip_z_m", RUN_LENGTH},     {"tip_qw", RUN_NUMBER},
    {"tip_qx", RUN_NUMBER},      {"tip_qy", RUN_NUMBER},      {"tip_qz", RUN_NUMBER},
    {"tip_quality", RUN_NUMBER}, {"tip_status", RUN_NUMBER},  {"temperature_k", RUN_TEMPERATURE},
    {"state", RUN_STATE},        {"bend_cmd_rad", RUN_ANGLE}, {"direction_cmd_rad", RUN_ANGLE},
    {"sim_tip_x_m", RUN_LENGTH}, {"sim_tip_y_m", RUN_LENGTH}, {"sim_tip_z_m", RUN_LENGTH},
    {"sim_tip_qw", RUN_NUMBER},  {"sim_tip_qx", RUN_NUMBER},  {"sim_tip_qy", RUN_NUMBER},
    {"sim_tip_qz", RUN_NUMBER},  {"sim_p1_pa", RUN_PRESSURE}, {"sim_p2_pa", RUN_PRESSURE},
    {"sim_p3_pa", RUN_PRESSURE}};
#define COLUMNS (sizeof columns / sizeof columns[0])

static const struct run_unit units[] = {{"m", RUN_LENGTH, 1.0, 0.0},
                                        {"mm", RUN_LENGTH, 1e-3, 0.0},
                                        {"um", RUN_LENGTH, 1e-6, 0.0},
                                        {"s", RUN_TIME, 1.0, 0.0},
                                        {"ms", RUN_TIME, 1e-3, 0.0},
                                        {"us", RUN_TIME, 1e-6, 0.0},
                                        {"Pa", RUN_PRESSURE, 1.0, 0.0},
                                        {"kPa", RUN_PRESSURE, 1e3, 0.0},
                                        {"mbar", RUN_PRESSURE, 1e2, 0.0},
                                        {"bar", RUN_PRESSURE, 1e5, 0.0},
                                        {"psi", RUN_PRESSURE, PA_PER_PSI, 0.0},
                                        {"rad", RUN_ANGLE, 1.0, 0.0},
                                        {"deg", RUN_ANGLE, M_PI / 180.0, 0.0},
                                        {"K", RUN_TEMPERATURE, 1.0, 0.0},
                                        {"degC", RUN_TEMPERATURE, 1.0, 273.15},
                                        {"1", RUN_NUMBER, 1.0, 0.0},
                                        {"%", RUN_NUMBER, 1e-2, 0.0}};
#define UNITS (sizeof units / sizeof units[0])

bool run_column_find(const char *name, enum run_dimension *dimension) {
    for (size_t c = 0; c < COLUMNS; c++) {
        if (strcmp(columns[c].name, name) == 0) {
            *dimension = columns[c].dimension;
            return true;
        }
    }
    return false;
}

const struct run_unit *run_unit_find(const char *name) {
    for (size_t u = 0; u < UNITS; u++) {
        if (strcmp(units[u].name, name) == 0) {
            return &units[u];
        }
    }
    return NULL;
}

const char *run_dimension_words(enum run_dimension dimension) {
    switch (dimension) {
    case RUN_TIME:
        return "a time (s, ms or us)";
    case RUN_PRESSURE:
        return "a pressure (Pa, kPa, mbar, bar or psi)";
    case RUN_LENGTH:
        return "a length (m, mm or um)";
    case RUN_ANGLE:
        return "an angle (rad or deg)";
    case RUN_TEMPERATURE:
        return "a temperature (K or degC)";
    case RUN_STATE:
        return "a state of the controller (1: its number)";
    case RUN_NUMBER:
    default:
        return "a number without dimension (1 or %)";
    }
}

double run_unit_to_si(const struct run_unit *unit, double value) {
    return (value + unit->zero) * unit->factor;
}

bool run_column_parse(const char *name, const char *text, double *value, char *error, size_t error_bytes) {
    enum run_dimension dimension = RUN_NUMBER;
    char *end = NULL;
    if (!run_column_find(name, &dimension)) {
        char list[1024];
        run_column_list(list, sizeof list);
        (void)snprintf(error, error_bytes, "a run log has no column '%.32s'; it has: %s", name, list);
        return false;
    }
    const enum run_dimension wanted = dimension == RUN_STATE ? RUN_NUMBER : dimension;
    const double number = strtod(text, &end);
    const struct run_unit *unit = run_unit_find(*end == '\0' && wanted == RUN_NUMBER ? "1" : end);
    if (end == text || !isfinite(number) || unit == NULL || unit->dimension != wanted) {
        (void)snprintf(error, error_bytes,
                       "'%.32s' is no value for %s: write a number and its unit, with no space; it is %s",
                       text, name, run_dimension_words(dimension));
        return false;
    }
    *value = run_unit_to_si(unit, number);
    return true;
}

size_t run_column_count(void) {
    return COLUMNS;
}

const char *run_column_name(size_t index) {
    return columns[index].name;
}

void run_column_list(char *text, size_t text_bytes) {
    size_t used = 0;
    for (size_t c = 0; c < COLUMNS && used < text_bytes; c++) {
        used += (size_t)snprintf(text + used, text_bytes - used, "%s%s", c > 0 ? ", " : "", columns[c].name);
    }
}
