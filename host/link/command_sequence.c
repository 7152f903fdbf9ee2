#include "link/command_sequence.h"

/* Ahead of another host's by so much it is refused from then on, and we are not. */
#define LEAD 64u
#define LEAD_LEAST 16u
/* Half a turn ahead would look like behind. Before that, and a little after, for the board may not have had
 * our last ones when it heard the other, the lead is taken anew: in leaps that the board takes for steps
 * forward, even where one is lost, and the last of which is ahead of the other's command too, should that
 * have been taken. */
#define LEAD_MOST 96u
#define BEHIND_LEAST 140u
#define LEAP 60u
#define LEAPS 3u
/* A first command that is stale is behind by half a turn at most: two quarters make up for any. */
#define TURNS_MOST 2u
#define REFUSED_STEPS                                                                                        \
    150                  /* a refusal within so many control steps of what the board told last is a new one */
#define TURNED_STEPS 100 /* what was refused sooner after a turn was on its way before it */
#define OTHER_HOST_US 1000000

void command_sequence_start(struct command_sequence *sequence, uint8_t anywhere) {
    *sequence = (struct command_sequence){.last = anywhere};
}

uint8_t command_sequence_next(struct command_sequence *sequence) {
    if (sequence->leaps == 0) {
        return ++sequence->last;
    }
    const uint8_t leap = (uint8_t)(sequence->last + LEAP);
    sequence->leaps--;
    sequence->last = sequence->leaps == 0 ? sequence->landing : leap;
    return leap;
}

/* What we said before is never gone behind, or the board would take us for the stale one. */
void command_sequence_pass(struct command_sequence *sequence, uint8_t theirs, bool keeps_alive,
                           int64_t time_us) {
    const uint8_t lead = (uint8_t)(sequence->last - theirs), landing = (uint8_t)(theirs + LEAD);
    sequence->other_us = time_us;
    if (sequence->leaps > 0 || (lead >= LEAD_LEAST && lead <= LEAD_MOST)) {
        return;
    }
    if (keeps_alive && lead > LEAD_MOST && lead < BEHIND_LEAST) {
        sequence->leaps = LEAPS;
        sequence->landing = landing;
    } else {
        sequence->last = landing;
    }
}

/* Not again and again, for two hosts at once would then take turns. */
bool command_sequence_refused(struct command_sequence *sequence, uint16_t refused_step, uint16_t known_step,
                              int64_t time_us) {
    const int16_t ahead = (int16_t)(uint16_t)(refused_step - known_step);
    const bool fresh = ahead > -REFUSED_STEPS && ahead < REFUSED_STEPS;
    const bool answers_turn =
        sequence->turns == 0 || (uint16_t)(refused_step - sequence->turned_step) > TURNED_STEPS;
    if (!fresh || !answers_turn || sequence->turns >= TURNS_MOST ||
        time_us - sequence->other_us <= OTHER_HOST_US) { /* else the stale one is that host */
        return false;
    }
    sequence->turns++;
    sequence->turned_step = known_step;
    sequence->last = (uint8_t)(sequence->last + LEAD);
    return true;
}
