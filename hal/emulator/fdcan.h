/* FDCAN1 and its message memory: the registers of a Bosch M_CAN as the STM32G4 has them, in front of a node
 * of the bus. RM0440, chapter 44. Receive FIFO 0 and 1, standard and extended filters, three transmit buffers
 * as FIFO or queue. Not modelled: transmit events, timestamps, restricted and loop-back modes, high-priority
 * messages. */
#ifndef TRIBEND_EMULATOR_FDCAN_H
#define TRIBEND_EMULATOR_FDCAN_H

#include "emulator/can_bus.h"
#include "emulator/core.h"

#define FDCAN_MEMORY_WORDS 212u
#define FDCAN_FIFO 3u

struct fdcan {
    struct core *core;
    struct can_bus *bus;
    struct can_bus_node node;
    uint32_t clock_hz;
    uint32_t memory[FDCAN_MEMORY_WORDS];
    uint32_t data_timing, control, nominal_timing, delay, interrupts, enables, line_select, lines, filters,
        transmit_config;
    uint32_t receive_fill[2], receive_get[2];
    bool receive_lost[2];
    uint32_t requests, transmitted, cancelled, transmit_interrupts, put, sending;
    uint32_t last_error, error_log;
    uint32_t plain[2]; /* TEST, RAM watchdog: kept, without effect */
    /* A frame left for, or came from, the bus. For records. */
    void (*sent)(void *context, const struct can_bus_frame *frame);
    void (*received)(void *context, const struct can_bus_frame *frame);
    void *context;
    uint32_t lost, filtered;
};

/* The peripheral of one board on one bus; then as after its reset, with another clock, and its registers. False: there is none
 * at that offset. */
void fdcan_init(struct fdcan *fdcan, struct core *core, struct can_bus *bus);
void fdcan_reset(struct fdcan *fdcan, uint32_t clock_hz);
void fdcan_clock(struct fdcan *fdcan, uint32_t clock_hz);
bool fdcan_read(void *context, uint32_t offset, uint32_t *value);
bool fdcan_write(void *context, uint32_t offset, uint32_t value);
bool fdcan_memory_read(void *context, uint32_t offset, uint32_t *value);
bool fdcan_memory_write(void *context, uint32_t offset, uint32_t value);

#endif
