#include "gap/diagnosis.h"

#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gap/baseline.h"

#define DEGREES (180.0 / M_PI)
#define NINETY_PERCENT 1.645
/* A gap whose structure is below this share of the noise floor's square is none. */
#define STRUCTURE_NONE 0.3
/* Recalibration is the answer where it leaves no more than that, or this share of what was there. */
#define RECALIBRATED_SHARE 0.05
/* Catalogue effects must close this share of the structured gap, or the gap is of an unknown kind. */
#define CLOSED_LEAST 0.97
#define CLOSED_LEAST_BY_MANY 0.98 /* by several, or by one of many forms: they can bend to much that they are not */
#define FEW_PARTS 3
/* What forms that only nearly fit do to a parameter, as a share of the effect's size: this much, and in proportion to what is
 * left of the gap, as an amplitude. Seen against effects of other forms. */
#define FORM_SHARE 0.008
#define FORM_BY_REST 0.9
#define FREEZES_LAST 6.0 /* repeated samples come in runs, of about so many */
#define BY_CHANCE_SURE 0.95 /* repeats are seen as such */
#define GROUP_LEAST 0.15 /* belief that puts a name into the group */
#define SLUGGISH_SHARE 0.7
#define SURE 0.65        /* belief above which one name is the verdict */
#define SURE_ON_STRANGE 0.80 /* the same where another simulator errs in ways of its own */
#define PRESSURE_SHARE 0.02   /* a rival that leaves so much more of the pressures' gap is e times less believed */
#define MOVES_LEAST_PA 1500.0 /* a recording in which no pressure moves by more says nothing */
#define FLOOR_DOUBTFUL 10.0    /* neighbours differ by that many times the sensor's noise */
#define DOUBTFUL_CHANGE 0.1    /* share of its movement by which our table model may miss another simulator's tip */
#define CHUNK_S 2.5      /* of the bootstrap */
#define RESAMPLES 400
#define SEED 0x9e3779b97f4a7c15u
#define KINDS 3          /* of residuals: pressure, position, angle */

const char *gap_verdict_name(enum gap_verdict verdict) {
    static const char *const names[GAP_VERDICT_COUNT] = {"no-gap", "recalibrate", "effect",           "effects",
                                                         "group",  "unknown",     "insufficient-data"};
    return names[verdict];
}

void diagnosis_warn(struct diagnosis *diagnosis, const char *format, ...) {
    va_list arguments;
    if (diagnosis->warnings < DIAGNOSIS_WARNINGS_MAX) {
        va_start(arguments, format);
        (void)vsnprintf(diagnosis->warning[diagnosis->warnings++], DIAGNOSIS_TEXT_BYTES, format, arguments);
        va_end(arguments);
    }
}

/* --- how far --- */

/* Held-out residuals of one model: squares and what of them is structure, by chunk of time. */
struct chunks {
    size_t count;
    double *square;   /* sum of squares */
    double *noise;    /* sum of squares of half differences of neighbours: noise alone */
    double *residual; /* how many */
    double *apart;    /* how many of them have a neighbour whose difference is no noise */
};

struct model_view {
    double *residual; /* [residuals], whitened */
    struct chunks chunks;
};

static bool view_open(struct model_view *view, size_t residuals, size_t chunks) {
    view->residual = calloc(residuals + 1, sizeof(double));
    view->chunks.count = chunks;
    view->chunks.square = calloc(chunks + 1, sizeof(double));
    view->chunks.noise = calloc(chunks + 1, sizeof(double));
    view->chunks.residual = calloc(chunks + 1, sizeof(double));
    view->chunks.apart = calloc(chunks + 1, sizeof(double));
    return view->residual != NULL && view->chunks.square != NULL && view->chunks.noise != NULL &&
           view->chunks.residual != NULL && view->chunks.apart != NULL;
}

static void view_close(struct model_view *view) {
    free(view->residual);
    free(view->chunks.square);
    free(view->chunks.noise);
    free(view->chunks.residual);
    free(view->chunks.apart);
}

struct series {
    size_t start;    /* of the first element in the vector */
    size_t stride;
    size_t count;
    double block_s;
    size_t first_chunk;
};

