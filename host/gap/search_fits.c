#include "gap/search_parts.h"

#include <omp.h>
#include <stdlib.h>

#define NOMINAL_ROUNDS 6

/* --- on all threads --- */

bool search_crew_open(struct search_crew *crew, const struct search *search, const struct fit_base *base) {
    crew->count = 0;
    const int wanted = search->options.threads > 0 ? search->options.threads : omp_get_max_threads();
    crew->fitter = calloc((size_t)wanted, sizeof *crew->fitter);
    if (crew->fitter == NULL) {
        return false;
    }
    while (crew->count < wanted && fitter_open(&crew->fitter[crew->count], base)) {
        crew->count++;
    }
    return crew->count == wanted;
}

void search_crew_close(struct search_crew *crew) {
    for (int i = 0; i < crew->count; i++) {
        fitter_close(&crew->fitter[i]);
    }
    free(crew->fitter);
    *crew = (struct search_crew){NULL, 0};
}

bool search_stopped(const struct search *search) {
    return search->options.stop != NULL && *search->options.stop != 0;
}

void search_say(const struct search *search, const char *what, size_t done, size_t total) {
    if (search->options.progress != NULL) {
#pragma omp critical(search_progress)
        search->options.progress(search->options.context, what, done, total);
    }
}

/* --- of all the data --- */

bool search_compare_again(struct search *search) {
    struct fit_base base;
    struct fitter fitter;
    bool sound = fit_base_open(&base, &search->replay, NULL, &search->recalibrated.model);
    if (sound) {
        sound = fitter_open(&fitter, &base);
        if (sound) {
            fitter_run(&fitter, &search->recalibrated, 0, false);
            fitter_close(&fitter);
        }
        fit_base_close(&base);
    }
    return sound;
}

bool search_recalibrate(struct search *search, struct fit *fit, bool fit_nominal) {
    struct replay_state state;
    struct fit_base base;
    struct fitter fitter;
    bool sound = replay_state_open(&state, &search->replay);
    for (int round = 0; round < 3 && sound; round++) {
        sound = replay_tune(&search->replay, &fit->model, &state) &&
                fit_base_open(&base, &search->replay, NULL, &fit->model);
        if (!sound) {
            break;
        }
        sound = fitter_open(&fitter, &base);
        if (sound) {
            fitter_run(&fitter, fit, fit_nominal ? NOMINAL_ROUNDS : 0, fit_nominal);
            fitter_close(&fitter);
        }
        fit_base_close(&base);
    }
    replay_state_close(&state, &search->replay);
    replay_follow(&search->coarse, &search->replay);
    return sound && (fit != &search->best || search_compare_again(search));
}

bool search_fit_everything(struct search *search) {
    struct fit_base base;
    struct fitter fitter;
    bool sound = fit_base_open(&base, &search->replay, NULL, &search->best.model);
    search->everything = search->best;
    if (sound) {
        sound = fitter_open(&fitter, &base);
        if (sound) {
            fitter.use_all = true;
            fitter.wants_covariance = true;
            fitter_run(&fitter, &search->everything, REFINE_ROUNDS, true);
            fitter_close(&fitter);
        }
        fit_base_close(&base);
    }
    return sound;
}
