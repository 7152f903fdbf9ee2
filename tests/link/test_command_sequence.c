/* Two hosts and a board in virtual time: one takes over what the other began, from any place of its sequence, over
 * links of any delay and with a frame lost. The board's rule is written again here, in the words of
 * docs/messages.md. */
#include "link/command_sequence.h"

#include "support/test.h"

#define END_MS 4000
#define TIMEOUT_MS 500
#define REPEAT_MS 20
#define HEARTBEAT_MS 50
#define REPORT_MS 5
#define DELAY_MOST_MS 64

struct board {
    uint8_t taken;
    uint32_t refused_ms; /* of the last that it called stale; 0: none */
};

static bool takes(struct board *board, uint8_t number, uint32_t time_ms) {
    const uint8_t ahead = (uint8_t)(number - board->taken);
    if (ahead == 0 || ahead >= 128) {
        board->refused_ms = time_ms;
        return false;
    }
    board->taken = number;
    return true;
}

struct scene {
    uint8_t ours, theirs;       /* where both begin; the board has taken `theirs` */
    uint32_t delay_ms;          /* each way */
    uint32_t pause_ms, from_ms; /* between the other's commands, and the first */
    uint32_t lost;              /* our frame of that number; 0: none */
};

struct outcome {
    uint32_t first_ms, longest_ms; /* until ours was first taken; without any of ours after that */
    uint32_t others_ms;            /* in which the other's command stood after ours was first taken */
};

struct wire {
    struct {
        uint32_t due_ms;
        uint8_t number;
        bool holds;
    } frame[512];
    uint32_t in, out, sent;
};

static void put(struct wire *wire, const struct scene *scene, struct command_sequence *sequence,
                uint32_t time_ms, bool holds) {
    const uint8_t number = command_sequence_next(sequence);
    if (++wire->sent != scene->lost) {
        wire->frame[wire->in].due_ms = time_ms + scene->delay_ms;
        wire->frame[wire->in].number = number;
        wire->frame[wire->in++].holds = holds;
    }
}

static struct outcome fly(const struct scene *scene) {
    struct command_sequence sequence;
    struct board board = {.taken = scene->theirs};
    struct wire wire = {.in = 0};
    struct outcome outcome = {.first_ms = END_MS};
    uint8_t theirs = scene->theirs, heard[END_MS + DELAY_MOST_MS];
    bool spoke[END_MS + DELAY_MOST_MS] = {false}, held[END_MS] = {false}, holds = false;
    uint32_t refused[END_MS] = {0}, times = 0, repeat_ms = 0, heartbeat_ms = HEARTBEAT_MS, taken_ms = 0,
             told_ms = 0;
    command_sequence_start(&sequence, scene->ours);
    for (uint32_t t = 0; t < END_MS; t++) {
        /* the board */
        while (wire.out < wire.in && wire.frame[wire.out].due_ms <= t) {
            if (takes(&board, wire.frame[wire.out].number, t + 1)) {
                outcome.first_ms = outcome.first_ms == END_MS ? t : outcome.first_ms;
                outcome.longest_ms =
                    taken_ms > 0 && t - taken_ms > outcome.longest_ms ? t - taken_ms : outcome.longest_ms;
                taken_ms = t;
                holds = holds || wire.frame[wire.out].holds;
            }
            wire.out++;
        }
        if (t >= scene->from_ms && (t - scene->from_ms) % scene->pause_ms == 0) {
            holds = takes(&board, ++theirs, t + 1) ? false : holds;
            spoke[t + scene->delay_ms] = true;
            heard[t + scene->delay_ms] = theirs;
        }
        held[t] = holds;
        refused[t] = board.refused_ms;
        outcome.others_ms += outcome.first_ms < t && !holds ? 1u : 0u;
        /* we, who see it later */
        if (spoke[t]) {
            command_sequence_pass(&sequence, heard[t], true, 1000 * (int64_t)t + 2000000);
            while (sequence.leaps > 0) {
                put(&wire, scene, &sequence, t, false);
            }
        }
        if (t >= scene->delay_ms && t % REPORT_MS == 0) {
            const uint32_t then = t - scene->delay_ms;
            if (refused[then] > told_ms) {
                told_ms = refused[then];
                if (command_sequence_refused(&sequence, (uint16_t)told_ms, (uint16_t)then,
                                             1000 * (int64_t)t + 2000000)) {
                    repeat_ms = t;
                }
            }
        }
        const bool seen = t >= scene->delay_ms && held[t - scene->delay_ms];
        if ((times < 3 || !seen) && t >= repeat_ms) {
            put(&wire, scene, &sequence, t, true);
            times++;
            repeat_ms = t + REPEAT_MS;
            heartbeat_ms = t + HEARTBEAT_MS;
        } else if (t >= heartbeat_ms) {
            put(&wire, scene, &sequence, t, false);
            heartbeat_ms = t + HEARTBEAT_MS;
        }
        assert_true(wire.in + 8 < sizeof wire.frame / sizeof wire.frame[0]);
    }
    outcome.longest_ms = END_MS - taken_ms > outcome.longest_ms ? END_MS - taken_ms : outcome.longest_ms;
    return outcome;
}