/* The series of a run: three pressures, one supply, six tip channels. */
static size_t list_series(const struct replay *replay, size_t index, size_t first_chunk, struct series series[10]) {
    const struct replay_run *run = &replay->run[index];
    size_t count = 0;
    for (size_t c = 0; c < 3; c++) {
        series[count++] = (struct series){run->pressure_at + c, 3, run->blocks, REPLAY_PRESSURE_BLOCK_S, first_chunk};
    }
    series[count++] = (struct series){run->supply_at, 1, run->blocks, REPLAY_PRESSURE_BLOCK_S, first_chunk};
    for (size_t k = 0; k < REPLAY_TIP_CHANNELS; k++) {
        series[count++] = (struct series){run->tip_at + k, REPLAY_TIP_CHANNELS, run->tip_blocks, REPLAY_TIP_BLOCK_S, first_chunk};
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
        view->chunks.apart[chunk] += replay->apart[at];
        const double step = follows ? now - view->residual[at - series->stride] : now;
        view->chunks.noise[chunk] += follows ? 0.5 * step * step + replay->lasting[at] : 0.0;
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
    for (size_t i = 0; i < chunks->count; i++) {
        total += chunks->noise[i];
        count += chunks->residual[i] - chunks->apart[i];
    }
    return count > 0.0 ? total / count : 0.0;
}

static double share_closed(const struct chunks *before, const struct chunks *after, double floor2, const size_t *pick) {
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
static struct diagnosis_interval bootstrap(const struct chunks *before, const struct chunks *after, double floor2) {
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

/* Root mean square of one kind, with an interval from resampling the chunks that have any of it. `chosen` is room for one
 * index a chunk. */
static struct diagnosis_interval rms_of(const struct physical *sum, size_t chunks, size_t kind, size_t *chosen) {
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
    return (struct diagnosis_interval){sqrt(square / count), value[RESAMPLES / 20], value[RESAMPLES - 1 - RESAMPLES / 20]};
}

static double *figure(struct diagnosis_gap *gap, size_t which) {
    return which == 0 ? &gap->before : which == 1 ? &gap->after_recalibration : &gap->after_effect;
}

/* The figures of one model: pressure (unless from the duties alone), position and angle. False: out of memory. */
static bool take_rms(struct diagnosis *diagnosis, const struct replay *replay, const double *residual, size_t chunks, size_t model,
                     bool from_duties) {
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
    double sum[3] = {0.0, 0.0, 0.0}, count[3] = {0.0, 0.0, 0.0};
    static const double unit[3] = {1e-3, 1e3, DEGREES};
    for (size_t i = 0; i < replay->runs; i++) {
        struct series series[10];
        const size_t all = list_series(replay, i, 0, series);
        for (size_t s = 0; s < all; s++) {
            const size_t kind = s < 3 ? 0 : s < 7 ? 1 : 2;
            for (size_t b = 1; b < series[s].count && s != 3; b++) {
                const size_t at = series[s].start + b * series[s].stride, last = at - series[s].stride;
                if (replay->weight[at] > 0.0 && replay->weight[last] > 0.0 && !replay->apart[at]) {
                    const double step = (residual[at] / replay->weight[at] - residual[last] / replay->weight[last]) * unit[kind];
                    const double lasting = sqrt(replay->lasting[at]) / replay->weight[at] * unit[kind];
                    sum[kind] += 0.5 * step * step + lasting * lasting;
                    count[kind] += 1.0;
                }
            }
        }
    }
    for (size_t kind = 0; kind < 3; kind++) {
        floor_of[kind] = count[kind] > 0.0 ? sqrt(sum[kind] / count[kind]) : NAN;
    }
}

/* Structure of one series: mean square less half the mean square of neighbours' differences; and its correlation after half a
 * second, which says how long the unknown remembers. */
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
        out.structure = fmax(square / count - step2 / pairs, 0.0);
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
    diagnosis->rest_stage = upstream > position + angle ? "valve" : angle < 0.2 * position ? "tip sensor" : "body";
    for (size_t c = 0; c < 3; c++) {
        diagnosis->rest_chamber[c] = upstream <= position + angle || pressure[c] > 0.3 * most;
    }
    const double kept = remembered / all;
    (void)snprintf(diagnosis->description, sizeof diagnosis->description,
                   "left after the best of the catalogue: %.0f %% in the pressure readings, %.0f %% in the tip's position, %.0f %% in "
                   "its orientation; %s",
                   100.0 * upstream / all, 100.0 * position / all, 100.0 * angle / all,
                   kept > 0.5   ? "it lasts for longer than half a second: slow or constant"
                   : kept > 0.1 ? "it lasts for some tenths of a second"
                                : "it comes and goes within half a second: fast or in jumps");
}

static bool measure_gaps(struct diagnosis *diagnosis, struct search *search) {
    static const char *const names[DIAGNOSIS_RESIDUALS] = {"r1_pressure", "r2_position", "r2_angle", "r3_position", "r3_angle"};
    static const char *const units[DIAGNOSIS_RESIDUALS] = {"kPa", "mm", "deg", "mm", "deg"};
    const struct replay *replay = &search->replay;
    const struct gap_model *models[3] = {&search->nominal.model, &search->recalibrated.model, &search->best.model};
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
            const double structured = mean_square(&view[m].chunks, view[m].chunks.square, NULL) - noise_square(&view[m].chunks);
            diagnosis->structure[m] = floor2 > 0.0 ? fmax(structured, 0.0) / floor2 : 0.0;
        }
        diagnosis->closed = bootstrap(&view[0].chunks, &view[2].chunks, floor2);
        diagnosis->closed_recalibration = bootstrap(&view[0].chunks, &view[1].chunks, floor2);
    }
    for (size_t k = 0; k < DIAGNOSIS_RESIDUALS; k++) {
        diagnosis->gap[k].name = names[k];
        diagnosis->gap[k].unit = units[k];
        const bool from_duties = k == 0 || k >= 3;
        diagnosis->gap[k].measured = !isnan(diagnosis->gap[k].before) && (!from_duties || replay->run[0].run->has_duty);
    }
    for (size_t m = 0; m < 3; m++) {
        view_close(&view[m]);
    }
    replay_state_close(&state, replay);
    return sound;
}

