/* The emulated board of the campaign: the ELF that is flashed, commanded and heard over its CAN bus. What a trial injects is put
 * into a simulated board that never runs, and from there onto the emulated one's pins, wires, supplies and memory. */
#ifndef TRIBEND_CAMPAIGN_EMULATED_H
#define TRIBEND_CAMPAIGN_EMULATED_H

#include "campaign/vehicle.h"
#include "comms/codec.h"
#include "emulator/board.h"

struct emulated {
    const char *elf;
    const struct bend_table *plant_table;
    struct bench shadow; /* injections change it, nothing steps it */
    struct board board;
    struct message_status status; /* as last heard */
    uint8_t sequence;
    uint32_t resets; /* that have been seen to */
    bool crashes;
    uint32_t late_every; /* ms; 0: none */
    int64_t ms, bus_ms, supply_ms; /* when wires and supply are mended; -1: sound */
    int64_t open_ms; /* for so long air might flow */
};

/* `table` and `image` are the shadow's, `plant_table` the plant's. False: the ELF cannot be run, and why. */
bool emulated_open(struct emulated *emulated, const char *elf, const struct bend_table *plant_table,
                   const struct bend_table *table, uint8_t *image, char *error, size_t error_bytes);
void emulated_vehicle(struct emulated *emulated, struct vehicle *vehicle);
/* Why an injection cannot be put into the emulated board, or NULL. */
const char *emulated_left_out(const struct injection *injection);

#endif
