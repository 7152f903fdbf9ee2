#include "compare.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MOST_INSTRUCTIONS 50000000u /* of one call; only a hang needs more */

/* --- costs --- */

static bool add_cost(struct cost *cost, uint64_t count) {
    if (cost->calls == cost->room) {
        const size_t room = cost->room == 0 ? 4096 : 2 * cost->room;
        uint64_t *counts = realloc(cost->count, room * sizeof *counts);
        if (counts == NULL) {
            return false;
        }
        cost->count = counts;
        cost->room = room;
    }
    cost->count[cost->calls++] = count;
    return true;
}

double cost_mean(const struct cost *cost) {
    double sum = 0.0;
    for (size_t i = 0; i < cost->calls; i++) {
        sum += (double)cost->count[i];
    }
    return cost->calls == 0 ? 0.0 : sum / (double)cost->calls;
}

static int by_count(const void *a, const void *b) {
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

uint64_t cost_quantile(const struct cost *cost, double share) {
    if (cost->calls == 0) {
        return 0;
    }
    qsort(cost->count, cost->calls, sizeof *cost->count, by_count);
    const size_t at = (size_t)(share * (double)(cost->calls - 1) + 0.999999);
    return cost->count[at < cost->calls ? at : cost->calls - 1];
}

/* --- the core --- */

static bool call(struct compare *compare, const char *entry, uint64_t *instructions) {
    struct call_counter *counter = compare->counter;
    const bool done =
        call_counter_write(counter, compare->frame_address, &compare->mission.frame, sizeof compare->mission.frame) &&
        call_counter_call(counter, call_counter_symbol(counter, entry), MOST_INSTRUCTIONS, instructions);
    if (!done) {
        (void)snprintf(compare->difference, sizeof compare->difference, "%s did not return after %llu instructions",
                       entry, (unsigned long long)*instructions);
    }
    return done;
}

static bool read_part(struct compare *compare, size_t offset, void *bytes, size_t size) {
    return call_counter_read(compare->counter, compare->frame_address + (uint32_t)offset, bytes, size);
}

static bool open_counter(struct compare *compare, const char *elf_path, const void *image, size_t bytes) {
    uint64_t instructions = 0;
    struct frame opened;
    compare->counter = call_counter_open(elf_path, compare->difference, sizeof compare->difference);
    if (compare->counter == NULL) {
        return false;
    }
    compare->frame_address = call_counter_symbol(compare->counter, "image_frame");
    if (bytes > FRAME_TABLE_BYTES || !call_counter_write(compare->counter, FRAME_TABLE_ADDRESS, image, bytes)) {
        (void)snprintf(compare->difference, sizeof compare->difference, "the table does not fit the board");
        return false;
    }
    return call(compare, "image_open", &instructions) && read_part(compare, 0, &opened, sizeof opened) &&
           opened.status == (uint32_t)BEND_TABLE_OK;
}

bool compare_open(struct compare *compare, const char *elf_path, const void *image, size_t bytes,
                  enum frame_variant variant, uint64_t seed) {
    memset(compare, 0, sizeof *compare);
    if (!mission_open(&compare->mission, image, bytes, variant, seed)) {
        (void)snprintf(compare->difference, sizeof compare->difference, "%s",
                       bend_table_status_text((enum bend_table_status)compare->mission.frame.status));
        return false;
    }
    return open_counter(compare, elf_path, image, bytes);
}

void compare_close(struct compare *compare) {
    call_counter_close(compare->counter);
    free(compare->step.count);
    free(compare->inversion_step.count);
    free(compare->inversion.count);
}

bool compare_steps(struct compare *compare, uint32_t steps) {
    for (uint32_t i = 0; i < steps; i++) {
        struct mission *mission = &compare->mission;
        struct frame_output output;
        uint64_t instructions = 0;
        mission_read(mission);
        if (!call(compare, "image_step", &instructions) || !add_cost(&compare->step, instructions) ||
            !read_part(compare, offsetof(struct frame, output), &output, sizeof output)) {
            return false;
        }
        mission_step(mission);
        compare->active += mission->frame.output.state == (uint32_t)SUPERVISOR_ACTIVE ? 1u : 0u;
        if (memcmp(&output, &mission->frame.output, sizeof output) != 0) {
            (void)snprintf(compare->difference, sizeof compare->difference,
                           "step %u: target 1 %.9g Pa on the board, %.9g Pa on the host; state %u and %u",
                           mission->step, (double)output.target_pa[0], (double)mission->frame.output.target_pa[0],
                           (unsigned)output.state, (unsigned)mission->frame.output.state);
            return false;
        }
    }
    return true;
}

static bool invert_once(struct compare *compare, bool first, uint64_t *instructions) {
    struct frame_inversion *host = &compare->mission.frame.inversion, board;
    if (!call(compare, first ? "image_begin" : "image_invert", instructions) ||
        !read_part(compare, offsetof(struct frame, inversion), &board, sizeof board)) {
        return false;
    }
    if (first) {
        frame_app_begin(&compare->mission.board);
    } else {
        frame_app_invert(&compare->mission.board);
    }
    if (memcmp(&board, host, sizeof board) != 0) {
        (void)snprintf(compare->difference, sizeof compare->difference,
                       "(%.9g, %.9g) rad over %.9g Pa: chamber 1 gets %.9g Pa on the board, %.9g Pa on the host",
                       (double)host->bend_rad[0], (double)host->bend_rad[1], (double)host->co_contraction_pa,
                       (double)board.preview_pa[0], (double)host->preview_pa[0]);
        return false;
    }
    return add_cost(&compare->inversion_step, *instructions);
}

/* How far the preview is from what was wanted. */
static double preview_residual(const struct compare *compare) {
    const struct bend_table *table = compare->mission.table;
    const struct frame_inversion *inversion = &compare->mission.frame.inversion;
    struct bend_table_stencil stencil;
    bend_table_locate(table, inversion->preview_pa, &stencil);
    const double length_m = (double)table->module.active_length_m;
    const double x = length_m * (double)bend_table_value(table, &stencil, BEND_TABLE_CURVATURE_X);
    const double y = length_m * (double)bend_table_value(table, &stencil, BEND_TABLE_CURVATURE_Y);
    return hypot(x - (double)inversion->bend_rad[0], y - (double)inversion->bend_rad[1]);
}

bool compare_inversions(struct compare *compare, uint32_t inversions) {
    for (uint32_t i = 0; i < inversions; i++) {
        struct frame_inversion *inversion = &compare->mission.frame.inversion;
        uint64_t used = 0, all = 0;
        mission_inversion(&compare->mission, inversion);
        double preview_rad[2] = {NAN, NAN};
        bool same = invert_once(compare, true, &used);
        for (uint32_t step = 0u; same && inversion->done == 0u; step++) {
            if (step < 2u && inversion->previews != 0u) {
                preview_rad[step] = preview_residual(compare);
            }
            all += used;
            same = invert_once(compare, false, &used);
        }
        if (!same || !add_cost(&compare->inversion, all + used)) {
            return false;
        }
        for (uint32_t step = 0u; step < 2u && inversion->flags == 0u; step++) {
            compare->preview_rad[step] = fmax(compare->preview_rad[step], preview_rad[step]);
        }
    }
    return true;
}