/* --- which --- */

static void add_name(struct diagnosis *diagnosis, const char *name, double probability) {
    size_t at = diagnosis->group;
    for (size_t i = 0; i < diagnosis->group; i++) {
        if (strcmp(diagnosis->group_name[i], name) == 0) {
            return;
        }
    }
    if (at == DIAGNOSIS_NAMES_MAX) {
        return;
    }
    diagnosis->group++;
    for (; at > 0 && diagnosis->group_probability[at - 1] < probability; at--) {
        diagnosis->group_name[at] = diagnosis->group_name[at - 1];
        diagnosis->group_probability[at] = diagnosis->group_probability[at - 1];
    }
    diagnosis->group_name[at] = name;
    diagnosis->group_probability[at] = probability;
}

static void name_group(struct diagnosis *diagnosis, const struct rivals *rivals) {
    for (size_t i = 0; i < rivals->count; i++) {
        if (rivals->rival[i].belief >= GROUP_LEAST) {
            add_name(diagnosis, rivals->rival[i].kind->name, rivals->rival[i].belief);
        }
    }
}

/* Residuals' dependence in time makes the fit's own covariance too small by this. */
static double inflation(const struct search *search) {
    const struct fit *fit = &search->best;
    const double mean2 = fit_mean_square(&fit->sums, 1);
    return fmax(mean2, 0.3) * 3.0;
}

/* `form`: what the form of the effect may be off by, one standard deviation. */
static struct diagnosis_interval interval_of(const struct search *search, size_t index, double value, double form) {
    const double variance = fmax(search->everything.covariance[index][index], 0.0);
    const double spread = NINETY_PERCENT * sqrt(variance * inflation(search) + form * form);
    return (struct diagnosis_interval){value, value - spread, value + spread};
}

/* How far the forms are seen to be off: what they leave of the gap, as an amplitude. */
static double form_share(const struct diagnosis *diagnosis) {
    const double left = fmax(diagnosis->structure[2], 0.0), all = fmax(diagnosis->structure[1], 1e-9);
    return FORM_SHARE + FORM_BY_REST * fmin(sqrt(left / all), 1.0);
}

/* A share of repeated samples is counted, not fitted. */
static struct diagnosis_interval interval_of_share(const struct search *search, double share) {
    double moving = 1.0;
    for (size_t i = 0; i < search->data->runs; i++) {
        moving += (double)search->data->run[i].tips_moving;
    }
    const double spread = NINETY_PERCENT * sqrt(share * (1.0 - share) * FREEZES_LAST / moving);
    return (struct diagnosis_interval){share, fmax(share - spread, 0.0), fmin(share + spread, 1.0)};
}

/* A parameter that moves nothing in this recording (a rate per kelvin where the temperature stands still) may be anything. */
static struct diagnosis_interval interval_of_parameter(const struct diagnosis *diagnosis, const struct search *search,
                                                       const struct effect *effect, size_t i, size_t index) {
    const struct effect_parameter *parameter = &effect->kind->parameter[i];
    const double value = effect->parameter[i];
    const bool within = value > parameter->least && value < parameter->most;
    if (within && !(search->everything.covariance[index][index] > 0.0)) {
        return (struct diagnosis_interval){isnan(parameter->none) ? value : parameter->none, parameter->least, parameter->most};
    }
    const double size = value - (isnan(parameter->none) ? 0.0 : parameter->none);
    return interval_of(search, index, value, form_share(diagnosis) * size);
}

