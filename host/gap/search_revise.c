#include "gap/search_parts.h"

#define DISBELIEVED 0.1 /* an effect that its rivals leave so little belief gives way to the best of them, .. */
#define BELIEVED 0.65   /* .. or to one that would be the verdict */
#define DOUBTED 0.65    /* a further effect that its rivals leave less is left out, if the others .. */
#define EXPLAINED_SHARE 0.03 /* .. leave no more than that of the gap by themselves */

static double belief_in_held(const struct search *search, const struct rivals *rivals) {
    const struct effect_kind *held = search->best.model.effect[rivals->place].kind;
    for (size_t i = 0; i < rivals->count; i++) {
        if (rivals->rival[i].kind == held) {
            return rivals->rival[i].belief;
        }
    }
    return 0.0;
}

/* Of two that each speak for the other under their own weights, the one that leaves less stays. */
static bool is_back(const struct search *search, const struct search_past *past, const struct rival *rival) {
    bool was_held = false;
    for (size_t i = 0; i < past->count; i++) {
        was_held = was_held || past->kind[i] == rival->kind;
    }
    return was_held && search_structure(&rival->fit) > search_structure(&search->best);
}

const struct fit *search_ask_rivals(const struct search *search, struct search_past *past) {
    const double all = search_structure(&search->recalibrated);
    for (size_t r = 0; r < search->rivals_count; r++) {
        const struct rivals *rivals = &search->rivals[r];
        const bool by_chance = search->best.model.effect[rivals->place].kind->by_chance;
        const double held = belief_in_held(search, rivals), best = rivals->rival[0].belief;
        if (!by_chance && rivals->count > 1 && (held < DISBELIEVED || (held < best && best > BELIEVED)) &&
            !is_back(search, past, &rivals->rival[0])) {
            past->kind[past->count++] = search->best.model.effect[rivals->place].kind;
            return &rivals->rival[0].fit;
        }
    }
    for (size_t r = 0; r < search->rivals_count; r++) {
        const struct rivals *rivals = &search->rivals[r];
        const bool by_chance = search->best.model.effect[rivals->place].kind->by_chance;
        if (!by_chance && rivals->rest.sound && rivals->rest.model.count > 0 &&
            belief_in_held(search, rivals) < DOUBTED &&
            search_structure(&rivals->rest) < STRUCTURE_LEAST + EXPLAINED_SHARE * all) {
            return &rivals->rest;
        }
    }
    return NULL;
}

bool search_compare_rivals(struct search *search, bool *overturned) {
    struct search_past past = {.count = 0};
    bool sound = true;
    *overturned = false;
    for (size_t round = 0;
         round <= SEARCH_REVISIONS && sound && !search_stopped(search) && search->best.model.count > 0; round++) {
        search_say(search, "rivals", round, SEARCH_REVISIONS);
        sound = rivals_find(search);
        const struct fit *asked = sound && round < SEARCH_REVISIONS ? search_ask_rivals(search, &past) : NULL;
        if (asked == NULL) {
            break;
        }
        search->best = *asked;
        *overturned = true;
        sound = search_recalibrate(search, &search->best, true);
    }
    return sound;
}
