#include "campaign/series.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "campaign/emulated.h"
#include "program/program.h"

static bool meant(const struct series *series, size_t injection) {
    const struct injection *at = injection_at(injection);
    return series->only == NULL || strstr(at->name, series->only) != NULL || strstr(at->row, series->only) != NULL;
}

static bool can_be_put(const struct series *series, size_t injection) {
    return series->elf == NULL || emulated_left_out(injection_at(injection)) == NULL;
}

static bool pair_meant(const struct series *series, size_t a, size_t b) {
    return (meant(series, a) || meant(series, b)) && can_be_put(series, a) && can_be_put(series, b);
}

/* The `index`-th variant; returns how many were passed on the way where there are fewer. */
static size_t find(const struct series *series, size_t index, struct trial *trial) {
    size_t passed = 0;
    for (size_t a = 0; a < injection_count(); a++) {
        const size_t first = series->kind == SERIES_SINGLE ? a : a + 1;
        const size_t last = series->kind == SERIES_SINGLE ? a + 1 : injection_count();
        for (size_t b = first; b < last; b++) {
            if (pair_meant(series, a, b) && passed++ == index) {
                trial->injection[0] = a;
                trial->injection[1] = series->kind == SERIES_SINGLE ? TRIAL_NONE : b;
                return passed;
            }
        }
    }
    return passed;
}

size_t series_variants(const struct series *series) {
    struct trial trial;
    return series->kind == SERIES_SOUND ? 1 : find(series, SIZE_MAX, &trial);
}

void series_trial(const struct series *series, size_t index, struct trial *trial) {
    struct random_stream random;
    random_seed(&random, series->seed, 1000 + 2 * index + (series->kind == SERIES_PAIRS ? 1 : 0));
    *trial = (struct trial){.seed = (uint64_t)(9007199254740992.0 * random_uniform(&random)),
                            .injection = {TRIAL_NONE, TRIAL_NONE}};
    if (series->kind == SERIES_SOUND) {
        return;
    }
    (void)find(series, index % series_variants(series), trial);
    if (series->kind == SERIES_PAIRS && random_uniform(&random) < 0.5) { /* either comes first */
        const size_t second = trial->injection[0];
        trial->injection[0] = trial->injection[1];
        trial->injection[1] = second;
    }
}

static void say(size_t finished, size_t all) {
    if (finished % (all / 50 + 1) == 0 || finished == all) {
        fprintf(stderr, "\r%zu of %zu", finished, all);
        fprintf(stderr, "%s", finished == all ? "\n" : "");
    }
}

/* The place's vehicle is from now on the emulated board, which the caller frees. */
static bool open_board(struct trial_place *place, const char *elf, struct emulated **emulated) {
    char error[CORE_ERROR_BYTES] = "no memory";
    *emulated = malloc(sizeof **emulated);
    if (*emulated == NULL || !emulated_open(*emulated, elf, place->plant_table, &place->table, place->image, error,
                                            sizeof error)) {
        fprintf(stderr, "campaign: %s\n", error);
        return false;
    }
    emulated_vehicle(*emulated, &place->vehicle);
    return true;
}

bool series_run(const struct series *series, const struct bend_table *table, const struct plant_parameters *plant,
                struct trial_result *result, bool *done, bool shows_progress) {
    bool memory = true;
    size_t finished = 0;
#pragma omp parallel
    {
        static __thread struct trial_place place;
        struct emulated *emulated = NULL;
        const bool opened = trial_place_open(&place, table) &&
                            (series->elf == NULL || open_board(&place, series->elf, &emulated));
#pragma omp critical
        memory = memory && opened;
#pragma omp for schedule(dynamic)
        for (size_t i = 0; i < series->trials; i++) {
            if (!opened || program_interrupted != 0) {
                continue;
            }
            struct trial trial;
            series_trial(series, i, &trial);
            trial_run(&place, plant, &trial, &result[i]);
            done[i] = true;
            if (shows_progress) {
#pragma omp critical
                say(++finished, series->trials);
            }
        }
        trial_place_close(&place);
        free(emulated);
    }
    return memory;
}
