#include "blind_case.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "blind_gap.h"

#define ATTEMPTS 30
#define CALMER 0.88        /* of the excitation, when a run went too far */
#define CALMINGS 10
#define BEND_MOST_RAD 1.85 /* what a run may reach */
#define FAINT_SHARE 0.17   /* of single cases */
#define FAINT_ROUNDS 6
#define FAINT_LEAST 1.05
#define FAINT_MOST 2.95

/* What a corpus draws. */
struct corpus {
    const char *name;
    const char *verdict;
    void (*draw)(struct blind_case *blind, struct blind_random *random, const struct blind_scene *scene, size_t index,
                 uint64_t seed);
    bool scaled;   /* half of the cases have other nominal parameters as well */
    bool may_faint;
    double gap_least; /* of each effect, of the noise floor */
};

/* --- which effects --- */

/* A random order of 0 .. count - 1 that is another in every round. */
static size_t shuffled(uint64_t seed, const char *purpose, size_t count, size_t index) {
    struct blind_random random;
    size_t order[64] = {0};
    blind_random_open(&random, seed, purpose, index / count);
    for (size_t i = 0; i < count; i++) {
        const size_t j = blind_below(&random, i + 1);
        order[i] = order[j];
        order[j] = i;
    }
    return order[index % count];
}

static void add_effect(struct blind_case *blind, const struct blind_effect_kind *kind, struct blind_random *random,
                       const struct blind_scene *scene) {
    blind_effect_draw(&blind->effect[blind->effects++], kind, random, scene);
}

static void draw_single(struct blind_case *blind, struct blind_random *random, const struct blind_scene *scene,
                        size_t index, uint64_t seed) {
    const size_t which = shuffled(seed, blind->corpus, blind_catalogue_count(), index);
    add_effect(blind, blind_catalogue_at(which), random, scene);
}

static void draw_ablation(struct blind_case *blind, struct blind_random *random, const struct blind_scene *scene,
                          size_t index, uint64_t seed) {
    draw_single(blind, random, scene, index, seed);
    blind->removed = blind->effect[0].kind->name;
}

static void draw_unknown(struct blind_case *blind, struct blind_random *random, const struct blind_scene *scene,
                         size_t index, uint64_t seed) {
    const size_t which = shuffled(seed, blind->corpus, blind_outside_count(), index);
    add_effect(blind, blind_outside_at(which), random, scene);
}

/* One chamber, or from the middle of the run on, or both. */
static void draw_local(struct blind_case *blind, struct blind_random *random, const struct blind_scene *scene,
                       size_t index, uint64_t seed) {
    struct blind_effect *effect = &blind->effect[0];
    draw_single(blind, random, scene, index, seed);
    const bool may_wait = effect->kind->latency_us == NULL;
    const bool one = effect->kind->reach != BLIND_ALL_CHAMBERS && blind_chance(random, 0.6);
    if (one && effect->kind->reach == BLIND_ANY_CHAMBER) {
        effect->chamber = 1 + (int)blind_below(random, 3);
    }
    if (may_wait && (!one || blind_chance(random, 0.3))) {
        effect->onset_s = blind_uniform(random, 0.25, 0.6) * blind->rig[0].seconds;
    }
}

static void draw_pair(struct blind_case *blind, struct blind_random *random, const struct blind_scene *scene,
                      size_t index, uint64_t seed) {
    const bool same_stage = blind_chance(random, 0.3);
    draw_single(blind, random, scene, index, seed);
    const struct blind_effect_kind *first = blind->effect[0].kind, *second = first;
    while (second == first || (strcmp(second->stage, first->stage) == 0) != same_stage) {
        second = blind_catalogue_at(blind_below(random, blind_catalogue_count()));
        if (strcmp(first->stage, "supply") == 0 && second != first) {
            break; /* the only one of its stage */
        }
    }
    add_effect(blind, second, random, scene);
}

static void draw_nothing(struct blind_case *blind, struct blind_random *random, const struct blind_scene *scene,
                         size_t index, uint64_t seed) {
    (void)blind;
    (void)random;
    (void)scene;
    (void)index;
    (void)seed;
}

static void draw_recalibrate(struct blind_case *blind, struct blind_random *random, const struct blind_scene *scene,
                             size_t index, uint64_t seed) {
    const bool supply = index % 3 != 0, stiffness = index % 3 != 1;
    (void)scene;
    (void)seed;
    for (size_t r = 0; r < BLIND_RUNS; r++) {
        blind->rig[r].nominal = (struct blind_nominal){1.0, 1.0};
    }
    if (stiffness) {
        const double size = blind_log_uniform(random, 1.03, blind_chance(random, 0.5) ? 1.1 : 1.6);
        blind->rig[0].nominal.stiffness_scale = blind_chance(random, 0.5) ? size : 1.0 / size;
    }
    if (supply) { /* a sensor at the supply would tell the diagnosis, and nothing would be left to explain */
        blind->rig[0].nominal.supply_scale = 1.0 + blind_signed(random, 0.03, 0.15);
        blind->rig[0].supply_read = blind->form.supply = false;
    }
    blind->rig[1].nominal = blind->rig[0].nominal;
}