static void take_effects(struct diagnosis *diagnosis, const struct search *search) {
    const struct gap_model *model = &search->everything.model;
    size_t index = 2;
    diagnosis->stiffness_scale = interval_of(search, 0, model->stiffness_scale, 5e-4);
    diagnosis->supply_scale = interval_of(search, 1, model->supply_scale, 5e-4);
    if (search->data->from_simulator) { /* its supply is in its pressures: there is nothing to fit */
        diagnosis->supply_scale = (struct diagnosis_interval){1.0, 1.0, 1.0};
    }
    /* without duties nothing shows the supply: the interval is then all that was allowed */
    struct gap_model bounded = *model;
    struct gap_parameter bounds[GAP_PARAMETERS_MAX];
    (void)gap_model_parameters(&bounded, bounds);
    diagnosis->supply_scale.low = fmax(diagnosis->supply_scale.low, bounds[1].least);
    diagnosis->supply_scale.high = fmin(diagnosis->supply_scale.high, bounds[1].most);
    for (size_t e = 0; e < model->count; e++) {
        const struct effect *effect = &model->effect[e];
        struct diagnosis_effect part = {.kind = effect->kind};
        struct diagnosis_effect *out = gap_model_is_part(model, e) ? &part : &diagnosis->effect[diagnosis->effects++];
        *out = (struct diagnosis_effect){.kind = effect->kind,
                                         .form = effect->form,
                                         .place = e,
                                         .chamber = effect->chamber,
                                         .onset_s = effect->onset_s};
        for (size_t i = 0; i < effect->kind->parameter_count; i++) {
            const bool counted = effect->kind->by_chance && i == 0;
            out->parameter[i] = counted ? interval_of_share(search, effect->parameter[i])
                                        : interval_of_parameter(diagnosis, search, effect, i, index);
            index += !counted;
        }
    }
}

/* Each kind alone, by its best. */
static void list_single_trials(struct diagnosis *diagnosis, const struct search *search) {
    for (size_t t = 0; t < search->trials; t++) {
        const struct fit *fit = &search->trial[t].fit;
        if (search->trial[t].step != 0 || !fit->sound || gap_model_kinds(&fit->model) != 1) {
            continue;
        }
        struct diagnosis_alternative *list = diagnosis->alternative;
        const struct diagnosis_alternative entry = {&fit->model.effect[0], 0.0, fit_structure(&fit->sums, 1)};
        size_t at = 0;
        while (at < diagnosis->alternatives && list[at].effect->kind != entry.effect->kind) {
            at++;
        }
        const bool fresh = at == diagnosis->alternatives, full = at == DIAGNOSIS_NAMES_MAX;
        at -= full;
        if ((!fresh || full) && list[at].structure <= entry.structure) {
            continue;
        }
        diagnosis->alternatives += fresh && !full;
        for (; at > 0 && list[at - 1].structure > entry.structure; at--) {
            list[at] = list[at - 1];
        }
        list[at] = entry;
    }
}

static void list_rivals(struct diagnosis *diagnosis, const struct rivals *rivals) {
    diagnosis->alternatives = 0;
    for (size_t i = 0; i < rivals->count && i < DIAGNOSIS_NAMES_MAX; i++) {
        const struct rival *rival = &rivals->rival[i];
        diagnosis->alternative[diagnosis->alternatives++] =
            (struct diagnosis_alternative){&rival->effect, rival->belief, fit_structure(&rival->fit.sums, 1)};
    }
}

/* By how much the pressure of a chamber moves, at most in one run. */
static double moves_of(const struct gap_data *data, size_t chamber) {
    double moves_pa = 0.0;
    for (size_t i = 0; i < data->runs; i++) {
        const struct gap_run *run = &data->run[i];
        const double *value = run->has_reading ? run->reading_pa : run->sim_pa != NULL ? run->sim_pa : run->command_pa;
        double least = INFINITY, most = -INFINITY;
        for (size_t row = 0; row < run->rows; row++) {
            least = fmin(least, value[3 * row + chamber]); /* a NaN changes neither */
            most = fmax(most, value[3 * row + chamber]);
        }
        moves_pa = fmax(moves_pa, most - least);
    }
    return moves_pa;
}

static bool one_chamber_moves(const struct gap_data *data) {
    size_t moving = 0;
    for (size_t c = 0; c < 3; c++) {
        moving += moves_of(data, c) > MOVES_LEAST_PA;
    }
    return moving == 1;
}

/* On one chamber a narrow line does just what a sluggish valve does. Where the others flow freely the valve is the likelier; where
 * no other flows, neither is. */
static void share_with_twin(struct diagnosis *diagnosis, struct diagnosis_effect *effect, const struct search *search) {
    const bool valve = strcmp(effect->kind->name, "valve_sluggish") == 0;
    const bool line = strcmp(effect->kind->name, "line_resistance") == 0, alone = one_chamber_moves(search->data);
    if (search_leaves_out(search, valve ? "line_resistance" : "valve_sluggish")) {
        return;
    }
    if (!valve && !(line && (alone || effect->chamber > 0))) {
        return;
    }
    const double valve_share = effect->probability * (alone ? 0.5 : SLUGGISH_SHARE);
    add_name(diagnosis, "valve_sluggish", valve_share);
    add_name(diagnosis, "line_resistance", effect->probability - valve_share);
    effect->probability = valve ? valve_share : effect->probability - valve_share;
}

