#include "gap/log_check.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gap/replay.h"

#define REACH 1.6           /* of the module's length: stretch and levers go no further */
#define LEVER_M 0.02        /* a sensor may stand so far from the tip's face */
#define BEYOND_SHARE 0.1    /* of the samples: more is no mistake of the sensor */
#define REST_PA 500.0       /* all chambers below: straight, but for weights */
#define REST_SHARE 0.4      /* of the length by which the tip may be off then .. */
#define REST_OFF_M 0.025    /* .. and at least so much */
#define REST_LEAST 10       /* samples at rest that count */
#define TIPS_MOST 1500      /* of a run, that tell directions */
#define WINDOW_S 0.025      /* on either side, over which pressures are averaged */
#define MOVES_M 2e-3        /* rms across the axis: less has no direction */
#define MOVES_PA 700.0      /* rms of the readings: less has no course */
#define BAD 0.3             /* of the squares unexplained as logged: effects leave far less .. */
#define GOOD 0.2            /* .. and this share of that, at most, in another order */
#define ALIKE 1.5           /* orders that explain it nearly as well: the one that exchanges less is meant */
#define TURNED_RAD (25.0 * M_PI / 180.0) /* sensors sit askew by ten degrees, not by so much */
#define ORDERS 6
#define STIFFNESSES 5

/* Column c holds what chamber order[c] has; the first is as it should be, then those that exchange two, then the others. */
static const size_t orders[ORDERS][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {2, 1, 0}, {1, 2, 0}, {2, 0, 1}};

struct finding {
    bool known;
    size_t order; /* index into `orders`; 0: none explains the data better than the one that it has */
    bool good;    /* the one that it has explains the data */
    bool turned;  /* no order explains it, but a turn about the axis does */
    double turn_rad;
};

