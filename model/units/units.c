#include "units/units.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct unit {
    enum units_kind kind;
    const char *suffix;
    double factor;
};

static const struct unit units[] = {
    {UNITS_PRESSURE, "Pa", 1.0},     {UNITS_PRESSURE, "kPa", 1e3},       {UNITS_PRESSURE, "mbar", 1e2},
    {UNITS_PRESSURE, "bar", 1e5},    {UNITS_ANGLE, "deg", M_PI / 180.0}, {UNITS_ANGLE, "rad", 1.0},
    {UNITS_TIME, "s", 1.0},          {UNITS_TIME, "ms", 1e-3},           {UNITS_TIME, "min", 60.0},
    {UNITS_LENGTH, "m", 1.0},        {UNITS_LENGTH, "mm", 1e-3},         {UNITS_LENGTH, "um", 1e-6},
    {UNITS_MASS, "kg", 1.0},         {UNITS_MASS, "g", 1e-3},         {UNITS_FORCE, "N", 1.0},
    {UNITS_FORCE, "mN", 1e-3}};
static const char *const kind_name[] = {"a pressure", "an angle", "a time", "a length", "a mass", "a force"};
static const char *const kind_units[] = {"Pa, kPa, mbar or bar", "deg or rad", "s, ms or min", "m, mm or um", "kg or g",
                                         "N or mN"};
static const char *const kind_example[] = {"40mbar", "60deg", "5s", "12mm", "20g", "0.1N"};

static const struct unit *find_unit(const char *suffix) {
    for (size_t i = 0; i < sizeof units / sizeof units[0]; i++) {
        if (strcmp(units[i].suffix, suffix) == 0) {
            return &units[i];
        }
    }
    return NULL;
}

bool units_parse(enum units_kind kind, const char *text, double *value, char *error, size_t error_bytes) {
    char *end = NULL;
    const double number = strtod(text, &end);
    if (end == text || !isfinite(number)) {
        (void)snprintf(error, error_bytes, "'%s' is not %s; write for example %s", text, kind_name[kind],
                       kind_example[kind]);
        return false;
    }
    if (*end == '\0') {
        (void)snprintf(error, error_bytes, "'%s' has no unit; %s takes %s, for example %s", text, kind_name[kind],
                       kind_units[kind], kind_example[kind]);
        return false;
    }
    const struct unit *unit = find_unit(end);
    if (unit == NULL || unit->kind != kind) {
        (void)snprintf(error, error_bytes, "'%s' has the unit '%s'; %s takes %s, for example %s", text, end,
                       kind_name[kind], kind_units[kind], kind_example[kind]);
        return false;
    }
    *value = number * unit->factor;
    return true;
}

bool units_kind_of(const char *text, enum units_kind *kind) {
    char *end = NULL;
    (void)strtod(text, &end);
    const struct unit *unit = end == text ? NULL : find_unit(end);
    if (unit != NULL) {
        *kind = unit->kind;
    }
    return unit != NULL;
}
