#include "gap/plan_search.h"

#include <math.h>
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gap/plan_match.h"

#define REFINED_AT_ONCE 2
#define PAIRED 3            /* the best is tried with each of so many, one after the other */
#define PAIR_WORTH 0.7      /* two experiments for one: only if confusion falls to this, */
#define CONFUSION_FINE 0.02 /* and not where one leaves no more than this */
#define RANDOM_SEED 1
/* How far the experiments go, as shares of the bend limit: the first that is safe under all candidates. */
static const double reaches[] = {0.9, 0.75, 0.6, 0.45, 0.3};

/* What a search works on. */
struct work {
    struct plan_search *search;
    const struct plan_bench *bench;
    const struct plan_candidates *candidates;
    const struct plan_search_options *options;
    size_t lead;
    size_t done;
    size_t total;
    bool sound; /* memory has sufficed so far */
};

static bool stopped(const struct work *work) {
    return work->options->stop != NULL && *work->options->stop != 0;
}

static int threads_of(const struct work *work) {
    return work->options->threads > 0 ? work->options->threads : omp_get_max_threads();
}

static void say(struct work *work, const char *what) {
#pragma omp critical(plan_progress)
    {
        work->done++;
        if (work->options->progress != NULL) {
            work->options->progress(work->options->context, what, work->done, work->total);
        }
    }
}

/* --- judging --- */

static bool judge_plan(const struct plan_bench *bench, const struct plan_candidates *candidates,
                       const struct plan *plan, int rounds, struct plan_verdict *verdict) {
    struct plan_drive drive;
    struct plan_reach reach;
    if (!plan_drive_follow(bench, &candidates->base, plan, &drive, &reach)) {
        return false;
    }
    verdict->length_s = plan_length_s(plan);
    const bool sound = plan_judge(bench, candidates, &drive, rounds, verdict);
    plan_drive_free(&drive);
    return sound;
}

bool plan_search_judge(const struct plan_bench *bench, const struct plan_candidates *candidates,
                       const struct plan *plan, struct plan_verdict *verdict) {
    return judge_plan(bench, candidates, plan, PLAN_ROUNDS, verdict);
}

static void judge_trial(struct work *work, struct plan_trial *trial, int rounds) {
    struct plan_verdict *verdict = &trial->verdict;
    (void)snprintf(verdict->name, sizeof verdict->name, "%s", trial->experiment.name);
    if (!stopped(work) &&
        !judge_plan(work->bench, work->candidates, &trial->experiment.plan, rounds, verdict)) {
#pragma omp atomic write
        work->sound = false;
    }
    say(work, verdict->name);
}

/* --- safety --- */

static bool is_within(const struct plan_bench *bench, const struct plan_reach *reach) {
    const struct bend_table_module *module = &bench->table->module;
    return !reach->fault && reach->bend_rad <= (double)module->bend_limit_rad &&
           reach->pressure_pa <= (double)module->working_pressure_pa;
}

/* Under every candidate, and without any; verdict->reach gets the farthest. */
static void check_safety(struct work *work, struct plan_trial *trial) {
    struct plan_reach *farthest = &trial->verdict.reach;
    struct plan_fault fault = {.step = 0};
    *farthest =
        (struct plan_reach){.fault = !plan_check(&trial->experiment.plan, work->bench->table, &fault)};
    for (size_t i = 0; i <= work->candidates->count && !farthest->fault; i++) {
        const struct gap_model *model =
            i < work->candidates->count ? &work->candidates->candidate[i].model : &work->candidates->base;
        struct plan_reach reach;
        if (!plan_drive_follow(work->bench, model, &trial->experiment.plan, NULL, &reach)) {
#pragma omp atomic write
            work->sound = false;
            return;
        }
        farthest->bend_rad = fmax(farthest->bend_rad, reach.bend_rad);
        farthest->pressure_pa = fmax(farthest->pressure_pa, reach.pressure_pa);
        farthest->fault = farthest->fault || reach.fault;
    }
    trial->safe = is_within(work->bench, farthest);
}

/* --- the course of a search --- */

static bool add_trial(struct plan_search *search, struct plan_trial **trial) {
    *trial = search->tried < PLAN_TRIED_MAX ? calloc(1, sizeof **trial) : NULL;
    if (*trial != NULL) {
        search->trial[search->tried++] = *trial;
    }
    return *trial != NULL;
}