static bool fail(char *error, size_t error_bytes, const struct gap_run *run, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
static bool fail(char *error, size_t error_bytes, const struct gap_run *run, const char *format, ...) {
    char what[768];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(what, sizeof what, format, arguments);
    va_end(arguments);
    (void)snprintf(error, error_bytes, "%s:%zu: %s", run->path, run->header_line, what);
    return false;
}

#define TRUST "; --trust-columns takes the log as it is"

/* --- where the tip can be --- */

static double length_of(const struct bend_table_module *module) {
    return (double)module->chamber_length_m + (double)module->cap_proximal_m + (double)module->cap_distal_m;
}

/* Highest pressure known at a time; NAN: none is known. `row` remembers where the last one was. */
static double highest_pa(const struct gap_run *run, double time_s, size_t *row) {
    const double *value = run->has_reading ? run->reading_pa : run->command_pa;
    while (*row + 1 < run->rows && run->time_s[*row + 1] <= time_s) {
        (*row)++;
    }
    return run->has_reading || run->has_command ? fmax(fmax(value[3 * *row], value[3 * *row + 1]), value[3 * *row + 2]) : NAN;
}

static bool check_reach(const struct gap_run *run, const struct bend_table_module *module, char *error, size_t error_bytes) {
    const double length_m = length_of(module), most_m = REACH * length_m + LEVER_M;
    size_t beyond = 0, resting = 0, row = 0;
    double farthest_m = 0.0, rest_m[3] = {0.0};
    for (size_t i = 0; i < run->tips; i++) {
        const double *at_m = run->tip[i].position_m;
        const double far_m = sqrt(at_m[0] * at_m[0] + at_m[1] * at_m[1] + at_m[2] * at_m[2]);
        beyond += far_m > most_m;
        farthest_m = fmax(farthest_m, far_m);
        if (highest_pa(run, run->tip[i].time_s, &row) < REST_PA) {
            resting++;
            for (size_t k = 0; k < 3; k++) {
                rest_m[k] += (at_m[k] - rest_m[k]) / (double)resting;
            }
        }
    }
    if ((double)beyond > BEYOND_SHARE * (double)run->tips) {
        return fail(error, error_bytes, run,
                    "columns tip_x_m to tip_z_m: the tip is up to %.0f mm from the base, but module %s is %.0f mm long: is it another "
                    "module (--table), or is the origin not the centre of its clamped end? import the recording with a mapping that "
                    "gives the frame" TRUST,
                    1e3 * farthest_m, module->name, 1e3 * length_m);
    }
    const double off_m = sqrt(rest_m[0] * rest_m[0] + rest_m[1] * rest_m[1] + pow(rest_m[2] - length_m, 2.0));
    if (resting >= REST_LEAST && off_m > fmax(REST_SHARE * length_m, REST_OFF_M)) {
        return fail(error, error_bytes, run,
                    "columns tip_x_m to tip_z_m: without pressure the tip is at (%.0f, %.0f, %.0f) mm, but that of module %s at (0, 0, "
                    "%.0f) mm: is it another module (--table), or not the base frame (origin at the centre of the clamped end, z "
                    "along the module)? import the recording with a mapping that gives the frame" TRUST,
                    1e3 * rest_m[0], 1e3 * rest_m[1], 1e3 * rest_m[2], module->name, 1e3 * length_m);
    }
    return true;
}

/* --- orders --- */

/* Of the shares that each order leaves unexplained: which is meant? */
static struct finding judge(const double rest[ORDERS]) {
    struct finding finding = {.known = true, .good = rest[0] <= BAD};
    size_t best = 0;
    for (size_t o = 1; o < ORDERS; o++) {
        best = rest[o] < rest[best] ? o : best;
    }
    if (rest[0] > BAD && rest[best] < GOOD * rest[0]) {
        for (size_t o = 1; o < ORDERS && finding.order == 0; o++) {
            finding.order = rest[o] <= ALIKE * rest[best] ? o : 0;
        }
    }
    return finding;
}

/* What each chamber has beyond the mean of the three: what all have alike tells nothing of their order. */
static void differences(const double value[3], double difference[3]) {
    const double mean = (value[0] + value[1] + value[2]) / 3.0;
    for (size_t c = 0; c < 3; c++) {
        difference[c] = value[c] - mean;
    }
}

/* Readings against the pressures that the duties make, or that another simulator gives. */
static struct finding order_of_readings(const struct replay *replay, const struct replay_state *state) {
    double product[3][3] = {{0.0}}, reading2[3] = {0.0}, simulated2[3] = {0.0}, count = 0.0, rest[ORDERS];
    for (size_t i = 0; i < replay->runs; i++) {
        const struct replay_run *run = &replay->run[i];
        for (size_t row = 0; row < run->run->rows; row++) {
            const size_t step = run->row_step[row] < run->steps ? run->row_step[row] : run->steps;
            double reading_pa[3], simulated_pa[3];
            differences(run->run->reading_pa + 3 * row, reading_pa);
            differences(state->pressure_pa[i] + 3 * step, simulated_pa);
            if (isnan(reading_pa[0])) {
                continue;
            }
            count += 1.0;
            for (size_t c = 0; c < 3; c++) {
                reading2[c] += reading_pa[c] * reading_pa[c];
                simulated2[c] += simulated_pa[c] * simulated_pa[c];
                for (size_t d = 0; d < 3; d++) {
                    product[c][d] += reading_pa[c] * simulated_pa[d];
                }
            }
        }
    }
    const double all_readings = reading2[0] + reading2[1] + reading2[2], all_simulated = simulated2[0] + simulated2[1] + simulated2[2];
    if (count == 0.0 || all_readings / count < MOVES_PA * MOVES_PA || all_simulated / count < MOVES_PA * MOVES_PA) {
        return (struct finding){.known = false};
    }
    for (size_t o = 0; o < ORDERS; o++) { /* one gain for all: a supply may be off */
        const double sum = product[0][orders[o][0]] + product[1][orders[o][1]] + product[2][orders[o][2]];
        rest[o] = sum > 0.0 ? 1.0 - sum * sum / (all_readings * all_simulated) : 1.0;
    }
    return judge(rest);
}

/* What was recorded of a tip at one time, and the pressures about then. */
struct sight {
    double across_m[2];
    double pressure_pa[3];
};

/* Mean of rows within the window. False: none has all three. */
static bool mean_pressures(const struct gap_run *run, const double *value, double time_s, size_t *row, double mean_pa[3]) {
    size_t count = 0;
    memset(mean_pa, 0, 3 * sizeof *mean_pa);
    while (*row < run->rows && run->time_s[*row] < time_s - WINDOW_S) {
        (*row)++;
    }
    for (size_t r = *row; r < run->rows && run->time_s[r] <= time_s + WINDOW_S; r++) {
        if (!isnan(value[3 * r] + value[3 * r + 1] + value[3 * r + 2])) {
            count++;
            for (size_t c = 0; c < 3; c++) {
                mean_pa[c] += (value[3 * r + c] - mean_pa[c]) / (double)count;
            }
        }
    }
    return count > 0;
}

enum view {
    VIEW_BY_READINGS, /* or what stands in for them: another simulator's pressures, set-points */
    VIEW_BY_DUTIES,
    VIEW_OF_SIMULATOR /* another simulator's tip, at its pressures where it gives them */
};

static const double *pressures_of(const struct gap_run *run, enum view view) {
    if (view == VIEW_BY_DUTIES) {
        return NULL;
    }
    if (run->sim_pa != NULL && (view == VIEW_OF_SIMULATOR || !run->has_reading)) {
        return run->sim_pa;
    }
    return run->has_reading ? run->reading_pa : run->has_command ? run->command_pa : NULL;
}

static size_t see(const struct replay *replay, const struct replay_state *state, enum view view, struct sight *sight) {
    size_t count = 0;
    for (size_t i = 0; i < replay->runs; i++) {
        const struct replay_run *run = &replay->run[i];
        const struct gap_run *data = run->run;
        const size_t stride = data->tips / TIPS_MOST + 1;
        const bool of_simulator = view == VIEW_OF_SIMULATOR;
        const double *value = pressures_of(data, view);
        size_t row = 0;
        for (size_t t = 0; t < data->tips && !(of_simulator && data->sim_tip == NULL); t += stride) {
            const double time_s = data->tip[t].time_s;
            const double *at_m = of_simulator ? data->sim_tip[t].position_m : data->tip[t].position_m;
            struct sight *next = &sight[count];
            next->across_m[0] = at_m[0];
            next->across_m[1] = at_m[1];
            if (value != NULL) {
                count += mean_pressures(data, value, time_s, &row, next->pressure_pa);
            } else if (data->has_duty && !of_simulator) {
                const double step = fmax((time_s - 1e-6 * (double)run->start_us) / (1e-6 * (double)replay->step_us), 0.0);
                const size_t at = step < (double)run->steps ? (size_t)step : run->steps;
                memcpy(next->pressure_pa, state->pressure_pa[i] + 3 * at, sizeof next->pressure_pa);
                count++;
            }
        }
    }
    return count;
}

/* Sums about the mean of two series of plane vectors: a's squares, b's, and how a follows b, as it is and a quarter turn ahead. */
struct likeness {
    double count;
    double mean[2][2];
    double square[2];
    double dot;
    double cross;
};

static void add(struct likeness *sum, const double a[2], const double b[2]) {
    double off[2][2], late[2][2];
    sum->count += 1.0;
    for (size_t k = 0; k < 2; k++) { /* Welford's way, so that large means do no harm */
        off[0][k] = a[k] - sum->mean[0][k];
        off[1][k] = b[k] - sum->mean[1][k];
        sum->mean[0][k] += off[0][k] / sum->count;
        sum->mean[1][k] += off[1][k] / sum->count;
        late[0][k] = a[k] - sum->mean[0][k];
        late[1][k] = b[k] - sum->mean[1][k];
        sum->square[0] += off[0][k] * late[0][k];
        sum->square[1] += off[1][k] * late[1][k];
    }
    sum->dot += off[0][0] * late[1][0] + off[0][1] * late[1][1];
    sum->cross += off[1][0] * late[0][1] - off[1][1] * late[0][0];
}

static double unexplained(const struct likeness *sum, double along) {
    const double both = sum->square[0] * sum->square[1];
    return along > 0.0 && both > 0.0 ? 1.0 - along * along / both : 1.0;
}

/* Tips against those of the table at the pressures in each order; the stiffness is whichever fits best. */
static struct finding order_of_tips(const struct bend_table *table, const struct sight *sight, size_t count) {
    static const double stiffness[STIFFNESSES] = {0.55, 0.75, 1.0, 1.35, 1.8};
    double rest[ORDERS], turned = 1.0, turn_rad = 0.0, moves2 = 0.0;
    for (size_t o = 0; o < ORDERS; o++) {
        rest[o] = 1.0;
        for (size_t s = 0; s < STIFFNESSES && !(o > 0 && rest[0] <= BAD); s++) { /* as it is, it is good enough */
            struct likeness sum = {.count = 0.0};
            for (size_t i = 0; i < count; i++) {
                double load_pa[3];
                struct body_shape shape;
                struct tip_pose pose;
                for (size_t c = 0; c < 3; c++) {
                    load_pa[orders[o][c]] = sight[i].pressure_pa[c] / stiffness[s];
                }
                body_shape_at(table, load_pa, &shape);
                body_tip_pose(&table->module, &shape, &pose);
                add(&sum, sight[i].across_m, pose.position_m);
            }
            rest[o] = fmin(rest[o], unexplained(&sum, sum.dot));
            const double free = unexplained(&sum, hypot(sum.dot, sum.cross));
            if (o == 0 && free < turned) {
                turned = free;
                turn_rad = atan2(sum.cross, sum.dot);
            }
            moves2 = count > 0 ? sum.square[0] / (double)count : 0.0;
        }
    }
    if (moves2 < MOVES_M * MOVES_M) {
        return (struct finding){.known = false};
    }
    struct finding finding = judge(rest);
    if (finding.order == 0 && rest[0] > BAD && turned < GOOD * rest[0] && fabs(turn_rad) > TURNED_RAD) {
        finding.turned = true;
        finding.turn_rad = turn_rad;
    }
    return finding;
}

/* --- what to say --- */

/* "valve2 and valve3 are exchanged", or who holds whose. `format` makes a column's name from its number. */
static void describe(size_t order, const char *format, char *text, size_t text_bytes) {
    size_t used = 0, first = 3, second = 3;
    for (size_t c = 0; c < 3; c++) {
        if (orders[order][c] != c) {
            second = first < 3 && second == 3 ? c : second;
            first = first == 3 ? c : first;
        }
    }
    char name[3][24];
    for (size_t c = 0; c < 3; c++) {
        (void)snprintf(name[c], sizeof name[c], format, c + 1); // NOLINT(clang-diagnostic-format-nonliteral)
    }
    const bool swap = first < 3 && orders[order][orders[order][first]] == first;
    if (swap) {
        (void)snprintf(text, text_bytes, "swap columns %s and %s", name[first], name[second]);
        return;
    }
    for (size_t c = 0; c < 3 && used < text_bytes; c++) {
        used += (size_t)snprintf(text + used, text_bytes - used, "%s %s to %s", c == 0 ? "rename columns" : ",", name[c],
                                 name[orders[order][c]]);
    }
}

static void name_chambers(size_t order, const char *prefix, const char *suffix, char *text, size_t text_bytes) {
    size_t used = 0, left = 0;
    for (size_t c = 0; c < 3; c++) {
        left += orders[order][c] != c;
    }
    *text = '\0';
    for (size_t c = 0; c < 3 && used < text_bytes; c++) {
        if (orders[order][c] != c) {
            left--;
            used += (size_t)snprintf(text + used, text_bytes - used, "%s%zu%s%s", prefix, c + 1, suffix,
                                     left > 1 ? ", " : left == 1 ? " and " : "");
        }
    }
}

struct findings {
    struct finding readings;       /* against the duties, or another simulator's pressures */
    struct finding tip;            /* against the readings */
    struct finding tip_by_duties;
    struct finding simulator;      /* its tip against its pressures */
};

static size_t inverse(size_t order) {
    for (size_t o = 0; o < ORDERS; o++) {
        const size_t *a = orders[order], *b = orders[o];
        if (b[a[0]] == 0 && b[a[1]] == 1 && b[a[2]] == 2) {
            return o;
        }
    }
    return 0;
}

static bool report_columns(const struct gap_run *run, const char *format, size_t order, const char *why, char *error,
                           size_t error_bytes) {
    char who[80], remedy[256];
    describe(order, format, remedy, sizeof remedy);
    name_chambers(order, strncmp(format, "valve", 5) == 0 ? "valve" : "p", "", who, sizeof who);
    return fail(error, error_bytes, run, "the log's chambers look exchanged: %s %s; %s and repeat" TRUST, who, why, remedy);
}

static bool report(const struct gap_run *run, const struct findings *found, char *error, size_t error_bytes) {
    const struct finding *readings = &found->readings, *tip = &found->tip, *by_duties = &found->tip_by_duties;
    const char *const columns = run->has_reading ? "p%zu_pa" : run->has_command ? "p%zu_cmd_pa" : "valve%zu";
    const bool read_wrong = tip->order > 0 || readings->order > 0, driven_wrong = by_duties->order > 0 || readings->order > 0;
    if (run->has_reading && by_duties->good && read_wrong && !tip->good) {
        return report_columns(run, columns, tip->order > 0 ? tip->order : readings->order,
                              "do not follow their own valves, but each other's, and the tip follows the valves", error, error_bytes);
    }
    if (run->has_reading && tip->good && driven_wrong && by_duties->known && !by_duties->good) {
        return report_columns(run, "valve%zu", by_duties->order > 0 ? by_duties->order : inverse(readings->order),
                              "do not drive the chambers that bend the module as the pressures say", error, error_bytes);
    }
    if (tip->order > 0) {
        const size_t *order = orders[tip->order];
        const bool third = order[0] != 0 && order[1] != 1 && order[2] != 2;
        char why[256];
        (void)snprintf(why, sizeof why,
                       "do not bend the tip to where these chambers stand (chamber 1 alone towards -x, 2 and 3 counter-clockwise seen "
                       "from the tip)%s%s",
                       third ? ", or the tip's frame is turned by a third" : "",
                       by_duties->order == tip->order ? "; that goes for the valves as well" : "");
        return report_columns(run, columns, tip->order, why, error, error_bytes);
    }
    if (readings->order > 0) {
        return report_columns(run, columns, readings->order,
                              run->sim_pa != NULL ? "do not follow the other simulator's, but each other's"
                                                  : "do not follow their own valves, but each other's (or the valves are exchanged)",
                              error, error_bytes);
    }
    if (tip->turned) {
        return fail(error, error_bytes, run,
                    "columns tip_x_m and tip_y_m: the tip moves as the pressures say, but turned by %.0f deg about z: it is not in the base "
                    "frame (x through chamber 1); turn it back, or import the recording with a mapping that gives the frame" TRUST,
                    tip->turn_rad * 180.0 / M_PI);
    }
    return true;
}

static bool check_orders(const struct replay *replay, const struct gap_data *data, const struct bend_table *table,
                         struct replay_state *state, char *error, size_t error_bytes) {
    const struct gap_model plain = {.stiffness_scale = 1.0, .supply_scale = 1.0};
    const struct gap_run *run = &data->run[0];
    struct findings found = {.readings = {.known = false}};
    struct sight *sight = calloc(data->runs * (2 * TIPS_MOST) + 1, sizeof *sight);
    if (sight == NULL) {
        return true;
    }
    replay_pressures(replay, &plain, state);
    if (run->has_duty && run->has_reading) {
        found.readings = order_of_readings(replay, state);
    }
    found.tip = order_of_tips(table, sight, see(replay, state, VIEW_BY_READINGS, sight));
    if (run->has_duty && run->sim_pa == NULL) {
        found.tip_by_duties = order_of_tips(table, sight, see(replay, state, VIEW_BY_DUTIES, sight));
    }
    found.simulator = order_of_tips(table, sight, see(replay, state, VIEW_OF_SIMULATOR, sight));
    free(sight);
    if (found.simulator.order > 0 || found.simulator.turned) {
        return fail(error, error_bytes, run,
                    "columns sim_tip_x_m to sim_tip_z_m: the other simulator's tip does not bend to where its chambers stand: it is not in "
                    "the base frame (x through chamber 1, chamber 1 alone moves the tip towards -x), or numbers the chambers otherwise; "
                    "turn it, or rename its columns, and repeat" TRUST);
    }
    return report(run, &found, error, error_bytes);
}

bool log_check(const struct gap_data *data, const struct bend_table *table, const struct plant_parameters *nominal, char *error,
               size_t error_bytes) {
    struct replay replay;
    struct replay_state state;
    bool fits = true;
    for (size_t i = 0; i < data->runs && fits; i++) {
        fits = check_reach(&data->run[i], &table->module, error, error_bytes);
    }
    if (!fits || !replay_open(&replay, data, table, nominal)) {
        return fits;
    }
    if (replay_state_open(&state, &replay)) {
        fits = check_orders(&replay, data, table, &state, error, error_bytes);
    }
    replay_state_close(&state, &replay);
    replay_close(&replay);
    return fits;
}