/* Pairs of effects that these excitations leave exactly alike. */
static void draw_confounded(struct blind_case *blind, struct blind_random *random, const struct blind_scene *scene,
                            size_t index, uint64_t seed) {
    static const char *const alike[3][2] = {{"line_resistance", "valve_sluggish"},   /* only chamber 1 ever flows */
                                            {"tip_offset", "tip_lever_arm"},         /* the tip never turns */
                                            {"chamber_asymmetry", "tip_misalignment"}}; /* one plane, no orientation */
    const size_t which = index % 3;
    (void)seed;
    blind->group[0] = alike[which][0];
    blind->group[1] = alike[which][1];
    blind->groups = 2;
    blind->excitation = which == 1 ? BLIND_EXCITE_STRAIGHT : BLIND_EXCITE_ONE;
    blind->form.orientation = which != 2;
    add_effect(blind, blind_kind_find(alike[which][which == 2 ? 0 : blind_below(random, 2)]), random, scene);
    struct blind_effect *effect = &blind->effect[0];
    if (which != 1) {
        effect->chamber = strcmp(effect->kind->name, "line_resistance") == 0 ? 0 : 1;
    }
    if (which == 2) {
        effect->parameter[0] = 1.0; /* azimuth only: what a turn of the transmitter about z does as well */
    }
}

static const struct corpus corpora[] = {
    {"single", "effect", draw_single, true, true, 1.0},
    {"local", "effect", draw_local, true, false, 3.0},
    {"pair", "effects", draw_pair, true, false, 3.0},
    {"unknown", "unknown", draw_unknown, true, false, 3.0},
    {"ablation", "unknown", draw_ablation, true, false, 3.0},
    {"nogap", "no-gap", draw_nothing, false, false, 0.0},
    {"recalibrate", "recalibrate", draw_recalibrate, false, false, 0.0},
    {"geometry", "effect", draw_single, true, false, 3.0},
    {"confounded", "group", draw_confounded, false, false, 3.0},
};
#define CORPORA (sizeof corpora / sizeof corpora[0])

static const struct corpus *corpus_of(const char *name) {
    for (size_t i = 0; i < CORPORA; i++) {
        if (strcmp(corpora[i].name, name) == 0) {
            return &corpora[i];
        }
    }
    return NULL;
}

const char *blind_corpus_find(const char *name) {
    const struct corpus *corpus = corpus_of(name);
    return corpus != NULL ? corpus->name : (strcmp(name, "mixed") == 0 ? "mixed" : NULL);
}

/* --- the rig --- */

static void draw_rig(struct blind_case *blind, struct blind_random *random, double seconds, bool scaled) {
    const int64_t tip_ms = blind_chance(random, 0.7) ? 10 : 8 + (int64_t)blind_below(random, 5);
    const bool controlled = blind_chance(random, 0.8);
    struct blind_nominal nominal = {1.0, 1.0};
    if (scaled && blind_chance(random, 0.5)) {
        nominal.stiffness_scale = blind_uniform(random, 0.9, 1.1);
        nominal.supply_scale = blind_uniform(random, 0.93, 1.07);
    }
    blind->form = (struct blind_log_form){.rate_hz = blind_uniform(random, 100.0, 200.0),
                                          .supply = blind_chance(random, 0.5),
                                          .temperature = blind_chance(random, 0.35),
                                          .orientation = true};
    blind->form.rate_hz = fmax(blind->form.rate_hz, 1000.0 / (double)tip_ms);
    for (size_t r = 0; r < BLIND_RUNS; r++) {
        blind->rig[r] = (struct blind_rig){
            .seed = ((uint64_t)blind_random_u32(random) << 32) | blind_random_u32(random),
            .seconds = seconds,
            .nominal = nominal,
            .drive = controlled ? BLIND_DRIVE_CONTROLLER : BLIND_DRIVE_DUTIES,
            .tip_period_us = 1000 * tip_ms,
            .tip_phase_us = 1000 * (1 + (int64_t)blind_below(random, (size_t)tip_ms - 1)),
            .supply_read = blind->form.supply,
            .warming_k = {293.15 + blind_uniform(random, -0.5, 0.5), blind_signed(random, 1.0, 6.0),
                          blind_uniform(random, 8.0, 25.0)}};
    }
}

