/* A run log of the emulated board: what its sensors show and its outputs do, a row a millisecond, and the
 * true pressures and bend in columns of their own (p1_true_pa .., bend_true_rad, anew with each tip sample).
 * In memory until it is written. */
#ifndef TRIBEND_BOARD_RECORD_H
#define TRIBEND_BOARD_RECORD_H

#include "emulator/board.h"

struct board_record {
    double *value;
    size_t rows, room;
    bool lost; /* no memory: the rest is missing */
};

void board_record_row(struct board_record *record, struct board *board);
/* False: `error` says why. Frees the rows. */
bool board_record_finish(struct board_record *record, const char *path, const struct bend_table *table,
                         const char *note, char *error, size_t error_bytes);

#endif