/* Safe ones first, in the order of confusion. */
static int by_confusion(const void *a, const void *b) {
    const struct plan_trial *x = *(const struct plan_trial *const *)a,
                            *y = *(const struct plan_trial *const *)b;
    if (x->safe != y->safe) {
        return x->safe ? -1 : 1;
    }
    return (x->verdict.confusion > y->verdict.confusion) - (x->verdict.confusion < y->verdict.confusion);
}

static void sort_trials(struct plan_search *search, size_t from, size_t to) {
    struct plan_trial **first = search->trial + from;
    qsort(first, to - from, sizeof *first, by_confusion); // NOLINT(bugprone-sizeof-expression): pointers
}

static void drop_trials(struct plan_search *search) {
    for (size_t i = 0; i < search->tried; i++) {
        free(search->trial[i]);
    }
    search->tried = 0;
}

static void make_library(struct work *work, double bend_rad) {
    struct plan_search *search = work->search;
    struct plan_experiment *library = calloc(PLAN_LIBRARY_MAX, sizeof *library);
    drop_trials(search);
    search->bend_rad = bend_rad;
    work->sound = work->sound && library != NULL;
    const size_t count =
        work->sound ? plan_library_make(work->bench->table, work->lead, bend_rad, library) : 0;
    for (size_t i = 0; i < count && work->sound; i++) {
        struct plan_trial *trial;
        work->sound = add_trial(search, &trial);
        if (work->sound) {
            trial->experiment = library[i];
        }
    }
    free(library);
}

static void check_library(struct work *work) {
    struct plan_search *search = work->search;
#pragma omp parallel for schedule(dynamic, 1) num_threads(threads_of(work))
    for (size_t i = 0; i < search->tried; i++) {
        if (!stopped(work)) {
            check_safety(work, search->trial[i]);
        }
        say(work, search->trial[i]->experiment.name);
    }
}

static size_t safe_ones(const struct plan_search *search) {
    size_t safe = 0;
    for (size_t i = 0; i < search->tried; i++) {
        safe += search->trial[i]->safe;
    }
    return safe;
}

/* As far as is safe under all candidates; if all are safe at a reach, good. */
static void find_library(struct work *work) {
    const double limit_rad = (double)work->bench->table->module.bend_limit_rad;
    for (size_t r = 0; r < sizeof reaches / sizeof reaches[0] && work->sound && !stopped(work); r++) {
        work->done = 0;
        make_library(work, reaches[r] * limit_rad);
        work->total = work->search->tried;
        check_library(work);
        if (safe_ones(work->search) == work->search->tried) {
            break;
        }
    }
}

static void judge_range(struct work *work, size_t from, size_t to, int rounds) {
#pragma omp parallel for schedule(dynamic, 1) num_threads(threads_of(work))
    for (size_t i = from; i < to; i++) {
        struct plan_trial *trial = work->search->trial[i];
        if (!trial->refined) {
            judge_trial(work, trial, rounds);
            trial->refined = rounds > 0;
        }
    }
}

/* To first order an experiment looks better than it is: the best that is not refined yet is, two at a time,
 * until the best `wanted` of all are ones that are. */
static void refine_best(struct work *work, size_t safe, size_t wanted) {
    struct plan_search *search = work->search;
    size_t first = 0;
    while (first < safe && first < wanted && work->sound && !stopped(work)) {
        const size_t last = first + REFINED_AT_ONCE < safe ? first + REFINED_AT_ONCE : safe;
        judge_range(work, first, last, PLAN_ROUNDS);
        sort_trials(search, 0, safe);
        for (first = 0; first < safe && search->trial[first]->refined;) {
            first++;
        }
    }
}

/* The best one, then each of those behind it. */
static void add_pairs(struct work *work, size_t singles) {
    struct plan_search *search = work->search;
    const struct plan_experiment *first = &search->trial[0]->experiment;
    for (size_t i = 1; i < singles && i < PAIRED; i++) {
        const struct plan_experiment *second = &search->trial[i]->experiment;
        struct plan_trial *trial;
        if (!add_trial(search, &trial)) {
            work->sound = false;
            return;
        }
        trial->experiment = *first;
        (void)snprintf(trial->experiment.plan.note, sizeof trial->experiment.plan.note, "%s, then %s",
                       first->name, second->name);
        trial->safe = plan_append(&trial->experiment.plan, &second->plan);
        (void)snprintf(trial->verdict.name, sizeof trial->verdict.name, "%s, %s", first->name, second->name);
    }
}

static void judge_pair(struct work *work, struct plan_trial *trial) {
    char name[PLAN_NAME_BYTES];
    (void)snprintf(name, sizeof name, "%s", trial->verdict.name);
    if (trial->safe) {
        check_safety(work, trial);
    }
    if (trial->safe) {
        judge_trial(work, trial, PLAN_ROUNDS);
        trial->refined = true;
    }
    (void)snprintf(trial->verdict.name, sizeof trial->verdict.name, "%s", name);
}