/* A sensor at the supply would give away what happens there. */
static void hide_supply(struct blind_case *blind) {
    for (size_t i = 0; i < blind->effects; i++) {
        if (strcmp(blind->effect[i].kind->stage, "supply") == 0) {
            blind->form.supply = false;
            blind->rig[0].supply_read = blind->rig[1].supply_read = false;
        }
    }
}

/* Operators notice a sensor that is far off and ask for pressures that still move the module. */
static void shift_targets(struct blind_case *blind) {
    for (size_t i = 0; i < blind->effects; i++) {
        const struct blind_effect *effect = &blind->effect[i];
        for (size_t c = 0; c < 3 && strcmp(effect->kind->name, "pressure_offset") == 0; c++) {
            const double shift = blind_effect_on(effect, c) && !(effect->onset_s > 0.0) ? effect->parameter[0] : 0.0;
            blind->rig[0].target_shift_pa[c] = blind->rig[1].target_shift_pa[c] =
                blind->rig[0].drive == BLIND_DRIVE_CONTROLLER ? shift : 0.0;
        }
    }
}

/* --- running --- */

static void effect_pointers(struct blind_case *blind, const struct blind_effect *without, struct blind_effect **pointer,
                            size_t *count) {
    *count = 0;
    for (size_t i = 0; i < blind->effects; i++) {
        if (&blind->effect[i] != without) {
            pointer[(*count)++] = &blind->effect[i];
        }
    }
}

static void close_records(struct blind_case *blind) {
    for (size_t r = 0; r < BLIND_RUNS; r++) {
        blind_record_close(&blind->record[r]);
    }
}

bool blind_record_fits(const struct blind_record *record, const struct bend_table *table) {
    return !record->faulted && record->bend_most_rad < BEND_MOST_RAD &&
           record->load_most_pa < (double)table->axis_pa[0][table->nodes[0] - 1];
}

/* One run; `*fits`: as blind_record_fits(). */
static bool run_once(struct blind_case *blind, struct blind_field *field, size_t r, double pressure_most_pa, bool *fits) {
    struct blind_effect *pointer[BLIND_EFFECTS_MAX];
    struct blind_excitation excitation;
    struct blind_random random;
    size_t count;
    effect_pointers(blind, NULL, pointer, &count);
    blind_random_open(&random, blind->rig[r].seed, "excitation", r);
    if (!blind_excitation_open(&excitation, blind->excitation, &random, field, blind->rig[r].nominal.stiffness_scale,
                               pressure_most_pa, blind->rig[r].seconds)) {
        return false;
    }
    blind_record_close(&blind->record[r]);
    const bool ran = blind_run(&blind->rig[r], field, pointer, count, &excitation, NULL, &blind->record[r]);
    blind_excitation_close(&excitation);
    *fits = blind_record_fits(&blind->record[r], field->table);
    return ran;
}

/* Both runs, calmed down until they fit. */
static bool run_both(struct blind_case *blind, struct blind_field *field, bool *fits) {
    const double stiffness = blind->rig[0].nominal.stiffness_scale;
    const double working_pa = (double)field->table->module.working_pressure_pa;
    const double start_pa = fmin(blind_pressure_most_pa(field) * stiffness, working_pa);
    for (size_t r = 0; r < BLIND_RUNS; r++) {
        double most_pa = start_pa;
        *fits = false;
        for (int i = 0; i < CALMINGS && !*fits; i++, most_pa *= CALMER) {
            if (!run_once(blind, field, r, most_pa, fits)) {
                return false;
            }
        }
        if (!*fits) {
            return true;
        }
    }
    return true;
}

/* The gap against the same duties without one effect, or without all (`without` NULL). */
static bool gap_without(struct blind_case *blind, struct blind_field *field, const struct blind_effect *without,
                        double *ratio) {
    struct blind_gap gap = {0};
    struct blind_effect *pointer[BLIND_EFFECTS_MAX];
    size_t count = 0;
    bool ran = true;
    if (without != NULL) {
        effect_pointers(blind, without, pointer, &count);
    }
    for (size_t r = 0; r < BLIND_RUNS && ran; r++) {
        struct blind_rig rig = blind->rig[r];
        struct blind_record record;
        rig.drive = BLIND_DRIVE_AGAIN;
        ran = blind_run(&rig, field, pointer, count, NULL, &blind->record[r], &record);
        if (ran) {
            blind_gap_add(&gap, &blind->record[r], &record);
        }
        blind_record_close(&record);
    }
    *ratio = blind_gap_ratio(&gap, blind->form.orientation);
    return ran;
}

static bool measure_gaps(struct blind_case *blind, struct blind_field *field) {
    bool ran = gap_without(blind, field, NULL, &blind->gap_ratio);
    for (size_t i = 0; i < blind->effects && ran; i++) {
        if (blind->effects == 1) {
            blind->effect_gap[i] = blind->gap_ratio;
        } else {
            ran = gap_without(blind, field, &blind->effect[i], &blind->effect_gap[i]);
        }
    }
    return ran;
}

