#include "gap/diagnosis_parts.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define DEGREES (180.0 / M_PI)
#define CHUNK_S 2.5 /* of the bootstrap */
#define RESAMPLES 400
#define SEED 0x9e3779b97f4a7c15u
#define KINDS 3 /* of residuals: pressure, position, angle */

/* Held-out residuals of one model: squares and what of them is structure, by chunk of time. */
struct chunks {
    size_t count;
    double *square;   /* sum of squares */
    double *residual; /* how many */
    struct fit_part all[FIT_GROUPS]; /* of all chunks; only its noise and counts are used */
};

struct model_view {
    double *residual; /* [residuals], whitened */
    struct chunks chunks;
};

static bool view_open(struct model_view *view, size_t residuals, size_t chunks) {
    view->residual = calloc(residuals + 1, sizeof(double));
    view->chunks.count = chunks;
    view->chunks.square = calloc(chunks + 1, sizeof(double));
    view->chunks.residual = calloc(chunks + 1, sizeof(double));
    return view->residual != NULL && view->chunks.square != NULL && view->chunks.residual != NULL;
}

static void view_close(struct model_view *view) {
    free(view->residual);
    free(view->chunks.square);
    free(view->chunks.residual);
}

struct series {
    size_t start; /* of the first element in the vector */
    size_t stride;
    size_t count;
    double block_s;
    size_t first_chunk;
    enum fit_group group;
};

/* The series of a run: three pressures, one supply, six tip channels. */
static size_t list_series(const struct replay *replay, size_t index, size_t first_chunk,
                          struct series series[10]) {
    const struct replay_run *run = &replay->run[index];
    size_t count = 0;
    for (size_t c = 0; c < 3; c++) {
        series[count++] =
            (struct series){run->pressure_at + c, 3, run->blocks, REPLAY_PRESSURE_BLOCK_S, first_chunk, FIT_PRESSURE};
    }
    series[count++] =
        (struct series){run->supply_at, 1, run->blocks, REPLAY_PRESSURE_BLOCK_S, first_chunk, FIT_PRESSURE};
    for (size_t k = 0; k < REPLAY_TIP_CHANNELS; k++) {
        series[count++] = (struct series){run->tip_at + k, REPLAY_TIP_CHANNELS, run->tip_blocks,
                                          REPLAY_TIP_BLOCK_S, first_chunk, FIT_TIP};
    }
    return count;
}

static size_t chunks_of(const struct replay_run *run) {
    return (size_t)(REPLAY_PRESSURE_BLOCK_S * (double)run->blocks / CHUNK_S) + 2;
}

/* Of neighbours both held out, half the squared difference is noise. */
static void count_series(const struct replay *replay, const struct series *series, struct model_view *view) {
    for (size_t b = 0; b < series->count; b++) {
        const size_t at = series->start + b * series->stride;
        const size_t chunk = series->first_chunk + (size_t)((double)b * series->block_s / CHUNK_S);
        if (!replay->held_out[at] || !(replay->weight[at] > 0.0) || chunk >= view->chunks.count) {
            continue;
        }
        const double now = view->residual[at];
        view->chunks.square[chunk] += now * now;
        view->chunks.residual[chunk] += 1.0;
        const bool follows = b > 0 && !replay->apart[at] && replay->held_out[at - series->stride] &&
                             replay->weight[at - series->stride] > 0.0;
        struct fit_part *all = &view->chunks.all[series->group];
        const double step = follows ? now - view->residual[at - series->stride] : now;
        all->noise += follows ? 0.5 * step * step + replay->lasting[at] : 0.0;
        all->noise_count += follows;
        all->count += 1.0;
        all->noise_most = replay->noise_most[series->group];
    }
}

static void fill_view(const struct replay *replay, const struct gap_model *model, struct replay_state *state,
                      struct model_view *view) {
    size_t first_chunk = 0;
    replay_pressures(replay, model, state);
    replay_take_pressures(replay, state, view->residual);
    replay_tip(replay, model, state, false, view->residual);
    for (size_t i = 0; i < replay->runs; i++) {
        struct series series[10];
        const size_t count = list_series(replay, i, first_chunk, series);
        for (size_t s = 0; s < count; s++) {
            count_series(replay, &series[s], view);
        }
        first_chunk += chunks_of(&replay->run[i]);
    }
}

static double mean_square(const struct chunks *chunks, const double *sum, const size_t *pick) {
    double total = 0.0, count = 0.0;
    for (size_t i = 0; i < chunks->count; i++) {
        const size_t at = pick == NULL ? i : pick[i];
        total += sum[at];
        count += chunks->residual[at];
    }
    return count > 0.0 ? total / count : 0.0;
}

