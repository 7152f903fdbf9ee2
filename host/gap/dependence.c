#include "gap/dependence.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "gap/report_series.h"

#define DEGREES (180.0 / M_PI)
#define SEED 20250117u
#define STEP_LEAST_S 0.1 /* of the rows: two blocks of the tip, five of the pressures */
#define ROWS_MOST 1500
#define STILL_SHARE 0.1  /* of a rate's rms: slower is neither loading nor unloading */
#define CYCLE_HIGH 0.6   /* of a chamber's greatest pressure: a cycle begins where it rises over this .. */
#define CYCLE_LOW 0.3    /* .. after it was below that */

enum variable {
    PRESSURE_1,
    RATE_1 = PRESSURE_1 + 3,
    LOADING_1 = RATE_1 + 3,
    TIME = LOADING_1 + 3,
    CYCLES,
    BEND,
    DIRECTION,
    TEMPERATURE,
    VARIABLES
};

struct residual_row {
    const char *name;
    const char *channel;
    size_t chamber;
    size_t offset; /* from REPORT_RESIDUAL_BEFORE or REPORT_RESIDUAL_AFTER */
    bool tip;
};

static const struct residual_row residual_rows[] = {
    {"r1_pressure", "chamber 1", 1, 0, false},
    {"r1_pressure", "chamber 2", 2, 1, false},
    {"r1_pressure", "chamber 3", 3, 2, false},
    {"r2_position", "along the bend", 0, REPORT_OFF_ALONG, true},
    {"r2_position", "across the bend", 0, REPORT_OFF_ACROSS, true},
    {"r2_position", "along the axis", 0, REPORT_OFF_HEIGHT, true},
    {"r2_angle", "bend", 0, REPORT_TURNED_ALONG, true},
    {"r2_angle", "direction", 0, REPORT_TURNED_ACROSS, true},
    {"r2_angle", "twist", 0, REPORT_TWISTED, true}};
#define RESIDUALS (sizeof residual_rows / sizeof residual_rows[0])

/* All runs on one grid of time. */
struct grid {
    double step_s;
    size_t rows;
    size_t runs;
    size_t first[GAP_RUNS_MAX + 1];
    double *variable[VARIABLES];
    double *residual[2][RESIDUALS]; /* of recalibration, of the best model */
    double *count;                  /* to average with */
};

static double *new_column(size_t rows, bool *sound) {
    double *column = malloc((rows + 1) * sizeof *column);
    for (size_t i = 0; i < rows && column != NULL; i++) {
        column[i] = NAN;
    }
    *sound = *sound && column != NULL;
    return column;
}

static bool grid_open(struct grid *grid, const struct replay *replay) {
    double seconds = 0.0;
    bool sound = true;
    memset(grid, 0, sizeof *grid);
    grid->runs = replay->runs;
    for (size_t i = 0; i < replay->runs; i++) {
        seconds += 1e-6 * REPLAY_STEP_US * (double)replay->run[i].steps;
    }
    grid->step_s = STEP_LEAST_S * fmax(ceil(seconds / (STEP_LEAST_S * ROWS_MOST)), 1.0);
    for (size_t i = 0; i < replay->runs; i++) {
        grid->first[i] = grid->rows;
        grid->rows += (size_t)(1e-6 * REPLAY_STEP_US * (double)replay->run[i].steps / grid->step_s);
    }
    grid->first[replay->runs] = grid->rows;
    for (size_t v = 0; v < VARIABLES; v++) {
        grid->variable[v] = new_column(grid->rows, &sound);
    }
    for (size_t r = 0; r < RESIDUALS; r++) {
        grid->residual[0][r] = new_column(grid->rows, &sound);
        grid->residual[1][r] = new_column(grid->rows, &sound);
    }
    grid->count = new_column(grid->rows, &sound);
    return sound;
}

static void grid_close(struct grid *grid) {
    for (size_t v = 0; v < VARIABLES; v++) {
        free(grid->variable[v]);
    }
    for (size_t r = 0; r < RESIDUALS; r++) {
        free(grid->residual[0][r]);
        free(grid->residual[1][r]);
    }
    free(grid->count);
}

/* --- filling it --- */

static size_t place(const struct grid *grid, size_t run, double since_s) {
    const size_t at = since_s > 0.0 ? (size_t)(since_s / grid->step_s) : 0;
    return at < grid->first[run + 1] - grid->first[run] ? grid->first[run] + at : SIZE_MAX;
}

static void start_means(struct grid *grid) {
    for (size_t i = 0; i < grid->rows; i++) {
        grid->count[i] = 0.0;
    }
}

