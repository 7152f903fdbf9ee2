#include "gap/search_parts.h"

#include <math.h>

#define UNEXPLAINED_SHARE 0.1 /* of the gap, that an effect without one may leave */
#define LATE_SHARE 0.03       /* of the gap, that an effect with an onset may leave */
#define LAST_PART 0.6         /* of a run: what comes after it is the last part */

/* What the best model leaves of the gap. */
static double share_left(const struct search *search) {
    return search_structure(&search->best) / fmax(search_structure(&search->recalibrated), STRUCTURE_LEAST);
}

/* All candidates once more, from that time on; better than `least`, and the best becomes it. */
static void try_from(struct search *search, struct search_workspace *room, double onset_s,
                     struct fit *least) {
    search->onset_s = onset_s;
    search->best = search->recalibrated;
    room->singles = 0;
    if (search_add_one(search, room, 0) && search_held_out(&search->best) < search_held_out(least)) {
        *least = search->best;
    }
    search->onset_s = 0.0;
}

static void forget_blocks(struct replay *replay, size_t at, size_t blocks, size_t channels) {
    for (size_t k = 0; k < (size_t)(LAST_PART * (double)blocks) * channels; k++) {
        replay->weight[at + k] = 0.0;
    }
}

/* Until the weights are tuned again, only the last part of each run counts. */
static void look_at_last_part(struct search *search) {
    for (size_t i = 0; i < search->replay.runs; i++) {
        const struct replay_run *run = &search->replay.run[i];
        forget_blocks(&search->replay, run->pressure_at, run->blocks, 3);
        forget_blocks(&search->replay, run->supply_at, run->blocks, 1);
        forget_blocks(&search->replay, run->tip_at, run->tip_blocks, REPLAY_TIP_CHANNELS);
    }
    replay_follow(&search->coarse, &search->replay);
}

/* An effect that set in before the last part of the runs acts throughout it: there it is found as if it
 * always did. */
static bool try_last_part(struct search *search, struct search_workspace *room, struct fit *least) {
    look_at_last_part(search);
    bool sound = search_compare_again(search);
    search->best = search->recalibrated;
    room->singles = 0;
    (void)(sound && search_add_one(search, room, 0));
    sound = sound && search_recalibrate(search, &search->recalibrated, true);
    if (sound) {
        search_place_onsets(search, room, least);
    }
    return sound;
}

bool search_after_onset(struct search *search, struct search_workspace *room) {
    const struct fit before = search->best;
    const double left = share_left(search);
    const size_t trials = search->trials;
    const bool late = before.model.count > 0 && before.model.effect[0].onset_s > 0.0;
    if (left < (late ? LATE_SHARE : UNEXPLAINED_SHARE) || search_structure(&before) < STRUCTURE_LEAST ||
        search_stopped(search)) {
        return true;
    }
    bool sound = search_recalibrate(search, &search->recalibrated, true);
    struct fit least = search->recalibrated;
    if (late && sound) {
        try_from(search, room, before.model.effect[0].onset_s, &least);
    }
    sound = sound && try_last_part(search, room, &least);
    search->best = least;
    sound = sound && (least.model.count == 0 || search_recalibrate(search, &search->best, true));
    const bool earns = before.model.count > 0 || search_earns_place(search, &search->recalibrated, &search->best);
    if (!sound || least.model.count == 0 || share_left(search) > left || !earns) {
        search->best = before;
        search->trials = before.model.count > 0 ? search->trials : trials; /* of the last part alone */
        sound = sound && search_recalibrate(search, &search->best, true);
    }
    return sound;
}