/* A pair goes to the front only where it is worth its time. */
static void try_pairs(struct work *work, size_t singles) {
    struct plan_search *search = work->search;
    const size_t first = search->tried;
    add_pairs(work, singles);
    work->done = 0;
    work->total = search->tried - first;
#pragma omp parallel for schedule(dynamic, 1) num_threads(threads_of(work))
    for (size_t i = first; i < search->tried; i++) {
        judge_pair(work, search->trial[i]);
    }
    sort_trials(search, first, search->tried);
    struct plan_trial *best = first < search->tried ? search->trial[first] : NULL;
    if (best != NULL && best->safe &&
        best->verdict.confusion < PAIR_WORTH * search->trial[0]->verdict.confusion) {
        for (size_t i = first; i > 0; i--) {
            search->trial[i] = search->trial[i - 1];
        }
        search->trial[0] = best;
    }
}

/* What has been recorded. */
static bool drive_before(struct work *work, struct plan_drive *drive) {
    struct plan_experiment *hold = calloc(1, sizeof *hold);
    struct plan_verdict *before = &work->search->before;
    struct plan_reach reach;
    bool sound = hold != NULL;
    if (work->options->run != NULL) {
        (void)snprintf(before->name, sizeof before->name, "recorded");
        sound = sound && plan_drive_record(work->bench, work->options->run, drive);
    } else if (sound) {
        plan_library_hold(work->bench->table, work->lead,
                          reaches[0] * (double)work->bench->table->module.bend_limit_rad, hold);
        (void)snprintf(before->name, sizeof before->name, "%s", hold->name);
        sound = plan_drive_follow(work->bench, &work->candidates->base, &hold->plan, drive, &reach);
    }
    before->length_s = sound ? PLAN_SAMPLE_S * (double)plan_drive_samples(work->bench, drive) : 0.0;
    free(hold);
    return sound;
}

static void judge_random(struct work *work) {
    struct plan_experiment *experiment = calloc(1, sizeof *experiment);
    work->sound = work->sound && experiment != NULL;
    if (work->sound && !stopped(work)) {
        plan_library_random(work->bench->table, work->search->bend_rad, RANDOM_SEED, experiment);
        work->sound =
            plan_search_judge(work->bench, work->candidates, &experiment->plan, &work->search->random);
        (void)snprintf(work->search->random.name, sizeof work->search->random.name, "%s", experiment->name);
    }
    free(experiment);
}

static enum plan_outcome outcome_of(const struct work *work) {
    if (!work->sound) {
        return PLAN_NO_MEMORY;
    }
    if (stopped(work)) {
        return PLAN_INTERRUPTED;
    }
    return work->search->tried > 0 && work->search->trial[0]->safe ? PLAN_FOUND : PLAN_UNSAFE;
}

enum plan_outcome plan_search_run(struct plan_search *search, const struct plan_bench *bench,
                                  struct plan_candidates *candidates,
                                  const struct plan_search_options *options) {
    struct work work = {.search = search,
                        .bench = bench,
                        .candidates = candidates,
                        .options = options,
                        .lead = plan_candidates_lead(candidates),
                        .sound = true};
    struct plan_drive before = {.periods = 0};
    memset(search, 0, sizeof *search);
    work.sound = drive_before(&work, &before);
    work.sound = work.sound && plan_match(bench, candidates, &before);
    work.sound = work.sound && plan_judge(bench, candidates, &before, PLAN_ROUNDS, &search->before);
    plan_drive_free(&before);
    find_library(&work);
    if (outcome_of(&work) == PLAN_NO_MEMORY || outcome_of(&work) == PLAN_INTERRUPTED) {
        return outcome_of(&work);
    }
    sort_trials(search, 0, search->tried);
    const size_t safe = safe_ones(search);
    work.done = 0;
    work.total = safe;
    judge_range(&work, 0, safe, 0);
    sort_trials(search, 0, safe);
    work.done = 0;
    refine_best(&work, safe, 1);
    if (safe > 0 && work.sound && !stopped(&work) && search->trial[0]->verdict.confusion > CONFUSION_FINE) {
        refine_best(&work, safe, PAIRED);
        try_pairs(&work, safe);
    }
    judge_random(&work);
    return outcome_of(&work);
}

void plan_search_close(struct plan_search *search) {
    drop_trials(search);
}
