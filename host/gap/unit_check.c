#include "gap/unit_check.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "log/run_columns.h"

#define IMPORT_HINT ", or import the recording with a mapping that names its unit"
#define ROW_MOST_S 1.0          /* a recording with fewer rows cannot be replayed, and is likelier in ms */
#define DUTY_TOLERANCE 1e-3
#define PRESSURE_LEAST_PA 500.0 /* a module that moves has more than that at some time */
#define PRESSURE_MOST_PA 2e6
#define ABSOLUTE_PA 80e3        /* all three chambers always above: nobody drives a module so */
#define LENGTH_MOST_M 1.0
#define TEMPERATURE_LEAST_K 150.0
#define ANGLE_MOST_RAD 6.5
#define QUATERNION_TOLERANCE 0.05
#define QUATERNIONS_WRONG 0.5   /* share of them with another length than one that makes the columns wrong */
#define MOVES_M 3e-3
#define MOVES_DUTY 0.02
#define AGREE 3.0               /* factor within which pressures and set-points agree */

struct unit_check {
    const char *path;
    const struct run_log *log;
    char *error;
    size_t error_bytes;
};

/* What stands in a group of columns. */
struct extent {
    size_t count;
    double least;
    double most; /* of the magnitude */
    size_t row;  /* where that stands .. */
    const char *column;
};

