#include "board/board_record.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "log/run_log.h"

#define SUMMED_FULL_SCALE 65520.0
#define RATIO_AT_ZERO 0.1
#define RATIO_SPAN 0.8
#define CHAMBER_FULL_PA 50000.0
#define SUPPLY_FULL_PA 100000.0
#define FIRST_ROOM 16384u

static const char *const names[] = {"time_s",     "valve1",     "valve2",     "valve3",
                                    "p1_pa",      "p2_pa",      "p3_pa",      "supply_pa",
                                    "p1_true_pa", "p2_true_pa", "p3_true_pa", "bend_true_rad"};
#define COLUMNS (sizeof names / sizeof names[0])

static double *next_row(struct board_record *record) {
    if (record->rows == record->room) {
        const size_t room = record->room > 0 ? 2 * record->room : FIRST_ROOM;
        double *value = realloc(record->value, room * COLUMNS * sizeof value[0]);
        if (value == NULL) {
            record->lost = true;
            return NULL;
        }
        record->value = value;
        record->room = room;
    }
    return record->value + COLUMNS * record->rows++;
}

static double pressure_of(const struct board *board, size_t rank, double full_pa) {
    const double ratio = (double)board->adc.raw[rank] / SUMMED_FULL_SCALE;
    return board->adc.sequences > 0 ? (ratio - RATIO_AT_ZERO) / RATIO_SPAN * full_pa : NAN;
}

void board_record_row(struct board_record *record, struct board *board) {
    double *row = next_row(record);
    if (row == NULL) {
        return;
    }
    row[0] = 1e-6 * (double)board_time_us(board);
    for (uint32_t c = 0; c < 3; c++) {
        row[1 + c] = timer_duty(&board->valves_timer, c + 1u);
        row[4 + c] = pressure_of(board, c, CHAMBER_FULL_PA);
    }
    row[7] = pressure_of(board, 3, SUPPLY_FULL_PA);
    board_pressures(board, row + 8);
    row[11] = hypot(board->wiring.plant.shape.bend_x_rad, board->wiring.plant.shape.bend_y_rad);
}

bool board_record_finish(struct board_record *record, const char *path, const struct bend_table *table,
                         const char *note, char *error, size_t error_bytes) {
    char hash[32];
    (void)snprintf(hash, sizeof hash, "%016" PRIx64, table->module.inputs_hash);
    const struct run_log_pair pairs[] = {
        {"module", table->module.name}, {"table", hash}, {"rate", "1000"}, {"note", note}};
    bool written = false;
    if (record->lost) {
        (void)snprintf(error, error_bytes, "%s: not written: no memory for so long a run", path);
    } else {
        written = run_log_write_columns(path, names, record->value, record->rows, COLUMNS, pairs,
                                        sizeof pairs / sizeof pairs[0], error, error_bytes);
    }
    free(record->value);
    record->value = NULL;
    return written;
}
