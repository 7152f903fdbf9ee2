/* What many trials come to: a row an injection, and what was wrong in any of them. Adding is in the trials' order, so the
 * tally does not depend on who ran them. */
#ifndef TRIBEND_TALLY_H
#define TRIBEND_TALLY_H

#include <stdio.h>

#include "campaign/trial.h"

#define TALLY_OVER_MOST_US 50000
#define TALLY_LEFT_OPEN_MOST_US 2000
#define TALLY_REFUSED_MOST_US 25000 /* outputs that cannot be written: the watchdog's time */

enum tally_wrong {
    TALLY_FALSE_ALARM = 1u << 0,
    TALLY_BURST = 1u << 1,
    TALLY_OVER_WORKING = 1u << 2, /* for longer than TALLY_OVER_MOST_US; of single faults */
    TALLY_UNSEEN = 1u << 3,
    TALLY_LEFT_OPEN = 1u << 4     /* a fault was latched, and air might flow */
};

struct tally_row {
    size_t trials;
    size_t end[TRIAL_END_COUNT];
    size_t vented;       /* of those that latched, and nobody cleared */
    size_t never_vented;
    double highest_pa;
    int64_t over_longest_us;
    double apart_pa;     /* the most, of the harmless */
    size_t wrong[5];     /* trials with each of enum tally_wrong */
    int64_t *seen_us;    /* of each trial that was seen, */
    size_t seen;
    int64_t *vent_us;    /* and vented */
};

/* Bits of enum tally_wrong. */
uint32_t tally_judge(const struct trial *trial, const struct trial_result *result);
/* `trials` is how many may be added. False: no memory. */
bool tally_row_open(struct tally_row *row, size_t trials);
void tally_row_close(struct tally_row *row);
void tally_row_add(struct tally_row *row, const struct trial *trial, const struct trial_result *result);
void tally_print_head(FILE *file);
void tally_print_row(FILE *file, const char *name, struct tally_row *row);
/* The names of what is wrong, for people. */
void tally_print_wrong(FILE *file, uint32_t wrong);

#endif