static void add_to_mean(struct grid *grid, double *column, size_t at, double value) {
    if (at != SIZE_MAX && !isnan(value)) {
        column[at] = grid->count[at] > 0.0 ? column[at] : 0.0;
        grid->count[at] += 1.0;
        column[at] += (value - column[at]) / grid->count[at];
    }
}

/* A column of the series' tables, averaged over the grid's steps. */
static void take_column(struct grid *grid, const struct report_series *series, bool tip, size_t column, double *to) {
    start_means(grid);
    for (size_t i = 0; i < series->runs; i++) {
        const struct report_table *table = tip ? &series->run[i].tip : &series->run[i].pressure;
        for (size_t row = 0; row < table->rows; row++) {
            const double *cell = table->cell + row * REPORT_COLUMNS;
            add_to_mean(grid, to, place(grid, i, cell[REPORT_TIME]), cell[column]);
        }
    }
}

/* The pose that the recalibrated model says; by how far off the axis it is, where no orientation was measured. */
static void take_pose(struct grid *grid, const struct report_series *series, bool turned, bool *bend_is_angle) {
    *bend_is_angle = turned;
    if (turned) {
        take_column(grid, series, true, REPORT_BEFORE + REPORT_TIP_BEND, grid->variable[BEND]);
        take_column(grid, series, true, REPORT_BEFORE + REPORT_TIP_DIRECTION, grid->variable[DIRECTION]);
        return;
    }
    take_column(grid, series, true, REPORT_BEFORE + REPORT_TIP_X, grid->variable[BEND]);
    take_column(grid, series, true, REPORT_BEFORE + REPORT_TIP_Y, grid->variable[DIRECTION]);
    for (size_t i = 0; i < grid->rows; i++) {
        const double x_mm = grid->variable[BEND][i], y_mm = grid->variable[DIRECTION][i], off_mm = hypot(x_mm, y_mm);
        grid->variable[BEND][i] = off_mm;
        grid->variable[DIRECTION][i] = off_mm > 1.0 ? DEGREES * atan2(y_mm, x_mm) : NAN;
    }
}

static void take_pressures(struct grid *grid, const struct replay *replay, const struct replay_state *state) {
    for (size_t i = 0; i < replay->runs; i++) {
        const struct replay_run *run = &replay->run[i];
        const double steps = grid->step_s / (1e-6 * REPLAY_STEP_US);
        for (size_t row = grid->first[i]; row < grid->first[i + 1]; row++) {
            const size_t from = (size_t)((double)(row - grid->first[i]) * steps), last = from + (size_t)steps;
            const size_t to = last < run->steps ? last : run->steps, middle = (from + to) / 2;
            for (size_t c = 0; c < 3; c++) {
                const double *pressure_pa = state->pressure_pa[i] + c;
                grid->variable[PRESSURE_1 + c][row] = 1e-3 * pressure_pa[3 * middle];
                grid->variable[RATE_1 + c][row] = 1e-3 * (pressure_pa[3 * to] - pressure_pa[3 * from]) / grid->step_s;
            }
        }
    }
}

/* Unloading, still or loading. */
static void take_loading(struct grid *grid) {
    for (size_t c = 0; c < 3; c++) {
        const double *rate = grid->variable[RATE_1 + c];
        double square = 0.0;
        for (size_t i = 0; i < grid->rows; i++) {
            square += rate[i] * rate[i];
        }
        const double still = STILL_SHARE * sqrt(square / fmax((double)grid->rows, 1.0));
        for (size_t i = 0; i < grid->rows; i++) {
            grid->variable[LOADING_1 + c][i] = rate[i] > still ? 1.0 : rate[i] < -still ? -1.0 : 0.0;
        }
    }
}

/* Cycles that any chamber has begun since the run's start. */
static void take_cycles(struct grid *grid) {
    double most[3] = {0.0, 0.0, 0.0};
    for (size_t i = 0; i < grid->rows; i++) {
        for (size_t c = 0; c < 3; c++) {
            most[c] = fmax(most[c], grid->variable[PRESSURE_1 + c][i]);
        }
    }
    for (size_t run = 0; run < grid->runs; run++) {
        bool low[3] = {true, true, true};
        double cycles = 0.0;
        for (size_t i = grid->first[run]; i < grid->first[run + 1]; i++) {
            for (size_t c = 0; c < 3; c++) {
                const double pressure_kpa = grid->variable[PRESSURE_1 + c][i];
                const bool begins = low[c] && most[c] > 0.0 && pressure_kpa > CYCLE_HIGH * most[c];
                cycles += begins ? 1.0 : 0.0;
                low[c] = begins ? false : low[c] || pressure_kpa < CYCLE_LOW * most[c];
            }
            grid->variable[CYCLES][i] = cycles;
        }
    }
}