static bool fail(const struct unit_check *check, size_t row, const char *column, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
static bool fail(const struct unit_check *check, size_t row, const char *column, const char *format, ...) {
    char what[512];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(what, sizeof what, format, arguments);
    va_end(arguments);
    (void)snprintf(check->error, check->error_bytes, "%s:%zu: column %s: %s", check->path, check->log->header_line + 1 + row,
                   column, what);
    return false;
}

static double cell(const struct run_log *log, size_t row, int column) {
    return log->value[row * log->columns + (size_t)column];
}

static struct extent extent_of(const struct run_log *log, const char *const *names, size_t count) {
    struct extent extent = {.least = INFINITY, .most = 0.0, .column = names[0]};
    for (size_t i = 0; i < count; i++) {
        const int column = run_log_column(log, names[i]);
        for (size_t row = 0; row < log->rows && column >= 0; row++) {
            const double value = cell(log, row, column);
            if (isnan(value)) {
                continue;
            }
            extent.count++;
            extent.least = fmin(extent.least, value);
            if (fabs(value) > extent.most) {
                extent.most = fabs(value);
                extent.row = row;
                extent.column = names[i];
            }
        }
    }
    return extent;
}

/* --- time --- */

static int compare(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static bool check_time(const struct unit_check *check) {
    const struct run_log *log = check->log;
    const int column = run_log_column(log, "time_s");
    double *step_s = malloc(log->rows * sizeof *step_s);
    if (step_s == NULL) {
        (void)snprintf(check->error, check->error_bytes, "%s: out of memory", check->path);
        return false;
    }
    for (size_t row = 1; row < log->rows; row++) {
        step_s[row - 1] = cell(log, row, column) - cell(log, row - 1, column);
    }
    qsort(step_s, log->rows - 1, sizeof *step_s, compare);
    const double median_s = step_s[(log->rows - 1) / 2];
    free(step_s);
    if (median_s < ROW_MOST_S) {
        return true;
    }
    const bool micro = median_s >= 500.0;
    return fail(check, 1, "time_s",
                "rows are %.4g s apart: that looks like %s; divide the column by %s" IMPORT_HINT
                " (fewer rows than one a second cannot be diagnosed)",
                median_s, micro ? "us" : "ms", micro ? "1e6" : "1000");
}

/* --- duties --- */

static bool check_duties(const struct unit_check *check) {
    static const char *const names[3] = {"valve1", "valve2", "valve3"};
    const struct extent extent = extent_of(check->log, names, 3);
    if (extent.count == 0 || (extent.most <= 1.0 + DUTY_TOLERANCE && extent.least >= -DUTY_TOLERANCE)) {
        return true;
    }
    if (extent.most > 1.0 + DUTY_TOLERANCE && extent.most <= 100.0 + 100.0 * DUTY_TOLERANCE && extent.least >= 0.0) {
        return fail(check, extent.row, extent.column, "%.4g is no duty between 0 and 1: that looks like percent; divide valve1 to valve3 "
                    "by 100" IMPORT_HINT, extent.most);
    }
    return fail(check, extent.row, extent.column,
                "%.4g is no duty between 0 and 1, the share of a PWM period in which the valve is energised: divide valve1 to valve3 by "
                "the count that is a whole period",
                extent.least < -DUTY_TOLERANCE ? extent.least : extent.most);
}

/* --- pressures --- */

static const struct {
    const char *name;
    double factor;
    const char *words;
} pressure_units[] = {{"kPa", 1e3, "1000"}, {"mbar", 1e2, "100"}, {"psi", 6894.757, "6894.757"}, {"bar", 1e5, "1e5"}};
#define PRESSURE_UNITS (sizeof pressure_units / sizeof pressure_units[0])

/* The unit in which `most` is nearest to a pressure that is known; PRESSURE_UNITS: none agrees with it. */
static size_t nearest_unit(double most, double known_pa) {
    size_t best = PRESSURE_UNITS;
    double least = log(AGREE);
    for (size_t u = 0; u < PRESSURE_UNITS; u++) {
        const double apart = fabs(log(most * pressure_units[u].factor / known_pa));
        best = apart < least ? u : best;
        least = fmin(least, apart);
    }
    return best;
}

/* Does the module move? By its tip, or where none was recorded, by its duties; where neither was, it is taken to. */
static bool is_moved(const struct run_log *log) {
    static const char *const duties[3] = {"valve1", "valve2", "valve3"}, *const tip[3] = {"tip_x_m", "tip_y_m", "tip_z_m"};
    double moves_m = 0.0;
    bool has_tip = false;
    for (size_t k = 0; k < 3; k++) {
        double least = INFINITY, most = -INFINITY;
        const int column = run_log_column(log, tip[k]);
        for (size_t row = 0; row < log->rows && column >= 0; row++) {
            least = fmin(least, cell(log, row, column)); /* a NaN changes neither */
            most = fmax(most, cell(log, row, column));
        }
        has_tip = has_tip || most >= least;
        moves_m = fmax(moves_m, most - least);
    }
    const struct extent duty = extent_of(log, duties, 3);
    return has_tip ? moves_m > MOVES_M : duty.count == 0 || duty.most > MOVES_DUTY;
}

static bool reject_pressure(const struct unit_check *check, const struct extent *extent, const char *group, double known_pa) {
    size_t unit = known_pa > 0.0 ? nearest_unit(extent->most, known_pa) : PRESSURE_UNITS;
    if (unit == PRESSURE_UNITS && extent->most < 1.0) {
        unit = PRESSURE_UNITS - 1; /* below one, only bar is left */
    }
    if (unit < PRESSURE_UNITS) {
        return fail(check, extent->row, extent->column, "%.3g is the greatest of %s: that looks like %s, not Pa; multiply the columns by %s"
                    IMPORT_HINT, extent->most, group, pressure_units[unit].name, pressure_units[unit].words);
    }
    return fail(check, extent->row, extent->column,
                "%.3g is the greatest of %s: that looks like kPa (%.3g Pa), psi (%.3g Pa) or mbar (%.3g Pa), not Pa; multiply the columns "
                "by 1000, 6894.757 or 100" IMPORT_HINT,
                extent->most, group, 1e3 * extent->most, 6894.757 * extent->most, 1e2 * extent->most);
}

enum { READINGS, SET_POINTS, SIMULATED, SUPPLY, PRESSURE_GROUPS };

/* Are these numbers another unit's? Best seen beside other pressures of the chambers, `known_pa` (0: there are none). Small
 * set-points alone are no sign, nor are small pressures of a module that does not move. */
static bool is_other_unit(int group, double most, double known_pa, bool moved) {
    if (group == SUPPLY) {
        return most > 0.0 && most < PRESSURE_LEAST_PA;
    }
    if (most <= 0.0 || !moved) {
        return false;
    }
    return known_pa > 0.0 ? most < 0.1 / AGREE * known_pa && nearest_unit(most, known_pa) < PRESSURE_UNITS
                          : most < PRESSURE_LEAST_PA && group != SET_POINTS;
}

static bool check_pressures(const struct unit_check *check) {
    static const struct {
        const char *names[3];
        size_t count;
        const char *words;
    } groups[PRESSURE_GROUPS] = {[READINGS] = {{"p1_pa", "p2_pa", "p3_pa"}, 3, "p1_pa to p3_pa"},
                                 [SET_POINTS] = {{"p1_cmd_pa", "p2_cmd_pa", "p3_cmd_pa"}, 3, "p1_cmd_pa to p3_cmd_pa"},
                                 [SIMULATED] = {{"sim_p1_pa", "sim_p2_pa", "sim_p3_pa"}, 3, "sim_p1_pa to sim_p3_pa"},
                                 [SUPPLY] = {{"supply_pa"}, 1, "supply_pa"}};
    struct extent extent[PRESSURE_GROUPS];
    const bool moved = is_moved(check->log);
    for (int g = 0; g < PRESSURE_GROUPS; g++) {
        extent[g] = extent_of(check->log, groups[g].names, groups[g].count);
    }
    for (int g = 0; g < PRESSURE_GROUPS; g++) {
        double known_pa = 0.0;
        for (int other = 0; other < SUPPLY && g != SUPPLY; other++) {
            known_pa = other != g && extent[other].most >= PRESSURE_LEAST_PA ? fmax(known_pa, extent[other].most) : known_pa;
        }
        if (is_other_unit(g, extent[g].most, known_pa, moved)) {
            return reject_pressure(check, &extent[g], groups[g].words, known_pa);
        }
        if (extent[g].most > PRESSURE_MOST_PA) {
            return fail(check, extent[g].row, extent[g].column,
                        "%.3g Pa is beyond any soft module: is it in another unit? divide the columns to get Pa" IMPORT_HINT,
                        extent[g].most);
        }
        if (g != SUPPLY && extent[g].count > 0 && extent[g].least > ABSOLUTE_PA) {
            return fail(check, extent[g].row, extent[g].column,
                        "%s never fall below %.4g Pa: they look absolute; subtract the ambient pressure (about 101325 Pa), or import the "
                        "recording with a mapping that says subtract_rest",
                        groups[g].words, extent[g].least);
        }
    }
    return true;
}

/* --- tip, angles, temperature --- */

static bool check_lengths(const struct unit_check *check) {
    static const char *const groups[2][3] = {{"tip_x_m", "tip_y_m", "tip_z_m"}, {"sim_tip_x_m", "sim_tip_y_m", "sim_tip_z_m"}};
    for (size_t g = 0; g < 2; g++) {
        const struct extent extent = extent_of(check->log, groups[g], 3);
        if (extent.most > LENGTH_MOST_M) {
            const bool micro = extent.most > 5000.0;
            return fail(check, extent.row, extent.column,
                        "%.4g is the greatest of %s to %s: that looks like %s, not m; divide the columns by %s" IMPORT_HINT, extent.most,
                        groups[g][0], groups[g][2], micro ? "um" : "mm", micro ? "1e6" : "1000");
        }
    }
    return true;
}

static bool check_quaternions(const struct unit_check *check) {
    static const char *const names[4] = {"tip_qw", "tip_qx", "tip_qy", "tip_qz"};
    const struct run_log *log = check->log;
    size_t count = 0, wrong = 0, first = 0;
    double first_size = 0.0;
    for (size_t row = 0; row < log->rows; row++) {
        double square = 0.0;
        for (size_t k = 0; k < 4; k++) {
            const int column = run_log_column(log, names[k]);
            square += column < 0 ? NAN : cell(log, row, column) * cell(log, row, column);
        }
        if (isnan(square)) {
            continue;
        }
        count++;
        if (fabs(sqrt(square) - 1.0) > QUATERNION_TOLERANCE) {
            first = wrong == 0 ? row : first;
            first_size = wrong == 0 ? sqrt(square) : first_size;
            wrong++;
        }
    }
    return count == 0 || (double)wrong < QUATERNIONS_WRONG * (double)count ||
           fail(check, first, "tip_qw",
                "tip_qw to tip_qz have the length %.4g, not 1: they are no quaternion (w, x, y, z)%s; convert them, or import the recording "
                "with a mapping",
                first_size, first_size > 1.5 ? ", but look like angles in degrees" : "");
}

static bool check_single(const struct unit_check *check) {
    static const char *const temperature[1] = {"temperature_k"}, *const angles[2] = {"bend_cmd_rad", "direction_cmd_rad"};
    const struct extent kelvin = extent_of(check->log, temperature, 1), angle = extent_of(check->log, angles, 2);
    if (kelvin.count > 0 && kelvin.most < TEMPERATURE_LEAST_K) {
        return fail(check, kelvin.row, kelvin.column, "%.4g is the greatest: that looks like degC, not K; add 273.15" IMPORT_HINT,
                    kelvin.most);
    }
    if (angle.most > ANGLE_MOST_RAD) {
        return fail(check, angle.row, angle.column, "%.4g is no angle in rad: that looks like degrees; multiply the columns by pi / 180"
                    IMPORT_HINT, angle.most);
    }
    return true;
}

bool unit_check(const char *path, const struct run_log *log, char *error, size_t error_bytes) {
    const struct unit_check check = {path, log, error, error_bytes};
    return check_time(&check) && check_duties(&check) && check_pressures(&check) && check_lengths(&check) &&
           check_quaternions(&check) && check_single(&check);
}