/* What noise alone makes of a mean square. */
static double noise_square(const struct chunks *chunks) {
    double total = 0.0, count = 0.0;
    for (int group = 0; group < FIT_GROUPS; group++) {
        const struct fit_part *all = &chunks->all[group];
        total += all->noise_count > 0.0 ? fmin(all->noise / all->noise_count, all->noise_most) * all->count : 0.0;
        count += all->count;
    }
    return count > 0.0 ? total / count : 0.0;
}

static double share_closed(const struct chunks *before, const struct chunks *after, double floor2,
                           const size_t *pick) {
    const double gap = mean_square(before, before->square, pick) - floor2;
    return gap > 0.0 ? 1.0 - (mean_square(after, after->square, pick) - floor2) / gap : 0.0;
}

static int compare(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static size_t draw(uint64_t *state, size_t count) {
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (size_t)((*state >> 33) % count);
}

/* Interval by resampling chunks of time (Efron and Tibshirani 1993), seeded: the same answer every time. */
static struct diagnosis_interval bootstrap(const struct chunks *before, const struct chunks *after,
                                           double floor2) {
    double value[RESAMPLES];
    size_t *pick = calloc(before->count + 1, sizeof *pick);
    uint64_t state = SEED;
    struct diagnosis_interval interval = {share_closed(before, after, floor2, NULL), 0.0, 0.0};
    for (size_t k = 0; k < RESAMPLES && pick != NULL; k++) {
        for (size_t i = 0; i < before->count; i++) {
            pick[i] = draw(&state, before->count);
        }
        value[k] = share_closed(before, after, floor2, pick);
    }
    if (pick != NULL) {
        qsort(value, RESAMPLES, sizeof value[0], compare);
        interval.low = value[RESAMPLES / 20];
        interval.high = value[RESAMPLES - 1 - RESAMPLES / 20];
    }
    free(pick);
    return interval;
}

/* Sums of squares in physical units, and counts, of the held-out blocks of one chunk of time. */
struct physical {
    double square[KINDS];
    double count[KINDS];
};

/* r1 in kPa, positions in mm, angles in degrees; `sum` by chunk. */
static void sum_physical(const struct replay *replay, const double *residual, struct physical *sum) {
    static const double unit[KINDS] = {1e-3, 1e3, DEGREES};
    size_t first_chunk = 0;
    for (size_t i = 0; i < replay->runs; i++) {
        struct series series[10];
        const size_t all = list_series(replay, i, first_chunk, series);
        for (size_t s = 0; s < all; s++) {
            const size_t kind = s < 3 ? 0 : s < 7 ? 1 : 2;
            for (size_t b = 0; b < series[s].count && s != 3; b++) {
                const size_t at = series[s].start + b * series[s].stride;
                const size_t chunk = first_chunk + (size_t)((double)b * series[s].block_s / CHUNK_S);
                if (replay->held_out[at] && replay->weight[at] > 0.0) {
                    const double value = residual[at] / replay->weight[at] * unit[kind];
                    sum[chunk].square[kind] += value * value;
                    sum[chunk].count[kind] += 1.0;
                }
            }
        }
        first_chunk += chunks_of(&replay->run[i]);
    }
}

/* Root mean square of one kind, with an interval from resampling the chunks that have any of it. `chosen` is
 * room for one index a chunk. */
static struct diagnosis_interval rms_of(const struct physical *sum, size_t chunks, size_t kind,
                                        size_t *chosen) {
    double square = 0.0, count = 0.0, value[RESAMPLES];
    uint64_t state = SEED;
    size_t with = 0;
    for (size_t i = 0; i < chunks; i++) {
        square += sum[i].square[kind];
        count += sum[i].count[kind];
        if (sum[i].count[kind] > 0.0) {
            chosen[with++] = i;
        }
    }
    if (with == 0) {
        return (struct diagnosis_interval){NAN, NAN, NAN};
    }
    for (size_t k = 0; k < RESAMPLES; k++) {
        double picked = 0.0, of = 0.0;
        for (size_t i = 0; i < with; i++) {
            const struct physical *one = &sum[chosen[draw(&state, with)]];
            picked += one->square[kind];
            of += one->count[kind];
        }
        value[k] = sqrt(picked / of);
    }
    qsort(value, RESAMPLES, sizeof value[0], compare);
    return (struct diagnosis_interval){sqrt(square / count), value[RESAMPLES / 20],
                                       value[RESAMPLES - 1 - RESAMPLES / 20]};
}

static double *figure(struct diagnosis_gap *gap, size_t which) {
    return which == 0 ? &gap->before : which == 1 ? &gap->after_recalibration : &gap->after_effect;
}

/* The figures of one model: pressure (unless from the duties alone), position and angle. False: out of
 * memory. */
static bool take_rms(struct diagnosis *diagnosis, const struct replay *replay, const double *residual,
                     size_t chunks, size_t model, bool from_duties) {
    struct physical *sum = calloc(chunks + 1, sizeof *sum);
    size_t *chosen = calloc(chunks + 1, sizeof *chosen);
    const bool sound = sum != NULL && chosen != NULL;
    if (sound) {
        sum_physical(replay, residual, sum);
    }
    for (size_t kind = from_duties ? 1 : 0; kind < KINDS && sound; kind++) {
        struct diagnosis_gap *gap = &diagnosis->gap[from_duties ? kind + 2 : kind];
        const struct diagnosis_interval rms = rms_of(sum, chunks, kind, chosen);
        *figure(gap, model) = rms.value;
        gap->low[model] = rms.low;
        gap->high[model] = rms.high;
    }
    free(sum);
    free(chosen);
    return sound;
}

/* Floor: what noise alone leaves of neighbouring blocks' differences. */
static void physical_floor(const struct replay *replay, const double *residual, double floor_of[3]) {
    double sum[3] = {0.0, 0.0, 0.0}, whitened[3] = {0.0, 0.0, 0.0}, count[3] = {0.0, 0.0, 0.0};
    static const double unit[3] = {1e-3, 1e3, DEGREES};
    for (size_t i = 0; i < replay->runs; i++) {
        struct series series[10];
        const size_t all = list_series(replay, i, 0, series);
        for (size_t s = 0; s < all; s++) {
            const size_t kind = s < 3 ? 0 : s < 7 ? 1 : 2;
            for (size_t b = 1; b < series[s].count && s != 3; b++) {
                const size_t at = series[s].start + b * series[s].stride, last = at - series[s].stride;
                if (replay->weight[at] > 0.0 && replay->weight[last] > 0.0 && !replay->apart[at]) {
                    const double step =
                        (residual[at] / replay->weight[at] - residual[last] / replay->weight[last]) *
                        unit[kind];
                    const double lasting = sqrt(replay->lasting[at]) / replay->weight[at] * unit[kind];
                    sum[kind] += 0.5 * step * step + lasting * lasting;
                    whitened[kind] += 0.5 * pow(residual[at] - residual[last], 2.0) + replay->lasting[at];
                    count[kind] += 1.0;
                }
            }
        }
    }
    for (size_t kind = 0; kind < 3; kind++) {
        const double most = replay->noise_most[kind == 0 ? FIT_PRESSURE : FIT_TIP], mean = whitened[kind] / count[kind];
        floor_of[kind] = count[kind] > 0.0 ? sqrt(sum[kind] / count[kind] * fmin(most / mean, 1.0)) : NAN;
    }
}

/* Structure of one series: mean square less half the mean square of neighbours' differences; and its
 * correlation after half a second, which says how long the unknown remembers. */
struct series_structure {
    double structure;
    double remembered;
};

static struct series_structure structure_of(const struct replay *replay, const struct series *series,
                                            const double *residual) {
    const size_t lag = (size_t)(0.5 / series->block_s);
    double square = 0.0, step2 = 0.0, product = 0.0, count = 0.0, pairs = 0.0, lagged = 0.0;
    for (size_t b = 0; b < series->count; b++) {
        const size_t at = series->start + b * series->stride;
        if (!(replay->weight[at] > 0.0)) {
            continue;
        }
        square += residual[at] * residual[at];
        count += 1.0;
        if (b > 0 && replay->weight[at - series->stride] > 0.0 && !replay->apart[at]) {
            step2 += 0.5 * pow(residual[at] - residual[at - series->stride], 2.0) + replay->lasting[at];
            pairs += 1.0;
        }
        if (b >= lag && replay->weight[at - lag * series->stride] > 0.0) {
            product += residual[at] * residual[at - lag * series->stride];
            lagged += 1.0;
        }
    }
    struct series_structure out = {0.0, 0.0};
    if (count > 0.0 && pairs > 0.0 && lagged > 0.0) {
        out.structure = fmax(square / count - fmin(step2 / pairs, replay->noise_most[series->group]), 0.0);
        out.remembered = square > 0.0 ? product / lagged / (square / count) : 0.0;
    }
    return out;
}

/* What the best model leaves: where it is, in which chambers, how long it lasts. */
static void describe_rest(struct diagnosis *diagnosis, const struct replay *replay, const double *residual) {
    double pressure[3] = {0.0}, position = 0.0, angle = 0.0, remembered = 0.0, all = 1e-12;
    for (size_t i = 0; i < replay->runs; i++) {
        struct series series[10];
        const size_t count = list_series(replay, i, 0, series);
        for (size_t s = 0; s < count; s++) {
            const struct series_structure part = structure_of(replay, &series[s], residual);
            *(s < 3 ? &pressure[s] : s < 7 ? &position : &angle) += s == 3 ? 0.0 : part.structure;
            remembered += s == 3 ? 0.0 : part.structure * part.remembered;
            all += s == 3 ? 0.0 : part.structure;
        }
    }
    const double most = fmax(fmax(pressure[0], pressure[1]), pressure[2]);
    const double upstream = pressure[0] + pressure[1] + pressure[2];
    diagnosis->rest_stage = upstream > position + angle ? "valve"
                            : angle < 0.2 * position    ? "tip sensor"
                                                        : "body";
    for (size_t c = 0; c < 3; c++) {
        diagnosis->rest_chamber[c] = upstream <= position + angle || pressure[c] > 0.3 * most;
    }
    const double kept = remembered / all;
    (void)snprintf(diagnosis->description, sizeof diagnosis->description,
                   "left after the best of the catalogue: %.0f %% in the pressure readings, %.0f %% in the "
                   "tip's position, %.0f %% in "
                   "its orientation; %s",
                   100.0 * upstream / all, 100.0 * position / all, 100.0 * angle / all,
                   kept > 0.5   ? "it lasts for longer than half a second: slow or constant"
                   : kept > 0.1 ? "it lasts for some tenths of a second"
                                : "it comes and goes within half a second: fast or in jumps");
}

bool diagnosis_measure(struct diagnosis *diagnosis, struct search *search) {
    static const char *const names[DIAGNOSIS_RESIDUALS] = {"r1_pressure", "r2_position", "r2_angle",
                                                           "r3_position", "r3_angle"};
    static const char *const units[DIAGNOSIS_RESIDUALS] = {"kPa", "mm", "deg", "mm", "deg"};
    const struct replay *replay = &search->replay;
    const struct gap_model *models[3] = {&search->nominal.model, &search->recalibrated.model,
                                         &search->best.model};
    struct model_view view[3] = {{0}};
    struct replay_state state;
    size_t chunks = 0;
    for (size_t i = 0; i < replay->runs; i++) {
        chunks += chunks_of(&replay->run[i]);
    }
    bool sound = replay_state_open(&state, replay);
    for (size_t m = 0; m < 3; m++) {
        sound = view_open(&view[m], replay->residuals, chunks) && sound;
    }
    for (size_t m = 0; m < 3 && sound; m++) {
        double floor_of[3];
        fill_view(replay, models[m], &state, &view[m]);
        sound = take_rms(diagnosis, replay, view[m].residual, chunks, m, false);
        if (m == 2) {
            describe_rest(diagnosis, replay, view[m].residual);
            physical_floor(replay, view[m].residual, floor_of);
            for (size_t k = 0; k < DIAGNOSIS_RESIDUALS; k++) {
                diagnosis->gap[k].floor = floor_of[k < 3 ? k : k - 2];
            }
        }
        double *other = calloc(replay->residuals, sizeof *other);
        if (other != NULL) {
            replay_tip(replay, models[m], &state, true, other);
            sound = take_rms(diagnosis, replay, other, chunks, m, true) && sound;
        }
        free(other);
    }
    sound = sound && direction_find(&diagnosis->direction, replay, view[0].residual, view[2].residual);
    if (sound) {
        const double floor2 = noise_square(&view[2].chunks);
        for (size_t m = 0; m < 3; m++) {
            const double structured =
                mean_square(&view[m].chunks, view[m].chunks.square, NULL) - noise_square(&view[m].chunks);
            diagnosis->structure[m] = floor2 > 0.0 ? fmax(structured, 0.0) / floor2 : 0.0;
        }
        diagnosis->closed = bootstrap(&view[0].chunks, &view[2].chunks, floor2);
        diagnosis->closed_recalibration = bootstrap(&view[0].chunks, &view[1].chunks, floor2);
    }
    for (size_t k = 0; k < DIAGNOSIS_RESIDUALS; k++) {
        diagnosis->gap[k].name = names[k];
        diagnosis->gap[k].unit = units[k];
        const bool from_duties = k == 0 || k >= 3;
        diagnosis->gap[k].measured =
            !isnan(diagnosis->gap[k].before) && (!from_duties || replay->run[0].run->has_duty);
    }
    for (size_t m = 0; m < 3; m++) {
        view_close(&view[m]);
    }
    replay_state_close(&state, replay);
    return sound;
}
