#include "emulator/board.h"

#include <stdio.h>
#include <string.h>

#include "emulator/elf_image.h"

#define UNIQUE_ID 0x590u
#define REFERENCE_CALIBRATION 0x5aau
#define FLASH_KIB 0x5e0u
#define VREFINT_AT_3V 1654u /* 1.212 V of 3.0 V in 12 bits */

/* --- the peripherals' place in memory --- */

enum gate { GATE_AHB1, GATE_AHB2, GATE_APB1_1, GATE_APB1_2, GATE_APB2, GATE_NONE };

struct place {
    uint32_t base, bytes;
    enum gate gate;
    uint32_t gate_bit;
    bool (*read)(void *context, uint32_t offset, uint32_t *value);
    bool (*write)(void *context, uint32_t offset, uint32_t value);
    size_t context; /* offset of its state in struct board */
};

#define AT(member) offsetof(struct board, member)
static const struct place places[] = {
    {0x40000000u, 0x400u, GATE_APB1_1, 0u, timer_read, timer_write, AT(microseconds)},
    {0x40000400u, 0x400u, GATE_APB1_1, 1u, timer_read, timer_write, AT(tick)},
    {0x40012c00u, 0x400u, GATE_APB2, 11u, timer_read, timer_write, AT(valves_timer)},
    {0x48000000u, 0x400u, GATE_AHB2, 0u, gpio_read, gpio_write, AT(gpio[0])},
    {0x48000400u, 0x400u, GATE_AHB2, 1u, gpio_read, gpio_write, AT(gpio[1])},
    {0x48000800u, 0x400u, GATE_AHB2, 2u, gpio_read, gpio_write, AT(gpio[2])},
    {0x40004800u, 0x400u, GATE_APB1_1, 18u, usart_read, usart_write, AT(usart)},
    {0x40006400u, 0x400u, GATE_APB1_1, 25u, fdcan_read, fdcan_write, AT(fdcan)},
    {0x4000a400u, 0x400u, GATE_APB1_1, 25u, fdcan_memory_read, fdcan_memory_write, AT(fdcan)},
    {0x50000000u, 0x100u, GATE_AHB2, 13u, adc_read, adc_write, AT(adc)},
    {0x50000300u, 0x10u, GATE_AHB2, 13u, adc_common_read, adc_common_write, AT(adc)},
    {0x40020000u, 0x18u, GATE_AHB1, 0u, adc_dma_read, adc_dma_write, AT(adc)},
    {0x40020800u, 0x4u, GATE_AHB1, 2u, adc_mux_read, adc_mux_write, AT(adc)},
    {RCC_BASE, 0x400u, GATE_NONE, 0u, rcc_read, rcc_write, AT(rcc)},
    {0x40007000u, 0x400u, GATE_APB1_1, 28u, power_read, power_write, AT(power)},
    {0x40010000u, 0x30u, GATE_APB2, 0u, power_syscfg_read, power_syscfg_write, AT(power)},
    {0x40010400u, 0x400u, GATE_NONE, 0u, power_exti_read, power_exti_write, AT(power)},
    {0x40022000u, 0x400u, GATE_NONE, 0u, flash_read, flash_write, AT(flash)},
    {0x40003000u, 0x400u, GATE_NONE, 0u, watchdog_read, watchdog_write, AT(watchdog)},
};

static const struct place *find(uint32_t address) {
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
        if (address >= places[i].base && address - places[i].base < places[i].bytes) {
            return &places[i];
        }
    }
    return NULL;
}

static bool is_clocked(const struct board *board, const struct place *place) {
    return place->gate == GATE_NONE || (board->rcc.gates[place->gate] >> place->gate_bit & 1u) != 0;
}

static void note_unknown(struct board *board, uint32_t address) {
    board->oddities.unknown++;
    board->oddities.first_unknown =
        board->oddities.first_unknown != 0 ? board->oddities.first_unknown : address;
}

static void note_unclocked(struct board *board, uint32_t address) {
    board->oddities.unclocked++;
    board->oddities.first_unclocked =
        board->oddities.first_unclocked != 0 ? board->oddities.first_unclocked : address;
}

