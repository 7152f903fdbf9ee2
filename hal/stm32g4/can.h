/* FDCAN1 behind struct hal_bus: classic and FD frames, filters in hardware, recovery from bus-off. */
#ifndef TRIBEND_STM32G4_CAN_H
#define TRIBEND_STM32G4_CAN_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"

/* Standard identifiers that are taken: those that equal `id` in the bits set in `mask`. All others cost
 * nothing. */
struct can_filter {
    uint16_t id;
    uint16_t mask;
};

#define CAN_FILTERS_MOST 8u

struct can_settings {
    uint32_t bit_rate;      /* 1/s */
    uint32_t data_bit_rate; /* of FD frames' data */
    bool fd;                /* false: classic frames alone; an FD frame on the bus is then an error */
    uint32_t filters;
    struct can_filter filter[CAN_FILTERS_MOST];
};

#define CAN_RECOVERY_US 100000

/* On the bus, or false: no such rate from this clock, or the controller does not answer. A data rate that
 * cannot be had leaves FD frames out. Binds `bus` either way. */
bool can_start(uint32_t clock_hz, const struct can_settings *settings, struct hal_bus *bus);
/* Once a step: returns to the bus CAN_RECOVERY_US after bus-off. */
void can_step(int64_t time_us);

#endif
