/* The number that each command of a host begins with, so that the board can tell a stale one: it takes what
 * is ahead of the last it took by less than half a turn of 256, from whichever host. Ours keeps ahead of
 * another host's, whose commands are then the stale ones. Not here: when a command is sent (can_link.c), what
 * the board refuses (firmware/comms/node.c). */
#ifndef TRIBEND_COMMAND_SEQUENCE_H
#define TRIBEND_COMMAND_SEQUENCE_H

#include <stdbool.h>
#include <stdint.h>

struct command_sequence {
    uint8_t last;         /* the next one is one more */
    uint8_t landing;      /* the last one once no leap is left */
    uint32_t leaps;       /* that the next ones still make: send as many heartbeats at once */
    uint32_t turns;       /* for what the board called stale */
    uint16_t turned_step; /* of the board, when it was last heard before that */
    int64_t other_us;     /* when another host last commanded our board; 0: none did */
};

/* Start anywhere: the board is not asked. */
void command_sequence_start(struct command_sequence *sequence, uint8_t anywhere);
/* For the next command. */
uint8_t command_sequence_next(struct command_sequence *sequence);
/* Another host's command to our board began with `theirs`: the next of ours is ahead of it, and so is all
 * that we keep alive. Leaps may be due after it. */
void command_sequence_pass(struct command_sequence *sequence, uint8_t theirs, bool keeps_alive,
                           int64_t time_us);
/* The board called a command stale in its control step `refused_step`, and told `known_step` last. True: it
 * was ours, of a host that it does not know yet, and the next one is further on. */
bool command_sequence_refused(struct command_sequence *sequence, uint16_t refused_step, uint16_t known_step,
                              int64_t time_us);

#endif