static void take_times(struct grid *grid, const struct replay *replay) {
    start_means(grid);
    for (size_t i = 0; i < replay->runs; i++) {
        const struct replay_run *run = &replay->run[i];
        for (size_t row = grid->first[i]; row < grid->first[i + 1]; row++) {
            grid->variable[TIME][row] = ((double)(row - grid->first[i]) + 0.5) * grid->step_s;
        }
        for (size_t row = 0; row < run->run->rows && run->run->has_temperature; row++) {
            const double since_s = run->run->time_s[row] - 1e-6 * (double)run->start_us;
            add_to_mean(grid, grid->variable[TEMPERATURE], place(grid, i, since_s), run->run->temperature_k[row]);
        }
    }
}

static bool fill(struct grid *grid, const struct search *search, bool *bend_is_angle) {
    const struct replay *replay = &search->replay;
    const bool turned = search->data->run[0].has_orientation;
    struct report_series series;
    struct replay_state state;
    if (!report_series_open_models(&series, search, &search->recalibrated.model, &search->best.model)) {
        return false;
    }
    for (size_t r = 0; r < RESIDUALS; r++) {
        const struct residual_row *row = &residual_rows[r];
        take_column(grid, &series, row->tip, REPORT_RESIDUAL_BEFORE + row->offset, grid->residual[0][r]);
        take_column(grid, &series, row->tip, REPORT_RESIDUAL_AFTER + row->offset, grid->residual[1][r]);
    }
    take_pose(grid, &series, turned, bend_is_angle);
    report_series_close(&series);
    const bool sound = replay_state_open(&state, replay);
    if (sound) {
        replay_pressures(replay, &search->recalibrated.model, &state);
        take_pressures(grid, replay, &state);
        take_loading(grid);
        take_cycles(grid);
        take_times(grid, replay);
    }
    replay_state_close(&state, replay);
    return sound;
}

/* --- testing it --- */

static void make_table(const struct grid *grid, size_t model, bool bend_is_angle, struct locate_table *table) {
    static const char *const pressure_names[3] = {"pressure", "pressure rate", "direction of loading"};
    static const char *const pressure_units[3] = {"kPa", "kPa/s", ""};
    static const char *const names[VARIABLES - TIME] = {"time since start", "cycle count", "bend", "bend direction", "temperature"};
    const char *const units[VARIABLES - TIME] = {"s", "", bend_is_angle ? "deg" : "mm", "deg", "K"};
    *table = (struct locate_table){.rows = grid->rows, .residuals = RESIDUALS, .variables = VARIABLES};
    for (size_t r = 0; r < RESIDUALS; r++) {
        table->residual[r] = (struct locate_residual){residual_rows[r].name, residual_rows[r].channel, residual_rows[r].chamber,
                                                      grid->residual[model][r]};
    }
    for (size_t v = 0; v < VARIABLES; v++) {
        const bool pressure = v < TIME;
        table->variable[v] = (struct locate_variable){.name = pressure ? pressure_names[v / 3] : names[v - TIME],
                                                      .unit = pressure ? pressure_units[v / 3] : units[v - TIME],
                                                      .chamber = pressure ? v % 3 + 1 : 0,
                                                      .categories = pressure && v >= LOADING_1,
                                                      .value = grid->variable[v]};
    }
}

static const char *unit_of(const char *residual) {
    return strcmp(residual, "r1_pressure") == 0 ? "kPa" : strcmp(residual, "r2_position") == 0 ? "mm" : "deg";
}

static void add_found(struct dependences *dependences, const struct locate_table *table, const struct locate_dependence *found,
                      size_t count, bool of_best) {
    static const struct locate_variable which = {.name = "chamber", .unit = ""};
    for (size_t k = 0; k < count && dependences->count < DEPENDENCE_MAX; k++) {
        const struct locate_residual *residual = &table->residual[found[k].residual];
        const bool is_chamber = found[k].variable == LOCATE_VARIABLES_MAX;
        const struct locate_variable *variable = is_chamber ? &which : &table->variable[found[k].variable];
        dependences->list[dependences->count++] = (struct dependence){.of_best = of_best,
                                                                      .residual = residual->name,
                                                                      .channel = residual->channel,
                                                                      .variable = variable->name,
                                                                      .chamber = variable->chamber,
                                                                      .unit = variable->unit,
                                                                      .share = found[k].share,
                                                                      .p = found[k].p,
                                                                      .q = found[k].q,
                                                                      .from = found[k].from,
                                                                      .to = found[k].to,
                                                                      .off = found[k].off,
                                                                      .off_unit = unit_of(residual->name)};
    }
}

