/* The emulated NUCLEO-G474RE with its plant: load the ELF that is flashed, let virtual time pass, talk CAN,
 * look at the truth, put faults in. All else in this folder is a part of it.
 *
 * Deterministic: the same ELF, seed and calls give the same bits. Time is in us since power-on; the
 * firmware's own starts some milliseconds later. */
#ifndef TRIBEND_EMULATOR_BOARD_H
#define TRIBEND_EMULATOR_BOARD_H

#include "emulator/adc.h"
#include "emulator/can_bus.h"
#include "emulator/can_host.h"
#include "emulator/core.h"
#include "emulator/fdcan.h"
#include "emulator/flash.h"
#include "emulator/gpio.h"
#include "emulator/power.h"
#include "emulator/rcc.h"
#include "emulator/timer.h"
#include "emulator/usart.h"
#include "emulator/watchdog.h"
#include "emulator/wiring.h"

#define BOARD_PATH_BYTES 512u

struct board_setup {
    const char *elf;                /* path */
    const struct bend_table *table; /* of the module that hangs on the board; kept by pointer */
    struct wiring_parameters wiring;
    wiring_encode encode; /* NULL: no tip sensor is connected */
    uint64_t seed;
};

/* Registers that no peripheral here has, or whose clock is off: a firmware that uses them is not emulated
 * whole. */
struct board_oddities {
    uint32_t unknown;
    uint32_t unclocked;
    uint32_t first_unknown; /* address; 0: none */
    uint32_t first_unclocked;
};

struct board {
    struct core core;
    struct rcc rcc;
    struct power power;
    struct flash flash;
    struct gpio gpio[GPIO_PORTS];
    struct timer valves_timer, microseconds, tick; /* TIM1, TIM2, TIM3 */
    struct adc adc;
    struct usart usart;
    struct watchdog watchdog;
    struct can_bus bus;
    struct fdcan fdcan;
    struct can_host host; /* the script's or socket's own node */
    struct wiring wiring;
    struct board_oddities oddities;
    uint32_t resets;      /* after the first start */
    uint32_t reset_cause; /* asked for */
    uint32_t last_cause;  /* of the last start */
    bool power_lost;      /* by a cut within a flash operation */
    char elf[BOARD_PATH_BYTES];
};

/* The nominal module and sensors on `table`. */
void board_default_setup(struct board_setup *setup, const char *elf, const struct bend_table *table);
/* Powered on, at time 0. False: `error` says why. */
bool board_open(struct board *board, const struct board_setup *setup, char *error, size_t error_bytes);
void board_close(struct board *board);
/* Let so much time pass. Ends early, with power_lost set, when a flash operation is cut. */
void board_run(struct board *board, int64_t duration_us);
int64_t board_time_us(const struct board *board);
/* True chamber pressures. */
void board_pressures(struct board *board, double pressure_pa[3]);
bool board_add_effect(struct board *board, const struct effect *effect);

/* The script's CAN node. */
bool board_send(struct board *board, const struct hal_can_frame *frame);
bool board_receive(struct board *board, struct can_host_heard *heard);

/* The electronics' supply; 3.3 V at first. Under 2.8 V the board is held in reset. */
void board_supply(struct board *board, double volts);
void board_crystal(struct board *board, bool works);
/* Power fails within the flash operation of that number from now, 1 being the next; `random` chooses what is
 * left behind. */
void board_cut_power(struct board *board, uint32_t operation, uint64_t random);
/* Off and on again: RAM is lost, flash is as it was left. */
bool board_power_cycle(struct board *board);
/* The reset button. */
void board_press_reset(struct board *board);
/* Address of a symbol of the ELF file. */
bool board_symbol(const struct board *board, const char *name, uint32_t *address);
/* Call `action` whenever the program enters this function. False: no such symbol, or no room. */
bool board_probe(struct board *board, const char *function, core_probe_action action, void *context);
/* From now on the function does nothing but jump to itself. */
bool board_hang(struct board *board, const char *function);
/* Anything that the emulation let pass, in words; false: nothing. */
bool board_describe_oddities(const struct board *board, char *text, size_t bytes);

#endif