static void check(const struct scene *scene) {
    const struct outcome outcome = fly(scene);
    if (outcome.first_ms >= TIMEOUT_MS || outcome.longest_ms >= TIMEOUT_MS ||
        outcome.others_ms >= TIMEOUT_MS) {
        fail_msg("ours from %u, theirs from %u every %u ms from %u ms on, %u ms of delay, frame %u lost: "
                 "taken first after "
                 "%u ms, then up to %u ms without, %u ms under the other's command",
                 scene->ours, scene->theirs, scene->pause_ms, scene->from_ms, scene->delay_ms, scene->lost,
                 outcome.first_ms, outcome.longest_ms, outcome.others_ms);
    }
}

static void a_host_that_takes_over_stays_ahead(void **state) {
    (void)state;
    static const uint32_t delays_ms[] = {1, 9, 30, 60}, pauses_ms[] = {20, 200, 330};
    for (uint32_t d = 0; d < 4; d++) {
        for (uint32_t p = 0; p < 3; p++) {
            for (uint32_t from = 0; from < 4; from++) {
                for (uint32_t ours = 0; ours < 256; ours++) {
                    const struct scene scene = {.ours = (uint8_t)ours,
                                                .theirs = 77,
                                                .delay_ms = delays_ms[d],
                                                .pause_ms = pauses_ms[p],
                                                .from_ms = from * pauses_ms[p] / 3};
                    check(&scene);
                }
            }
        }
    }
}

static void a_lost_frame_does_not_leave_it_behind(void **state) {
    (void)state;
    for (uint32_t lost = 1; lost < 100; lost++) {
        for (uint32_t ours = 0; ours < 256; ours += 5) {
            const struct scene scene = {.ours = (uint8_t)ours,
                                        .theirs = 77,
                                        .delay_ms = 3,
                                        .pause_ms = 250,
                                        .from_ms = 100,
                                        .lost = lost};
            check(&scene);
        }
    }
}

/* Refusals of what was on its way count once, and half a turn is all that can be missing. */
static void a_host_alone_turns_at_most_twice(void **state) {
    (void)state;
    struct command_sequence sequence;
    command_sequence_start(&sequence, 10);
    assert_true(command_sequence_refused(&sequence, 1000, 990, 5000000));
    assert_false(command_sequence_refused(&sequence, 1020, 1025, 5030000)); /* was on its way */
    assert_true(command_sequence_refused(&sequence, 1120, 1110, 5130000));
    assert_false(command_sequence_refused(&sequence, 1400, 1390, 5400000));
    assert_int_equal(command_sequence_next(&sequence), 10 + 2 * 64 + 1);
}

static void an_old_refusal_is_not_ours(void **state) {
    (void)state;
    struct command_sequence sequence;
    command_sequence_start(&sequence, 10);
    assert_false(command_sequence_refused(&sequence, 1000, 1151, 5000000));
    command_sequence_pass(&sequence, 250, false, 5000000);
    assert_false(command_sequence_refused(&sequence, 1200, 1201, 5500000)); /* the other host's */
    assert_int_equal(command_sequence_next(&sequence), 11);                 /* 17 ahead already */
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_host_that_takes_over_stays_ahead),
        cmocka_unit_test(a_lost_frame_does_not_leave_it_behind),
        cmocka_unit_test(a_host_alone_turns_at_most_twice),
        cmocka_unit_test(an_old_refusal_is_not_ours),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
