#include "blind_effect.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ONSET_RISE_S 0.2

static const struct blind_kinds *const catalogue[] = {&blind_valve_kinds, &blind_pressure_kinds, &blind_body_kinds,
                                                      &blind_tip_kinds};
#define STAGES (sizeof catalogue / sizeof catalogue[0])

size_t blind_catalogue_count(void) {
    size_t count = 0;
    for (size_t s = 0; s < STAGES; s++) {
        count += catalogue[s]->count;
    }
    return count;
}

const struct blind_effect_kind *blind_catalogue_at(size_t index) {
    size_t s = 0;
    for (; index >= catalogue[s]->count; s++) {
        index -= catalogue[s]->count;
    }
    return &catalogue[s]->kind[index];
}

size_t blind_outside_count(void) {
    return blind_outside_kinds.count;
}

const struct blind_effect_kind *blind_outside_at(size_t index) {
    return &blind_outside_kinds.kind[index];
}

const struct blind_effect_kind *blind_kind_find(const char *name) {
    const size_t known = blind_catalogue_count(), outside = blind_outside_count();
    for (size_t i = 0; i < known + outside; i++) {
        const struct blind_effect_kind *kind = i < known ? blind_catalogue_at(i) : blind_outside_at(i - known);
        if (strcmp(kind->name, name) == 0) {
            return kind;
        }
    }
    return NULL;
}

void blind_effect_reset(struct blind_effect *effect, uint64_t seed) {
    memset(effect->memory, 0, sizeof effect->memory);
    effect->history_count = 0;
    blind_random_open(&effect->random, seed, effect->kind->name, 0);
}

void blind_effect_free(struct blind_effect *effect) {
    free(effect->history);
    effect->history = NULL;
    effect->history_room = 0;
}

void blind_effect_draw(struct blind_effect *effect, const struct blind_effect_kind *kind, struct blind_random *random,
                       const struct blind_scene *scene) {
    memset(effect, 0, sizeof *effect);
    effect->kind = kind;
    if (kind->reach == BLIND_ONE_CHAMBER) {
        effect->chamber = 1 + (int)blind_below(random, 3);
    }
    kind->draw(effect, random, scene);
}

void blind_effect_weaken(struct blind_effect *effect, double share) {
    for (size_t i = 0; i < BLIND_PARAMETERS_MAX; i++) {
        const double neutral = effect->kind->neutral[i];
        if (effect->kind->parameter[i] != NULL && !isnan(neutral)) {
            effect->parameter[i] = neutral + share * (effect->parameter[i] - neutral);
        }
    }
}

double blind_effect_gate(const struct blind_effect *effect, double time_s) {
    if (!(effect->onset_s > 0.0)) {
        return 1.0;
    }
    const double share = fmin(fmax((time_s - effect->onset_s) / ONSET_RISE_S, 0.0), 1.0);
    return share * share * (3.0 - 2.0 * share);
}

bool blind_effect_on(const struct blind_effect *effect, size_t c) {
    return effect->chamber == 0 || effect->chamber == (int)c + 1;
}

bool blind_effect_remember(struct blind_effect *effect, double value) {
    if (effect->history_count == effect->history_room) {
        const size_t room = effect->history_room == 0 ? 4096 : 2 * effect->history_room;
        double *larger = realloc(effect->history, room * sizeof *larger);
        if (larger == NULL) {
            return false;
        }
        effect->history = larger;
        effect->history_room = room;
    }
    effect->history[effect->history_count++] = value;
    return true;
}