static void believe_effect(struct diagnosis *diagnosis, struct diagnosis_effect *effect, const struct rivals *rivals,
                           const struct search *search) {
    effect->probability = 0.0;
    for (size_t i = 0; i < rivals->count; i++) {
        if (rivals->rival[i].kind == effect->kind) {
            effect->probability = effect->kind->by_chance ? BY_CHANCE_SURE : rivals->rival[i].belief;
        }
    }
    if (effect->probability < SURE) {
        name_group(diagnosis, rivals);
    }
    share_with_twin(diagnosis, effect, search);
    list_rivals(diagnosis, rivals);
}

static void believe(struct diagnosis *diagnosis, const struct search *search) {
    if (diagnosis->effects == 0) {
        list_single_trials(diagnosis, search);
    }
    for (size_t e = 0; e < diagnosis->effects; e++) {
        for (size_t r = 0; r < search->rivals_count; r++) {
            if (search->rivals[r].place == diagnosis->effect[e].place) {
                believe_effect(diagnosis, &diagnosis->effect[e], &search->rivals[r], search);
            }
        }
    }
    diagnosis->group = diagnosis->group > 1 ? diagnosis->group : 0;
}

/* --- where --- */

static void locate(struct diagnosis *diagnosis) {
    diagnosis->stage = "";
    (void)snprintf(diagnosis->regime, sizeof diagnosis->regime, "whole run");
    if (diagnosis->effects == 0) {
        return;
    }
    const struct diagnosis_effect *first = &diagnosis->effect[0];
    diagnosis->stage = effect_stage_name(first->kind->stage);
    for (size_t e = 0; e < diagnosis->effects; e++) {
        const struct diagnosis_effect *effect = &diagnosis->effect[e];
        for (size_t c = 0; c < 3; c++) {
            diagnosis->chamber[c] = diagnosis->chamber[c] || effect->chamber == 0 || effect->chamber == c + 1;
        }
    }
    if (first->onset_s > 0.0) {
        (void)snprintf(diagnosis->regime, sizeof diagnosis->regime, "from %.1f s on", first->onset_s);
    }
}

/* --- verdict --- */

/* Held pressures that never move tell stiffness from nothing. Where no pressure is known, nothing is said of them. */
static bool says_nothing(struct diagnosis *diagnosis, const struct search *search) {
    double most_pa = 0.0;
    for (size_t i = 0; i < search->data->runs; i++) {
        const struct gap_run *run = &search->data->run[i];
        if (!run->has_reading && !run->has_command && run->sim_pa == NULL) {
            return false;
        }
    }
    for (size_t c = 0; c < 3; c++) {
        most_pa = fmax(most_pa, moves_of(search->data, c));
    }
    if (most_pa > MOVES_LEAST_PA) {
        return false;
    }
    diagnosis_warn(diagnosis, "the pressures never move by more than %.0f Pa: record steps, ramps and holds of all three chambers",
                   most_pa);
    return true;
}

/* Does another simulator move in a way that our table model cannot follow? It is then likely to err smoothly, as bent fields
 * and the like do, too. */
static bool is_strange(const struct search *search) {
    const struct replay_elsewhere *elsewhere = &search->replay.elsewhere;
    return search->data->from_simulator && elsewhere->apart_m > DOUBTFUL_CHANGE * elsewhere->moves_m;
}

/* Share of the structure that the effects must close. What a simulator errs by looks like effects of body and tip, which can bend
 * to it nearly as well as several of them together can to anything; it does not look like a pressure sensor's. */
static double least_closed(const struct diagnosis *diagnosis, const struct search *search) {
    bool bends = diagnosis->effects > 1 || search->best.model.count > FEW_PARTS;
    for (size_t e = 0; e < diagnosis->effects && is_strange(search); e++) {
        bends = bends || diagnosis->effect[e].kind->stage != EFFECT_STAGE_PRESSURE_SENSOR;
    }
    return bends ? CLOSED_LEAST_BY_MANY : CLOSED_LEAST;
}

static double pressure_squares(const struct fit *fit) {
    return fit->sums.part[1][FIT_PRESSURE].square;
}

/* Belief in a kind among its rivals by what each leaves of the pressures alone. */
static double belief_by_pressures(const struct search *search, const struct diagnosis_effect *effect) {
    for (size_t r = 0; r < search->rivals_count; r++) {
        const struct rivals *rivals = &search->rivals[r];
        double least = pressure_squares(&search->best), own = 0.0, sum = 0.0;
        if (rivals->place != effect->place) {
            continue;
        }
        for (size_t i = 0; i < rivals->count; i++) {
            least = fmin(least, pressure_squares(&rivals->rival[i].fit));
        }
        const struct fit_part *part = &search->best.sums.part[1][FIT_PRESSURE];
        const double noise = part->noise_count > 0.0 ? part->noise / part->noise_count : 1.0;
        const double scale = PRESSURE_SHARE * fmax(pressure_squares(&search->recalibrated) - least, 0.0) + 4.0 * noise;
        for (size_t i = 0; i < rivals->count; i++) {
            const double belief = exp(-(pressure_squares(&rivals->rival[i].fit) - least) / scale);
            sum += belief;
            own += rivals->rival[i].kind == effect->kind ? belief : 0.0;
        }
        return sum > 0.0 ? own / sum : 0.0;
    }
    return 0.0;
}

