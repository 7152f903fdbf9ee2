#include "gap/search_parts.h"

/* Each pair of the best alone, from where each ended alone. */
static size_t pair_up(struct fit *const *single, size_t singles, struct fit *pairs) {
    size_t count = 0;
    for (size_t i = 0; i < singles; i++) {
        for (size_t j = i + 1; j < singles; j++) {
            const struct effect *other = &single[j]->model.effect[0];
            const bool whole = single[i]->model.count > 1 || single[j]->model.count > 1;
            if (!whole && !gap_model_has(&single[i]->model, other->kind, other->form, other->chamber)) {
                pairs[count] = (struct fit){.model = single[i]->model};
                gap_model_add(&pairs[count].model, other);
                count++;
            }
        }
    }
    return count;
}

bool search_add_one(struct search *search, struct search_workspace *room, size_t step) {
    struct fit_base base;
    struct search_crew crew = {NULL, 0};
    struct fit next = search->best;
    bool found = false;
    if (fit_base_open(&base, &search->replay, &search->coarse, &search->best.model) &&
        search_crew_open(&crew, search, &base)) {
        size_t count = search_screen(search, &crew, &search->best.model, room->list, room->candidates,
                                     room->fits, room->order);
        count = search_choose(room->order, count);
        search_refine(search, &crew, room->order, count, step);
        for (size_t i = 0; i < count && !found; i++) {
            found = search_earns_place(search, &search->best, room->order[i]);
            for (size_t j = 0; j < i && found; j++) {
                found = !search_is_forestalled(search, &search->best, room->order[i], room->order[j]);
            }
            next = found ? *room->order[i] : next;
        }
        for (size_t i = 0; step == 0 && i < count && i < PAIRED_MAX; i++) {
            room->single[room->singles++] = *room->order[i];
        }
        if (step == 1 && room->singles > 1) {
            struct fit *singles[PAIRED_MAX];
            for (size_t i = 0; i < room->singles; i++) {
                singles[i] = &room->single[i];
            }
            const size_t pairs = pair_up(singles, room->singles, room->pairs);
            for (size_t i = 0; i < pairs; i++) {
                room->pair_order[i] = &room->pairs[i];
            }
            search_say(search, "pairs", 0, pairs);
            search_refine(search, &crew, room->pair_order, pairs, step);
            if (pairs > 0 && search_held_out(room->pair_order[0]) < search_held_out(&next) &&
                search_earns_place(search, &search->best, room->pair_order[0])) {
                next = *room->pair_order[0];
                found = true;
            }
        }
        if (found && search_is_structured(&next) && !search_stopped(search)) {
            search_find_onsets(search, &crew, &next);
        }
    }
    search_crew_close(&crew);
    fit_base_close(&base);
    search->best = next;
    return found;
}