static uint32_t read_word(void *context, uint32_t address) {
    struct board *board = context;
    const struct place *place = find(address);
    uint32_t value = 0;
    schedule_run(&board->core.schedule, board->core.now_ticks);
    if (place != NULL && !is_clocked(board, place)) {
        note_unclocked(board, address);
    } else if (place == NULL || !place->read((char *)board + place->context, address - place->base, &value)) {
        note_unknown(board, address);
    }
    return value;
}

static void write_word(void *context, uint32_t address, uint32_t value) {
    struct board *board = context;
    const struct place *place = find(address);
    schedule_run(&board->core.schedule, board->core.now_ticks);
    if (place != NULL && !is_clocked(board, place)) {
        note_unclocked(board, address);
    } else if (place == NULL || !place->write((char *)board + place->context, address - place->base, value)) {
        note_unknown(board, address);
    }
}

/* --- what peripherals tell each other --- */

static void clocks_changing(void *context) {
    struct board *board = context;
    timer_before_clock(&board->valves_timer);
    timer_before_clock(&board->microseconds);
    timer_before_clock(&board->tick);
}

static void clocks_changed(void *context) {
    struct board *board = context;
    timer_after_clock(&board->valves_timer, rcc_timer_hz(&board->rcc, true));
    timer_after_clock(&board->microseconds, rcc_timer_hz(&board->rcc, false));
    timer_after_clock(&board->tick, rcc_timer_hz(&board->rcc, false));
    adc_clock(&board->adc, board->rcc.core_hz);
    usart_clock(&board->usart, board->rcc.apb1_hz);
    fdcan_clock(&board->fdcan, rcc_fdcan_hz(&board->rcc));
}

static void break_valves(void *context) {
    timer_break(&((struct board *)context)->valves_timer);
}

static void range_changed(void *context) {
    struct board *board = context;
    board->rcc.boost = power_is_boosted(&board->power);
}

static void wait_states_changed(void *context) {
    struct board *board = context;
    board->rcc.flash_wait_states = flash_wait_states(&board->flash);
}

static void start_conversions(void *context, int64_t at_ticks) {
    (void)at_ticks;
    adc_trigger(&((struct board *)context)->adc);
}

static void request_reset(struct board *board, uint32_t cause) {
    board->reset_cause |= cause;
    board->core.nvic.reset_requested = true;
    core_attend(&board->core);
}

static void watchdog_bites(void *context) {
    request_reset(context, RCC_RESET_WATCHDOG);
}

static void power_lost(void *context) {
    struct board *board = context;
    board->power_lost = true;
    request_reset(board, 0u);
}

static void core_locked_up(void *context) {
    power_lock_up(&((struct board *)context)->power);
}

static void store_to_flash(void *context, uint32_t address, uint32_t value, uint32_t bytes) {
    flash_store(&((struct board *)context)->flash, address, value, bytes);
}

static void load_from_flash(void *context, uint32_t address) {
    flash_read_broken(&((struct board *)context)->flash, address);
}

/* --- reset --- */

static void reset(struct board *board, uint32_t cause) {
    board->last_cause = cause;
    core_reset(&board->core);
    power_reset(&board->power);
    flash_reset(&board->flash);
    board->rcc.boost = false;
    board->rcc.flash_wait_states = 0u;
    rcc_reset(&board->rcc, cause);
    for (uint32_t p = 0; p < GPIO_PORTS; p++) {
        gpio_reset(&board->gpio[p], p);
    }
    timer_reset(&board->valves_timer, rcc_timer_hz(&board->rcc, true));
    timer_reset(&board->microseconds, rcc_timer_hz(&board->rcc, false));
    timer_reset(&board->tick, rcc_timer_hz(&board->rcc, false));
    adc_reset(&board->adc, board->rcc.core_hz);
    usart_reset(&board->usart, board->rcc.apb1_hz);
    fdcan_reset(&board->fdcan, rcc_fdcan_hz(&board->rcc));
    watchdog_reset(&board->watchdog);
    board->core.held = power_is_out(&board->power);
}