/* Another simulator may err at the tip and yet have the right pressures: what explains these then stands, and the rest is said
 * to be unexplained. */
static bool keep_sensor_effects(struct diagnosis *diagnosis, const struct search *search) {
    const double before = fit_structure_of(&search->recalibrated.sums, 1, FIT_PRESSURE);
    const double after = fit_structure_of(&search->best.sums, 1, FIT_PRESSURE);
    size_t kept = 0;
    if (!is_strange(search) || before <= STRUCTURE_NONE || after > fmax(STRUCTURE_NONE, (1.0 - CLOSED_LEAST) * before)) {
        return false;
    }
    for (size_t e = 0; e < diagnosis->effects; e++) {
        if (diagnosis->effect[e].kind->stage == EFFECT_STAGE_PRESSURE_SENSOR) {
            diagnosis->effect[kept] = diagnosis->effect[e];
            diagnosis->effect[kept].probability = belief_by_pressures(search, &diagnosis->effect[kept]);
            kept++;
        }
    }
    if (kept == 0) {
        return false;
    }
    for (size_t e = 0; e < kept; e++) {
        if (diagnosis->effect[e].probability < SURE_ON_STRANGE) { /* nothing that one could name */
            return false;
        }
    }
    diagnosis->effects = kept;
    diagnosis->group = 0;
    memset(diagnosis->chamber, 0, sizeof diagnosis->chamber);
    locate(diagnosis);
    diagnosis_warn(diagnosis, "what is named explains the pressures; the tip is left with %.2g mm rms that nothing explains, or an error of "
                   "the other simulator",
                   diagnosis->gap[1].after_effect);
    return true;
}

static void decide(struct diagnosis *diagnosis, const struct search *search) {
    const double before = diagnosis->structure[0], recalibrated = diagnosis->structure[1], best = diagnosis->structure[2];
    if (says_nothing(diagnosis, search)) {
        diagnosis->verdict = GAP_INSUFFICIENT_DATA;
        diagnosis->effects = 0;
        diagnosis->group = 0;
        diagnosis->stage = "";
        memset(diagnosis->chamber, 0, sizeof diagnosis->chamber);
        return;
    }
    if (search->data->from_simulator && fmax(before, recalibrated) <= STRUCTURE_NONE) {
        diagnosis->verdict = GAP_NONE; /* what the search made of so little is nothing */
        diagnosis->effects = 0;
        diagnosis->group = 0;
        diagnosis->stage = "";
        memset(diagnosis->chamber, 0, sizeof diagnosis->chamber);
        return;
    }
    if (search->best.model.count == 0) {
        if (fmin(before, recalibrated) > STRUCTURE_NONE && recalibrated > RECALIBRATED_SHARE * before) {
            diagnosis->verdict = GAP_UNKNOWN;
        } else {
            diagnosis->verdict = before > fmax(STRUCTURE_NONE, 2.0 * recalibrated) ? GAP_RECALIBRATE : GAP_NONE;
        }
        return;
    }
    const double least = least_closed(diagnosis, search);
    const bool unexplained = best > STRUCTURE_NONE + (1.0 - least) * recalibrated;
    if (unexplained && !keep_sensor_effects(diagnosis, search)) {
        diagnosis->verdict = GAP_UNKNOWN;
        return;
    }
    for (size_t e = 0; e < diagnosis->effects; e++) {
        if (diagnosis->effect[e].probability < (is_strange(search) ? SURE_ON_STRANGE : SURE)) {
            diagnosis->verdict = GAP_GROUP;
            return;
        }
    }
    diagnosis->verdict = diagnosis->effects > 1 ? GAP_EFFECTS : GAP_EFFECT;
}

/* Effects that cannot act on another simulator's outputs, those with the same reason in one note. */
static void describe_untried(struct diagnosis *diagnosis, const struct gap_data *data) {
    const size_t kinds = effect_kind_count();
    for (size_t i = 0; i < kinds; i++) {
        const char *reason = gap_baseline_why_not(data, effect_kind_at(i));
        char names[DIAGNOSIS_TEXT_BYTES] = "";
        bool first = reason != NULL;
        size_t used = 0;
        for (size_t j = 0; j < kinds && first; j++) {
            const char *other = gap_baseline_why_not(data, effect_kind_at(j));
            const bool same = other != NULL && strcmp(other, reason) == 0;
            first = !(same && j < i);
            if (same && used < sizeof names) {
                used += (size_t)snprintf(names + used, sizeof names - used, "%s%s", used > 0 ? ", " : "", effect_kind_at(j)->name);
            }
        }
        if (first) {
            diagnosis_warn(diagnosis, "not tried: %s; %s", names, reason);
        }
    }
}