bool dependence_find(struct dependences *dependences, const struct search *search, bool with_best) {
    struct grid grid;
    struct locate_table table;
    struct locate_dependence *found = calloc(LOCATE_FOUND_MAX, sizeof *found);
    bool bend_is_angle = true, sound = grid_open(&grid, &search->replay) && found != NULL;
    memset(dependences, 0, sizeof *dependences);
    sound = sound && fill(&grid, search, &bend_is_angle);
    for (size_t model = 0; model < (with_best ? 2u : 1u) && sound; model++) {
        size_t tested = 0;
        make_table(&grid, model, bend_is_angle, &table);
        table.threads = search->options.threads;
        const size_t count = locate_find(&table, SEED, found, &tested);
        sound = count != SIZE_MAX;
        if (sound) {
            dependences->tested += tested;
            add_found(dependences, &table, found, count, model == 1);
        }
    }
    grid_close(&grid);
    free(found);
    return sound;
}

/* --- saying it --- */

static void write_variable(const struct dependence *dependence, FILE *out) {
    fputs(dependence->variable, out);
    if (dependence->chamber > 0) {
        fprintf(out, " of chamber %zu", dependence->chamber);
    }
}

/* Where the residual is farthest off. */
static void write_where(const struct dependence *dependence, FILE *out) {
    if (strcmp(dependence->variable, "direction of loading") == 0) {
        fputs(dependence->from > 0.0 ? "loading" : dependence->from < 0.0 ? "unloading" : "still", out);
    } else if (strcmp(dependence->variable, "chamber") == 0) {
        fprintf(out, "in chamber %.0f", dependence->from);
    } else {
        fprintf(out, "at %.3g to %.3g%s%s", dependence->from, dependence->to, *dependence->unit != '\0' ? " " : "", dependence->unit);
    }
}

static bool is_first_of_its_residual(const struct dependences *dependences, size_t index) {
    const struct dependence *own = &dependences->list[index];
    for (size_t i = 0; i < index; i++) {
        const struct dependence *other = &dependences->list[i];
        if (other->of_best == own->of_best && strcmp(other->residual, own->residual) == 0) {
            return false;
        }
    }
    return true;
}

size_t dependence_text(const struct dependences *dependences, bool of_best, FILE *out) {
    size_t count = 0;
    for (size_t i = 0; i < dependences->count; i++) {
        const struct dependence *dependence = &dependences->list[i];
        if (dependence->of_best != of_best || !is_first_of_its_residual(dependences, i)) {
            continue;
        }
        fprintf(out, "%s%s %s on ", count++ == 0 ? (of_best ? "left      " : "depends   ") : "; ", dependence->residual,
                dependence->channel);
        write_variable(dependence, out);
        fprintf(out, " (%.0f %%, %.2g %s ", 100.0 * dependence->share, dependence->off, dependence->off_unit);
        write_where(dependence, out);
        fputs(")", out);
    }
    fputs(count > 0 ? "\n" : "", out);
    return count;
}

static void write_row(const struct dependence *dependence, FILE *out) {
    fprintf(out, "<tr><td>%s</td><td>%s, %s</td><td>", dependence->of_best ? "best" : "recalibrated", dependence->residual,
            dependence->channel);
    write_variable(dependence, out);
    fprintf(out, "</td><td class=\"number\">%.0f %%</td><td>%.2g %s ", 100.0 * dependence->share, dependence->off,
            dependence->off_unit);
    write_where(dependence, out);
    fprintf(out, "</td><td class=\"number\">%.2g</td></tr>\n", dependence->q);
}

#define ROWS_A_CHANNEL 3 /* of the page's table: what comes after the strongest mostly follows from them */

void dependence_html(const struct dependences *dependences, FILE *out) {
    if (dependences->count == 0) {
        fprintf(out, "<p>No residual depends on any of the variables more than chance makes it (%zu pairs tested, at most 5 %% false).</p>\n",
                dependences->tested);
        return;
    }
    fprintf(out,
            "<p>Of %zu pairs of a residual and a variable these depend on each other beyond chance (shuffled blocks of time; of all "
            "that is found at most 5 %% is false). The share is of the residual\xe2\x80\x99s variance; up to three for each.</p>\n"
            "<div class=\"scroll\"><table id=\"dependence\">\n<tr><th>model</th><th>residual</th><th>depends on</th>"
            "<th class=\"number\">share</th><th>farthest off</th><th class=\"number\">q</th></tr>\n",
            dependences->tested);
    for (size_t i = 0; i < dependences->count; i++) {
        size_t before = 0;
        for (size_t j = 0; j < i; j++) {
            const struct dependence *one = &dependences->list[i], *other = &dependences->list[j];
            before += one->of_best == other->of_best && strcmp(one->residual, other->residual) == 0 &&
                              strcmp(one->channel, other->channel) == 0
                          ? 1
                          : 0;
        }
        if (before < ROWS_A_CHANNEL) {
            write_row(&dependences->list[i], out);
        }
    }
    fputs("</table></div>\n", out);
}