static void take_reset(struct board *board) {
    const uint32_t cause = board->reset_cause != 0u ? board->reset_cause : RCC_RESET_SOFTWARE;
    board->reset_cause = 0u;
    board->resets++;
    reset(board, cause);
}

/* --- the interface --- */

void board_default_setup(struct board_setup *setup, const char *elf, const struct bend_table *table) {
    *setup = (struct board_setup){.elf = elf, .table = table, .seed = 1};
    wiring_default_parameters(&setup->wiring);
}

static void program_factory_data(struct board *board) {
    const uint16_t calibration = VREFINT_AT_3V, size = CORE_FLASH_BYTES / 1024u;
    static const uint8_t id[12] = {0x54, 0x52, 0x49, 0x42, 0x45, 0x4e, 0x44, 0x2d, 0x45, 0x4d, 0x55, 0x31};
    memcpy(board->core.system + UNIQUE_ID, id, sizeof id);
    memcpy(board->core.system + REFERENCE_CALIBRATION, &calibration, sizeof calibration);
    memcpy(board->core.system + FLASH_KIB, &size, sizeof size);
}

static void connect_parts(struct board *board) {
    board->rcc.changing = clocks_changing;
    board->rcc.changed = clocks_changed;
    board->rcc.crystal_stopped = break_valves;
    board->power.broke = break_valves;
    board->power.range_changed = range_changed;
    board->flash.lost_power = power_lost;
    board->flash.wait_states_changed = wait_states_changed;
    board->watchdog.bites = watchdog_bites;
    board->tick.triggered = start_conversions;
    board->rcc.context = board->power.context = board->flash.context = board->watchdog.context =
        board->tick.context = board;
    board->adc.sample = wiring_sample;
    board->adc.context = &board->wiring;
    board->wiring.core = &board->core;
    board->wiring.gpio = board->gpio;
    board->wiring.valves = &board->valves_timer;
    board->wiring.tip_line = &board->usart;
    board->wiring.supply_v = &board->power.supply_v;
}

static bool make_parts(struct board *board) {
    struct core *core = &board->core;
    rcc_init(&board->rcc, core);
    power_init(&board->power, core);
    timer_init(&board->valves_timer, core, 0u, 0xffffu, true);
    timer_init(&board->microseconds, core, 0u, 0xffffffffu, false);
    timer_init(&board->tick, core, 29u, 0xffffu, false);
    adc_init(&board->adc, core);
    usart_init(&board->usart, core, 39u);
    watchdog_init(&board->watchdog, core);
    can_bus_init(&board->bus, &core->schedule, &core->now_ticks);
    fdcan_init(&board->fdcan, core, &board->bus);
    return can_host_join(&board->host, &board->bus) && flash_init(&board->flash, core);
}

bool board_open(struct board *board, const struct board_setup *setup, char *error, size_t error_bytes) {
    const struct core_peripherals peripherals = {.context = board,
                                                 .read = read_word,
                                                 .write = write_word,
                                                 .flash_write = store_to_flash,
                                                 .locked_up = core_locked_up,
                                                 .flash_read = load_from_flash};
    memset(board, 0, sizeof *board);
    (void)snprintf(board->elf, sizeof board->elf, "%s", setup->elf);
    if (!core_open(&board->core, &peripherals, error, error_bytes)) {
        return false;
    }
    if (!make_parts(board) || !core_load_elf(&board->core, setup->elf, error, error_bytes)) {
        board_close(board);
        return false;
    }
    program_factory_data(board);
    connect_parts(board);
    board->wiring.encode = setup->encode;
    wiring_init(&board->wiring, setup->table, &setup->wiring, setup->seed);
    reset(board, RCC_RESET_BROWN_OUT);
    return true;
}

void board_close(struct board *board) {
    flash_free(&board->flash);
    core_close(&board->core);
}

void board_run(struct board *board, int64_t duration_us) {
    const int64_t until_ticks = board->core.now_ticks + duration_us * TICKS_PER_US;
    board->adc.fails = board->wiring.faults.pressure_bus_fails;
    while (board->core.now_ticks < until_ticks && !board->power_lost && !board->core.finished) {
        core_run(&board->core, until_ticks);
        if (board->core.nvic.reset_requested && !board->power_lost) {
            take_reset(board);
        }
    }
}