static void describe_baseline(struct diagnosis *diagnosis, const struct search *search) {
    const struct gap_data *data = search->data;
    const struct gap_run *run = &data->run[0];
    const struct replay_elsewhere *elsewhere = &search->replay.elsewhere;
    size_t rows = 0, tips = 0;
    for (size_t i = 0; i < data->runs; i++) {
        rows += data->run[i].rows_without_sim;
        tips += data->run[i].tips_without_sim;
    }
    diagnosis_warn(diagnosis, "the baseline is another simulator's output (%s), not our replay; --baseline table takes our replay",
                   run->sim_pa == NULL    ? "sim_tip_x_m .."
                   : run->sim_tip == NULL ? "sim_p1_pa .."
                                          : "sim_tip_x_m .. and sim_p1_pa ..");
    if (run->sim_tip != NULL && elsewhere->stiffness_scale > 0.0 && elsewhere->moves_m > 0.0) {
        diagnosis_warn(diagnosis,
                       "effects on the body are tried as the change that they make in our table model, which moves most like the other "
                       "simulator with stiffness x %.3g: their tips, %.2g mm rms about their means, then differ by %.2g mm%s",
                       elsewhere->stiffness_scale, 1e3 * elsewhere->moves_m, 1e3 * elsewhere->apart_m,
                       is_strange(search)
                           ? ", so that the sizes found for body effects are rough"
                           : "");
    }
    if (run->sim_is_copy) {
        diagnosis_warn(diagnosis, "sim_p1_pa to sim_p3_pa repeat the measured pressures: they count as not simulated");
    } else if (run->sim_pa == NULL) {
        diagnosis_warn(diagnosis, "the other simulator gives no pressures: its tip is taken to be that of the measured ones");
    }
    if (run->sim_tip == NULL) {
        diagnosis_warn(diagnosis, "the other simulator gives no tip: only pressures are compared");
    } else if (!run->has_orientation && run->tips > 0) {
        diagnosis_warn(diagnosis, "the tip is compared by its position alone: body and tip sensor are hard to tell apart");
    }
    if (rows > 0 || tips > 2 * data->runs) { /* one or two at either end of a run are no loss */
        diagnosis_warn(diagnosis, "%zu rows with pressures and %zu tip samples are left out: the other simulator says nothing there",
                       rows, tips);
    }
    describe_untried(diagnosis, data);
}

static void describe_data(struct diagnosis *diagnosis, const struct search *search) {
    const struct gap_run *run = &search->data->run[0];
    const uint64_t hash = search->replay.table->module.inputs_hash;
    if (run->table_hash != 0 && run->table_hash != hash) {
        diagnosis_warn(diagnosis,
                       "recorded with table %016" PRIx64 ", diagnosed with table %016" PRIx64 " of the same module: set-points came from "
                       "another model, and so may what the module is; --table takes another",
                       run->table_hash, hash);
    }
    if (search->data->from_simulator) {
        describe_baseline(diagnosis, search);
        return;
    }
    if (!run->has_duty) {
        diagnosis_warn(diagnosis, "no duties in the log: supply, valve and line effects cannot be told apart; record valve1..3");
    }
    if (!run->has_reading) {
        diagnosis_warn(diagnosis, "no measured pressures: what happens before and after the chambers cannot be separated; record p1_pa..p3_pa");
    }
    if (run->tips == 0) {
        diagnosis_warn(diagnosis, "no tip samples: nothing can be said of body and tip sensor; record tip_x_m.. and tip_qw..");
    } else if (!run->has_orientation) {
        diagnosis_warn(diagnosis, "no tip orientation: body and tip sensor cannot be told apart by comparing it with the position");
    }
    if (!run->has_supply) {
        diagnosis_warn(diagnosis, "the supply was not measured: its constant part is refitted, and its droop is seen by the chambers only");
    }
}

static bool in_group(const struct diagnosis *diagnosis, const char *name) {
    for (size_t i = 0; i < diagnosis->group; i++) {
        if (strcmp(diagnosis->group_name[i], name) == 0) {
            return true;
        }
    }
    return false;
}

/* Does an entry of the list name the same kinds? */
static bool names_the_same(const struct gap_model *a, const struct gap_model *b) {
    bool same = gap_model_kinds(a) == gap_model_kinds(b);
    for (size_t e = 0; e < a->count; e++) {
        bool named = false;
        for (size_t f = 0; f < b->count; f++) {
            named = named || b->effect[f].kind == a->effect[e].kind;
        }
        same = same && named;
    }
    return same;
}