/* Every effect shows. A pressure sensor's error can hardly be many times its noise: once is plain in thousands of samples. */
static bool shows(const struct blind_case *blind, double gap_least) {
    bool shown = true;
    for (size_t i = 0; i < blind->effects; i++) {
        const bool sensor = strcmp(blind->effect[i].kind->stage, "pressure sensor") == 0;
        shown = shown && blind->effect_gap[i] >= (sensor ? fmin(gap_least, 1.0) : gap_least);
    }
    return shown;
}

/* Weakens the effect until the gap is one to three times the floor. */
static bool make_faint(struct blind_case *blind, struct blind_field *field, double wanted, bool *fits) {
    for (int i = 0; i < FAINT_ROUNDS; i++) {
        if (blind->gap_ratio > FAINT_LEAST && blind->gap_ratio < FAINT_MOST) {
            return true;
        }
        blind_effect_weaken(&blind->effect[0], fmin(wanted / blind->gap_ratio, 2.0));
        if (!run_both(blind, field, fits) || (*fits && !measure_gaps(blind, field))) {
            return false;
        }
    }
    *fits = *fits && blind->gap_ratio > FAINT_LEAST && blind->gap_ratio < FAINT_MOST;
    return true;
}

static void note_amounts(struct blind_case *blind) {
    for (size_t i = 0; i < blind->effects; i++) {
        struct blind_measure sum = {0};
        for (size_t r = 0; r < BLIND_RUNS; r++) {
            sum.line_kg += blind->record[r].measure.line_kg;
            sum.line_nominal_kg += blind->record[r].measure.line_nominal_kg;
            sum.leak_kg += blind->record[r].measure.leak_kg;
            sum.leak_per_conductance += blind->record[r].measure.leak_per_conductance;
        }
        if (blind->effect[i].kind->amounts != NULL) {
            blind->effect[i].kind->amounts(&blind->effect[i], &sum, blind->effect[i].parameter);
        }
    }
}

static void name_case(struct blind_case *blind, uint64_t seed, size_t index) {
    struct blind_random random;
    blind_random_open(&random, seed ^ 0x51ed270bu, blind->corpus, index);
    (void)snprintf(blind->id, sizeof blind->id, "%08x", blind_random_u32(&random));
}

static void free_effects(struct blind_case *blind) {
    for (size_t i = 0; i < blind->effects; i++) {
        blind_effect_free(&blind->effect[i]);
    }
    blind->effects = 0;
}

static bool try_case(struct blind_case *blind, struct blind_field *field, uint64_t seed, const struct corpus *corpus,
                     size_t index, size_t attempt, double seconds, bool *fits) {
    struct blind_random random;
    blind_random_open(&random, seed, corpus->name, index * ATTEMPTS + attempt);
    close_records(blind);
    free_effects(blind);
    draw_rig(blind, &random, seconds, corpus->scaled);
    const struct blind_scene scene = {.pressure_most_pa = blind_pressure_most_pa(field),
                                      .temperature_logged = blind->form.temperature};
    blind->excitation = BLIND_EXCITE_ALL;
    blind->faint = corpus->may_faint && blind_chance(&random, FAINT_SHARE);
    const double wanted = blind_uniform(&random, 1.3, 2.7);
    corpus->draw(blind, &random, &scene, index, seed);
    hide_supply(blind);
    shift_targets(blind);
    if (!run_both(blind, field, fits) || (*fits && !measure_gaps(blind, field))) {
        return false;
    }
    if (*fits && blind->faint && !make_faint(blind, field, wanted, fits)) {
        return false;
    }
    *fits = *fits && shows(blind, corpus->gap_least);
    return true;
}

bool blind_case_open(struct blind_case *blind, struct blind_field *field, const struct blind_draw *draw) {
    struct blind_random random;
    memset(blind, 0, sizeof *blind);
    blind->draw = *draw;
    blind_random_open(&random, draw->seed, "mixed", draw->index);
    const struct corpus *corpus =
        strcmp(draw->corpus, "mixed") == 0 ? &corpora[blind_below(&random, CORPORA)] : corpus_of(draw->corpus);
    blind->corpus = corpus->name;
    blind->verdict = corpus->verdict;
    name_case(blind, draw->seed, draw->index);
    bool fits = false;
    for (size_t attempt = 0; attempt < ATTEMPTS && !fits; attempt++) {
        if (!try_case(blind, field, draw->seed, corpus, draw->index, attempt, draw->seconds, &fits)) {
            return false;
        }
    }
    note_amounts(blind);
    return fits;
}

void blind_case_close(struct blind_case *blind) {
    close_records(blind);
    free_effects(blind);
}