int64_t board_time_us(const struct board *board) {
    return board->core.now_ticks / TICKS_PER_US;
}

void board_pressures(struct board *board, double pressure_pa[3]) {
    wiring_follow(&board->wiring);
    memcpy(pressure_pa, board->wiring.plant.pressure_pa, 3 * sizeof pressure_pa[0]);
}

bool board_add_effect(struct board *board, const struct effect *effect) {
    return plant_add_effect(&board->wiring.plant, effect);
}

bool board_send(struct board *board, const struct hal_can_frame *frame) {
    return can_host_send(&board->host, frame);
}

bool board_receive(struct board *board, struct can_host_heard *heard) {
    return can_host_receive(&board->host, heard);
}

void board_supply(struct board *board, double volts) {
    const bool was_out = power_is_out(&board->power);
    power_supply(&board->power, volts);
    if (power_is_out(&board->power) != was_out) {
        request_reset(board, RCC_RESET_BROWN_OUT);
    }
}

void board_crystal(struct board *board, bool works) {
    rcc_crystal(&board->rcc, works);
}

void board_cut_power(struct board *board, uint32_t operation, uint64_t random) {
    board->flash.cut_at_operation = board->flash.operations + operation;
    board->flash.cut_random = random;
}

bool board_power_cycle(struct board *board) {
    bool watched = true;
    board->power_lost = false;
    board->reset_cause = 0u;
    board->rcc.cause = 0u;
    for (uint32_t i = 0; i < CORE_RAM_BYTES; i++) {
        board->core.ram[i] = (uint8_t)(i * 181u + board->resets * 37u + 11u); /* anything */
    }
    board->resets++;
    if (board->flash.broken_count > 0u) {
        watched = core_watch_flash(&board->core);
    }
    reset(board, RCC_RESET_BROWN_OUT);
    return watched;
}

void board_press_reset(struct board *board) {
    request_reset(board, RCC_RESET_PIN);
}

bool board_symbol(const struct board *board, const char *name, uint32_t *address) {
    uint32_t bytes;
    return elf_symbol(board->elf, name, address, &bytes);
}

bool board_probe(struct board *board, const char *function, core_probe_action action, void *context) {
    uint32_t address;
    return board_symbol(board, function, &address) && core_probe(&board->core, address, action, context);
}

bool board_hang(struct board *board, const char *function) {
    static const uint16_t jump_to_itself = 0xe7feu;
    uint32_t address;
    return board_symbol(board, function, &address) &&
           core_patch(&board->core, address, &jump_to_itself, sizeof jump_to_itself);
}

bool board_describe_oddities(const struct board *board, char *text, size_t bytes) {
    const struct core_oddities *core = &board->core.oddities;
    const struct {
        const char *what;
        uint32_t count, address;
    } oddity[] = {
        {"accesses to registers that are not emulated", board->oddities.unknown,
         board->oddities.first_unknown},
        {"accesses to peripherals without a clock", board->oddities.unclocked,
         board->oddities.first_unclocked},
        {"accesses to core registers that are not emulated", core->unknown_registers, core->first_unknown},
        {"accesses to parts of peripheral registers", core->partial_accesses, 0u},
        {"blocks with exclusive accesses", core->exclusive_blocks, 0u},
        {"returns from exceptions that were not running", core->spurious_returns, 0u},
        {"flash operations against the rules", board->flash.refused, 0u},
        {"clocks too fast for flash or regulator", board->rcc.violations, 0u}};
    size_t used = 0;
    text[0] = '\0';
    for (size_t i = 0; i < sizeof oddity / sizeof oddity[0]; i++) {
        if (oddity[i].count > 0 && used < bytes) {
            const int wrote = snprintf(text + used, bytes - used, "%s%u %s", used > 0 ? "; " : "",
                                       oddity[i].count, oddity[i].what);
            used += wrote > 0 ? (size_t)wrote : 0u;
            if (oddity[i].address != 0u && used < bytes) {
                (void)snprintf(text + used, bytes - used, " (first 0x%08x)", oddity[i].address);
                used = strlen(text);
            }
        }
    }
    return used > 0;
}