/* Of an unknown gap: the models that come nearest, each set of kinds by its best, in the order of what they leave. */
static void find_closest(struct diagnosis *diagnosis, const struct search *search) {
    const double gap = fit_structure(&search->nominal.sums, 1);
    for (size_t t = 0; t < search->trials && gap > 0.0; t++) {
        const struct fit *fit = &search->trial[t].fit;
        const double closed = fit->sound ? 1.0 - fit_structure(&fit->sums, 1) / gap : -INFINITY;
        struct diagnosis_closest *list = diagnosis->closest_model;
        size_t at = 0;
        while (at < diagnosis->closest && !names_the_same(&list[at].model, &fit->model)) {
            at++;
        }
        if (at < diagnosis->closest) {
            if (list[at].closed >= closed) {
                continue;
            }
            memmove(&list[at], &list[at + 1], (--diagnosis->closest - at) * sizeof *list);
        }
        for (at = 0; at < diagnosis->closest && list[at].closed >= closed;) {
            at++;
        }
        if (at < DIAGNOSIS_CLOSEST_MAX && closed > diagnosis->closed_recalibration.value) {
            diagnosis->closest += diagnosis->closest < DIAGNOSIS_CLOSEST_MAX;
            memmove(&list[at + 1], &list[at], (diagnosis->closest - 1 - at) * sizeof *list);
            list[at] = (struct diagnosis_closest){fit->model, closed};
        }
    }
}

/* What to record next, in words. */
static void suggest(struct diagnosis *diagnosis) {
    const char *what = "";
    if (diagnosis->verdict == GAP_UNKNOWN) {
        what = "hold, step and cycle one chamber at a time at three heights: what the rest depends on then shows in the HTML report";
    } else if (in_group(diagnosis, "gravity") || in_group(diagnosis, "tip_payload")) {
        what = "bend by the same angle in six directions, and again with the module mounted the other way up";
    } else if (in_group(diagnosis, "creep") || in_group(diagnosis, "hysteresis") || in_group(diagnosis, "tip_latency")) {
        what = "the same cycle at three speeds, then hold for a minute: creep depends on time, hysteresis on the path, latency on speed";
    } else if (in_group(diagnosis, "line_volume") || in_group(diagnosis, "line_resistance") ||
               in_group(diagnosis, "valve_sluggish")) {
        what = "full steps from rest of one chamber at a time, up and down: small volumes tell a volume from a resistance";
    } else if (diagnosis->group > 1) {
        what = "all three chambers, one at a time and together, with steps, slow ramps and rests in between";
    }
    (void)snprintf(diagnosis->next_experiment, sizeof diagnosis->next_experiment, "%s", what);
}

/* Where neighbours differ by far more than the sensor errs, something moved between them that was not recorded: what is called
 * noise then hides a gap. */
static void doubt_floor(struct diagnosis *diagnosis, const struct search *search) {
    const double noise_deg = search->replay.run[0].tip_noise[1] * DEGREES;
    const struct diagnosis_gap *angle = &diagnosis->gap[2];
    if (!angle->measured || !(angle->floor > FLOOR_DOUBTFUL * noise_deg)) {
        return;
    }
    diagnosis_warn(diagnosis,
                   "what no model can explain amounts to %.2g deg, the sensor errs by %.2g deg: pressures were read too rarely, "
                   "transitions were sampled too slowly, or something moved the tip that no pressure shows, and a smaller gap cannot "
                   "be seen; record valve1..3 at 50 Hz or more, with the module free",
                   angle->floor, noise_deg);
    if (diagnosis->verdict == GAP_NONE) {
        diagnosis->verdict = GAP_INSUFFICIENT_DATA;
    }
}

bool diagnosis_conclude(struct diagnosis *diagnosis, struct search *search) {
    memset(diagnosis, 0, sizeof *diagnosis);
    if (!measure_gaps(diagnosis, search)) {
        return false;
    }
    describe_data(diagnosis, search);
    take_effects(diagnosis, search);
    believe(diagnosis, search);
    locate(diagnosis);
    decide(diagnosis, search);
    if (diagnosis->verdict == GAP_UNKNOWN) {
        diagnosis->stage = diagnosis->rest_stage;
        memcpy(diagnosis->chamber, diagnosis->rest_chamber, sizeof diagnosis->chamber);
        (void)snprintf(diagnosis->regime, sizeof diagnosis->regime, "whole run");
    } else {
        *diagnosis->description = '\0';
    }
    if (diagnosis->verdict == GAP_UNKNOWN) {
        find_closest(diagnosis, search);
    }
    doubt_floor(diagnosis, search);
    suggest(diagnosis);
    return dependence_find(&diagnosis->dependences, search,
                           diagnosis->verdict == GAP_UNKNOWN && search->best.model.count > 0);
}
