#include "emulator/core.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "emulator/elf_image.h"
#include "emulator/exceptions.h"

#define PERIPHERALS 0x40000000u
#define PERIPHERALS_BYTES 0x20000000u
#define PRIVATE 0xe0000000u
#define PRIVATE_BYTES 0x100000u
#define SYSTEM_CONTROL_SPACE 0xe000u
#define DEBUG 0x42000u /* DBGMCU: kept, without effect */
#define CORE_NO_EVENT UINT32_MAX
#define EVENT_SUPERVISOR_CALL 2u
#define EVENT_BREAKPOINT 7u
#define EVENT_EXCEPTION_RETURN 8u
#define EVENT_NO_COPROCESSOR 17u
#define EVENT_INVALID_STATE 18u
#define COPROCESSORS_10_11 0x00f00000u

/* What one basic block is made of. */
struct core_block {
    uint16_t bytes; /* 0: not looked at yet */
    uint8_t instructions;
    uint8_t kind;
    uint8_t if_then; /* ITSTATE at its end, of an IT instruction within it */
};

enum block_kind { BLOCK_USES_FLOATS = 1, BLOCK_SETS_MASKS = 2, BLOCK_IS_EXCLUSIVE = 4, BLOCK_IS_PROBED = 8 };

uint32_t core_register(const struct core *core, int which) {
    uint32_t value = 0;
    (void)uc_reg_read(core->engine, which, &value);
    return value;
}

void core_set_register(struct core *core, int which, uint32_t value) {
    (void)uc_reg_write(core->engine, which, &value);
}

void core_attend(struct core *core) {
    core->deadline_ticks = INT64_MIN;
}

void core_line(struct core *core, uint32_t exception, bool level) {
    nvic_line(&core->nvic, exception, level);
    if (core->nvic.pending_count > 0) {
        core_attend(core);
    }
}

void core_stall(struct core *core, int64_t until_ticks) {
    core->stalled_ticks = until_ticks;
    core_attend(core);
}

void core_forget_code(struct core *core) {
    memset(core->block, 0, CORE_FLASH_BYTES / 2u * sizeof core->block[0]);
}

uint32_t core_code_offset(const struct core *core) {
    return core->block_end - CORE_FLASH;
}

void core_set_clock(struct core *core, uint32_t hertz) {
    core->ticks_per_instruction = TICKS_PER_SECOND / hertz;
}

/* --- memory --- */

static uint8_t *place(const struct core *core, uint32_t address, size_t size) {
    const struct {
        uint32_t base, bytes;
        uint8_t *memory;
    } region[] = {{CORE_FLASH, CORE_FLASH_BYTES, core->flash},
                  {CORE_RAM, CORE_RAM_BYTES, core->ram},
                  {CORE_CCM, CORE_CCM_BYTES, core->ram + CORE_RAM_BYTES - CORE_CCM_BYTES},
                  {CORE_SYSTEM, CORE_SYSTEM_BYTES, core->system},
                  {0u, CORE_FLASH_BYTES, core->flash}};
    for (size_t i = 0; i < sizeof region / sizeof region[0]; i++) {
        if (address >= region[i].base && address - region[i].base < region[i].bytes &&
            size <= region[i].bytes - (address - region[i].base)) {
            return region[i].memory + (address - region[i].base);
        }
    }
    return NULL;
}

bool core_read(const struct core *core, uint32_t address, void *bytes, size_t size) {
    const uint8_t *from = place(core, address, size);
    if (from != NULL) {
        memcpy(bytes, from, size);
    }
    return from != NULL;
}

bool core_write(struct core *core, uint32_t address, const void *bytes, size_t size) {
    uint8_t *to = place(core, address, size);
    if (to != NULL) {
        memcpy(to, bytes, size);
    }
    return to != NULL;
}

bool core_patch(struct core *core, uint32_t address, const void *bytes, size_t size) {
    const bool written = core_write(core, address, bytes, size);
    core_forget_code(core);
    (void)uc_ctl_remove_cache(core->engine, (uint64_t)address, (uint64_t)address + size);
    return written;
}

/* --- counting --- */

static bool is_wide(uint16_t half) {
    return half >= 0xe800u;
}

static uint8_t kind_of(uint16_t first, uint16_t second) {
    uint8_t kind = 0;
    if (!is_wide(first)) {
        return (first & 0xffe8u) == 0xb660u ? BLOCK_SETS_MASKS : 0u; /* CPS */
    }
    if ((first & 0xef00u) >= 0xec00u && (first & 0xec00u) == 0xec00u && (second & 0x0e00u) == 0x0a00u) {
        kind |= BLOCK_USES_FLOATS; /* coprocessors 10 and 11 */
    }
    if ((first & 0xfff0u) == 0xf380u && (second & 0xff00u) == 0x8800u) {
        kind |= BLOCK_SETS_MASKS; /* MSR */
    }
    if (((first & 0xffe0u) == 0xe840u) || ((first & 0xffe0u) == 0xe8c0u && (second & 0x0fc0u) == 0x0f40u)) {
        kind |= BLOCK_IS_EXCLUSIVE; /* LDREX, STREX and their byte and half-word forms */
    }
    return kind;
}

/* ITSTATE behind one more instruction (ARMv7-M A7.3.3). */
static uint8_t if_then_next(uint8_t state) {
    return (state & 7u) == 0u ? 0u : (uint8_t)((state & 0xe0u) | ((uint32_t)state << 1 & 0x1fu));
}

static bool is_if_then(uint16_t half) {
    return (half & 0xff00u) == 0xbf00u && (half & 0xfu) != 0u;
}

static struct core_block look_at(const struct core *core, uint32_t address, uint32_t bytes) {
    struct core_block block = {.bytes = (uint16_t)bytes};
    const uint8_t *code = place(core, address, bytes);
    for (size_t i = 0; i < core->probes; i++) {
        block.kind |= core->probe[i].address == address ? BLOCK_IS_PROBED : 0u;
    }
    for (uint32_t at = 0; code != NULL && at + 2u <= bytes;) {
        uint16_t half[2] = {0, 0};
        memcpy(half, code + at, at + 4u <= bytes ? 4u : 2u);
        block.kind |= kind_of(half[0], half[1]);
        block.if_then = is_if_then(half[0]) ? (uint8_t)half[0] : if_then_next(block.if_then);
        block.instructions++;
        at += is_wide(half[0]) ? 4u : 2u;
    }
    return block;
}

static struct core_block block_at(struct core *core, uint32_t address, uint32_t bytes) {
    if (address < CORE_FLASH || address >= CORE_FLASH + CORE_FLASH_BYTES) {
        return look_at(core, address, bytes); /* code in RAM may change */
    }
    struct core_block *cached = &core->block[(address - CORE_FLASH) / 2u];
    if (cached->bytes != bytes) {
        *cached = look_at(core, address, bytes);
    }
    return *cached;
}

static bool floats_allowed(const struct core *core) {
    return (core->nvic.coprocessors & COPROCESSORS_10_11) == COPROCESSORS_10_11;
}

static void stop(struct core *core) {
    core->stopped = true;
    (void)uc_emu_stop(core->engine);
}

/* A block that starts inside an IT block has cleared ITSTATE by the time its hook is called; the frame needs
 * it. */
static void stop_before(struct core *core, uint32_t address) {
    core->if_then_lost = address == core->block_end ? core->if_then : 0u;
    stop(core);
}

static void follow_if_then(struct core *core, uint32_t address, const struct core_block *block) {
    uint8_t state = address == core->block_end ? core->if_then : 0u;
    for (uint32_t i = 0; i < block->instructions && state != 0u; i++) {
        state = if_then_next(state);
    }
    core->if_then = state != 0u ? state : block->if_then;
    core->block_end = address + block->bytes;
}

static void run_probes(struct core *core, uint32_t address) {
    for (size_t i = 0; i < core->probes; i++) {
        if (core->probe[i].address == address) {
            core->probe[i].action(core->probe[i].context, core);
        }
    }
}

static void on_block(uc_engine *engine, uint64_t address, uint32_t bytes, void *context) {
    struct core *core = context;
    (void)engine;
    if (core->now_ticks >= core->deadline_ticks) {
        stop_before(core, (uint32_t)address);
        return;
    }
    const struct core_block block = block_at(core, (uint32_t)address, bytes);
    if (block.kind != 0) {
        if ((block.kind & BLOCK_USES_FLOATS) != 0 && !floats_allowed(core)) {
            core->event = EVENT_NO_COPROCESSOR;
            stop_before(core, (uint32_t)address);
            return;
        }
        if ((block.kind & BLOCK_IS_PROBED) != 0) {
            run_probes(core, (uint32_t)address);
        }
        core->oddities.exclusive_blocks += (block.kind & BLOCK_IS_EXCLUSIVE) != 0 ? 1u : 0u;
        if ((block.kind & BLOCK_SETS_MASKS) != 0 && core->nvic.pending_count > 0) {
            core_attend(core);
        }
    }
    follow_if_then(core, (uint32_t)address, &block);
    core->now_ticks += block.instructions * core->ticks_per_instruction;
    core->run_instructions[core->running] += block.instructions;
    core->count[core->running].instructions += block.instructions;
}

static void on_interrupt(uc_engine *engine, uint32_t number, void *context) {
    struct core *core = context;
    (void)engine;
    core->event = number;
    stop(core);
}

bool core_probe(struct core *core, uint32_t address, core_probe_action action, void *context) {
    if (core->probes == CORE_PROBES) {
        return false;
    }
    core->probe[core->probes++] =
        (struct core_probe){.address = address, .action = action, .context = context};
    core_forget_code(core);
    return true;
}

static void see_step(void *context, struct core *core) {
    (void)context;
    core->step_seen = true;
}

bool core_mark_step(struct core *core, uint32_t address) {
    return core_probe(core, address, see_step, NULL);
}

/* Thread mode goes to sleep: what it did since the last time was a step, if it passed the step's function. */
static void end_thread_run(struct core *core) {
    const uint64_t run = core->count[0].instructions - core->thread_before;
    core->thread_before = core->count[0].instructions;
    if (core->step_seen) {
        core->step_seen = false;
        core->step.entries++;
        core->step.instructions += run;
        core->step.last = run;
        core->step.most = run > core->step.most ? run : core->step.most;
    }
}

/* --- memory-mapped registers --- */

static uint32_t lane(uint32_t value, uint64_t offset, unsigned bytes) {
    const uint32_t shifted = value >> (8u * (unsigned)(offset & 3u));
    return bytes >= 4u ? shifted : shifted & ((1u << (8u * bytes)) - 1u);
}

static uint64_t peripheral_read(uc_engine *engine, uint64_t offset, unsigned bytes, void *context) {
    struct core *core = context;
    (void)engine;
    core->oddities.partial_accesses += bytes != 4u ? 1u : 0u;
    const uint32_t address = PERIPHERALS + (uint32_t)(offset & ~UINT64_C(3));
    return lane(core->peripherals.read == NULL ? 0u
                                               : core->peripherals.read(core->peripherals.context, address),
                offset, bytes);
}

static void peripheral_write(uc_engine *engine, uint64_t offset, unsigned bytes, uint64_t value,
                             void *context) {
    struct core *core = context;
    (void)engine;
    core->oddities.partial_accesses += bytes != 4u ? 1u : 0u;
    if (core->peripherals.write != NULL) {
        core->peripherals.write(core->peripherals.context, PERIPHERALS + (uint32_t)(offset & ~UINT64_C(3)),
                                (uint32_t)value << (8u * (unsigned)(offset & 3u)));
    }
}

#define SYSTICK_CONTROL 0x10u
#define SYSTICK_RELOAD 0x14u
#define SYSTICK_VALUE 0x18u
#define SYSTICK_ENABLE 1u
#define SYSTICK_INTERRUPT 2u

static int64_t systick_period(const struct core *core) {
    return (int64_t)(core->nvic.systick_reload + 1u) * core->ticks_per_instruction;
}

static void systick_start(struct core *core) {
    const bool runs = (core->nvic.systick_control & SYSTICK_ENABLE) != 0 && core->nvic.systick_reload != 0;
    core->nvic.systick_zero_ticks = core->now_ticks + systick_period(core);
    schedule_set(&core->schedule, core->systick_slot, runs ? core->nvic.systick_zero_ticks : SCHEDULE_NEVER);
}

static void on_systick(void *context, int64_t at_ticks) {
    struct core *core = context;
    core->nvic.systick_counted = true;
    core->nvic.systick_zero_ticks = at_ticks + systick_period(core);
    if ((core->nvic.systick_control & SYSTICK_INTERRUPT) != 0) {
        nvic_pend(&core->nvic, EXCEPTION_SYSTICK);
    }
    schedule_set(&core->schedule, core->systick_slot, core->nvic.systick_zero_ticks);
}

static bool systick_read(struct core *core, uint32_t offset, uint32_t *value) {
    if (offset == SYSTICK_CONTROL) {
        *value = core->nvic.systick_control | (core->nvic.systick_counted ? 1u << 16 : 0u);
        core->nvic.systick_counted = false;
        return true;
    }
    if (offset == SYSTICK_VALUE) {
        const int64_t left = core->nvic.systick_zero_ticks - core->now_ticks;
        *value = left > 0 ? (uint32_t)(left / core->ticks_per_instruction) & 0xffffffu : 0u;
        return true;
    }
    *value = core->nvic.systick_reload;
    return offset == SYSTICK_RELOAD;
}

static bool systick_write(struct core *core, uint32_t offset, uint32_t value) {
    if (offset == SYSTICK_CONTROL) {
        const bool was_on = (core->nvic.systick_control & SYSTICK_ENABLE) != 0;
        core->nvic.systick_control = value & 7u;
        if (was_on != ((value & SYSTICK_ENABLE) != 0)) {
            systick_start(core);
        }
    } else if (offset == SYSTICK_RELOAD) {
        core->nvic.systick_reload = value & 0xffffffu;
    } else if (offset == SYSTICK_VALUE) {
        systick_start(core);
    } else {
        return false;
    }
    return true;
}

static void note_unknown(struct core *core, uint32_t offset) {
    core->oddities.unknown_registers++;
    core->oddities.first_unknown =
        core->oddities.first_unknown != 0 ? core->oddities.first_unknown : PRIVATE + offset;
}

static uint32_t private_word(struct core *core, uint32_t offset) {
    uint32_t value = 0;
    const uint32_t inside = offset - SYSTEM_CONTROL_SPACE;
    const bool systick = inside >= SYSTICK_CONTROL && inside <= SYSTICK_VALUE;
    if (offset >= DEBUG && offset < DEBUG + sizeof core->debug) {
        return core->debug[(offset - DEBUG) / 4u];
    }
    if (offset < SYSTEM_CONTROL_SPACE || inside >= 0x1000u ||
        !(systick ? systick_read(core, inside, &value)
                  : nvic_read(&core->nvic, inside, core->running, &value))) {
        note_unknown(core, offset);
    }
    return value;
}

static uint64_t private_read(uc_engine *engine, uint64_t offset, unsigned bytes, void *context) {
    (void)engine;
    return lane(private_word(context, (uint32_t)offset & ~3u), offset, bytes);
}

static uint32_t with_lane(uint32_t word, uint64_t offset, unsigned bytes, uint32_t value) {
    const unsigned shift = 8u * (unsigned)(offset & 3u);
    const uint32_t mask = bytes >= 4u ? 0xffffffffu : ((1u << (8u * bytes)) - 1u) << shift;
    return (word & ~mask) | (value << shift & mask);
}

static void private_write(uc_engine *engine, uint64_t offset, unsigned bytes, uint64_t value, void *context) {
    struct core *core = context;
    const uint32_t at = (uint32_t)offset & ~3u;
    const uint32_t inside = at - SYSTEM_CONTROL_SPACE;
    const bool systick = inside >= SYSTICK_CONTROL && inside <= SYSTICK_VALUE;
    (void)engine;
    /* Bytes of the priority registers are the only parts that software writes. */
    const uint32_t word =
        bytes == 4u ? (uint32_t)value : with_lane(private_word(core, at), offset, bytes, (uint32_t)value);
    if (offset >= DEBUG && offset < DEBUG + sizeof core->debug) {
        core->debug[(offset - DEBUG) / 4u] = word;
    } else if (at < SYSTEM_CONTROL_SPACE || inside >= 0x1000u ||
               !(systick ? systick_write(core, inside, word) : nvic_write(&core->nvic, inside, word))) {
        note_unknown(core, at);
    }
    if (core->nvic.pending_count > 0 || core->nvic.reset_requested) {
        core_attend(core);
    }
}

static void undo_flash_write(struct core *core) {
    if (core->flash_undo.bytes > 0) {
        memcpy(core->flash + core->flash_undo.address, &core->flash_undo.old, core->flash_undo.bytes);
        core->flash_undo.bytes = 0;
    }
}

/* The store reaches memory after this hook; it is undone at the next block's start. */
static bool on_flash_write(struct core *core, uint32_t address, uint32_t bytes, uint64_t value) {
    const uint32_t offset = address - CORE_FLASH;
    if (address < CORE_FLASH || offset >= CORE_FLASH_BYTES || bytes > 8u ||
        core->peripherals.flash_write == NULL) {
        return false;
    }
    undo_flash_write(core);
    core->peripherals.flash_write(core->peripherals.context, address, (uint32_t)value, bytes);
    core->flash_undo.address = offset;
    core->flash_undo.bytes = bytes;
    memcpy(&core->flash_undo.old, core->flash + offset, bytes);
    core_attend(core);
    return true;
}

static bool on_bad_access(uc_engine *engine, uc_mem_type type, uint64_t address, int bytes, int64_t value,
                          void *context) {
    struct core *core = context;
    (void)engine;
    if (type == UC_MEM_WRITE_PROT &&
        on_flash_write(core, (uint32_t)address, (uint32_t)bytes, (uint64_t)value)) {
        return true;
    }
    core->fault_address = (uint32_t)address;
    return false;
}

/* --- running --- */

/* libunicorn takes every kind of hook as void *, which ISO C lets no function pointer become. */
#define hook_of(function)                                                                                    \
    ((union {                                                                                                \
         __typeof__(&(function)) call;                                                                       \
         void *any;                                                                                          \
     }){.call = (function)}                                                                                  \
         .any)

static bool add_hooks(struct core *core) {
    uc_hook hook;
    uc_err error = uc_hook_add(core->engine, &hook, UC_HOOK_BLOCK, hook_of(on_block), core, 1, 0);
    error = error != UC_ERR_OK
                ? error
                : uc_hook_add(core->engine, &hook, UC_HOOK_INTR, hook_of(on_interrupt), core, 1, 0);
    error = error != UC_ERR_OK
                ? error
                : uc_hook_add(core->engine, &hook, UC_HOOK_MEM_INVALID, hook_of(on_bad_access), core, 1, 0);
    return error == UC_ERR_OK;
}

static void on_flash_read(uc_engine *engine, uc_mem_type type, uint64_t address, int bytes, int64_t value,
                          void *context) {
    struct core *core = context;
    (void)engine;
    (void)type;
    (void)bytes;
    (void)value;
    core->peripherals.flash_read(core->peripherals.context, (uint32_t)address);
}

bool core_watch_flash(struct core *core) {
    uc_hook hook;
    if (core->watches_flash) {
        return true;
    }
    core->watches_flash = uc_hook_add(core->engine, &hook, UC_HOOK_MEM_READ, hook_of(on_flash_read), core, CORE_FLASH,
                                      CORE_FLASH + CORE_FLASH_BYTES - 1u) == UC_ERR_OK;
    /* code that was translated before would not tell */
    (void)uc_ctl_remove_cache(core->engine, (uint64_t)CORE_FLASH, (uint64_t)CORE_FLASH + CORE_FLASH_BYTES);
    return core->watches_flash;
}

static bool map_memory(struct core *core) {
    uc_engine *engine = core->engine;
    const uint32_t code = UC_PROT_READ | UC_PROT_EXEC;
    return uc_mem_map_ptr(engine, CORE_FLASH, CORE_FLASH_BYTES, code, core->flash) == UC_ERR_OK &&
           uc_mem_map_ptr(engine, 0u, CORE_FLASH_BYTES, code, core->flash) == UC_ERR_OK &&
           uc_mem_map_ptr(engine, CORE_SYSTEM, CORE_SYSTEM_BYTES, code, core->system) == UC_ERR_OK &&
           uc_mem_map_ptr(engine, CORE_RAM, CORE_RAM_BYTES, UC_PROT_ALL, core->ram) == UC_ERR_OK &&
           uc_mem_map_ptr(engine, CORE_CCM, CORE_CCM_BYTES, UC_PROT_ALL,
                          core->ram + CORE_RAM_BYTES - CORE_CCM_BYTES) == UC_ERR_OK &&
           uc_mmio_map(engine, PERIPHERALS, PERIPHERALS_BYTES, peripheral_read, core, peripheral_write,
                       core) == UC_ERR_OK &&
           uc_mmio_map(engine, PRIVATE, PRIVATE_BYTES, private_read, core, private_write, core) == UC_ERR_OK;
}

static bool allocate(struct core *core) {
    core->flash = aligned_alloc(4096, CORE_FLASH_BYTES);
    core->ram = aligned_alloc(4096, CORE_RAM_BYTES);
    core->system = aligned_alloc(4096, CORE_SYSTEM_BYTES);
    core->block = calloc(CORE_FLASH_BYTES / 2u, sizeof core->block[0]);
    if (core->flash == NULL || core->ram == NULL || core->system == NULL || core->block == NULL) {
        return false;
    }
    memset(core->flash, 0xff, CORE_FLASH_BYTES);
    memset(core->ram, 0xa5, CORE_RAM_BYTES); /* power-on contents are anything */
    memset(core->system, 0xff, CORE_SYSTEM_BYTES);
    return true;
}

bool core_open(struct core *core, const struct core_peripherals *peripherals, char *error,
               size_t error_bytes) {
    memset(core, 0, sizeof *core);
    core->peripherals = *peripherals;
    core->ticks_per_instruction = TICKS_PER_SECOND / 16000000;
    schedule_init(&core->schedule, &core->deadline_ticks);
    core->systick_slot = schedule_add(&core->schedule, on_systick, core);
    if (!allocate(core) || uc_open(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS, &core->engine) != UC_ERR_OK ||
        uc_ctl_set_cpu_model(core->engine, UC_CPU_ARM_CORTEX_M4) != UC_ERR_OK || !map_memory(core) ||
        !add_hooks(core)) {
        (void)snprintf(error, error_bytes, "libunicorn gives no Cortex-M4 core");
        core_close(core);
        return false;
    }
    return true;
}

void core_close(struct core *core) {
    if (core->engine != NULL) {
        (void)uc_close(core->engine);
    }
    free(core->flash);
    free(core->ram);
    free(core->system);
    free(core->block);
    memset(core, 0, sizeof *core);
}

static bool take_segment(void *context, uint32_t address, const uint8_t *bytes, uint32_t size) {
    struct core *core = context;
    return address >= CORE_FLASH && core_write(core, address, bytes, size);
}

bool core_load_elf(struct core *core, const char *path, char *error, size_t error_bytes) {
    memset(core->flash, 0xff, CORE_FLASH_BYTES);
    memset(core->block, 0, CORE_FLASH_BYTES / 2u * sizeof core->block[0]);
    return elf_load(path, take_segment, core, error, error_bytes);
}

void core_reset(struct core *core) {
    uint32_t vector[2] = {0u, 0u};
    undo_flash_write(core);
    nvic_reset(&core->nvic);
    schedule_set(&core->schedule, core->systick_slot, SCHEDULE_NEVER);
    core->running = 0;
    core->sleeping = core->locked_up = false;
    core->stalled_ticks = 0;
    core->step_seen = false;
    core->thread_before = core->count[0].instructions;
    memset(core->run_instructions, 0, sizeof core->run_instructions);
    (void)core_read(core, CORE_FLASH, vector, sizeof vector);
    core->nvic.vector_table = CORE_FLASH;
    core_set_register(core, UC_ARM_REG_XPSR_NZCVQG, 1u << 24);
    core_set_register(core, UC_ARM_REG_CONTROL, 0u);
    core_set_register(core, UC_ARM_REG_PRIMASK, 0u);
    core_set_register(core, UC_ARM_REG_FAULTMASK, 0u);
    core_set_register(core, UC_ARM_REG_BASEPRI, 0u);
    core_set_register(core, UC_ARM_REG_FPSCR, 0u);
    core_set_register(core, UC_ARM_REG_PSP, 0u);
    core_set_register(core, UC_ARM_REG_MSP, vector[0] & ~3u);
    core_set_register(core, UC_ARM_REG_LR, 0xffffffffu);
    core_set_register(core, UC_ARM_REG_PC, vector[1]);
}

#define SEMIHOSTING 0xbeabu
#define SEMIHOST_WRITE0 0x04u
#define SEMIHOST_EXIT 0x18u
#define SEMIHOST_EXIT_EXTENDED 0x20u
#define SEMIHOST_APPLICATION_EXIT 0x20026u

static void console_write(struct core *core, uint32_t address) {
    char letter = '\0';
    while (core_read(core, address++, &letter, 1) && letter != '\0' &&
           core->console_used + 1u < core->console_bytes) {
        core->console[core->console_used++] = letter;
        core->console[core->console_used] = '\0';
    }
}

/* The three calls of Arm's semihosting that a test program needs. */
static bool semihost(struct core *core, uint32_t pc) {
    uint16_t instruction = 0;
    const uint32_t operation = core_register(core, UC_ARM_REG_R0);
    const uint32_t argument = core_register(core, UC_ARM_REG_R1);
    if (!core->semihosting || !core_read(core, pc, &instruction, 2) || instruction != SEMIHOSTING) {
        return false;
    }
    if (operation == SEMIHOST_WRITE0) {
        console_write(core, argument);
    } else if (operation == SEMIHOST_EXIT || operation == SEMIHOST_EXIT_EXTENDED) {
        uint32_t block[2] = {argument, 0u};
        (void)(operation == SEMIHOST_EXIT_EXTENDED && core_read(core, argument, block, sizeof block));
        core->finished = true;
        core->exit_status = block[0] == SEMIHOST_APPLICATION_EXIT ? (int)block[1] : 1;
    }
    core_set_register(core, UC_ARM_REG_PC, (pc + 2u) | 1u);
    return true;
}

static void handle_event(struct core *core, uint32_t pc) {
    switch (core->event) {
    case EVENT_EXCEPTION_RETURN:
        exceptions_return(core, pc | 1u);
        break;
    case EVENT_SUPERVISOR_CALL:
        exceptions_supervisor_call(core);
        break;
    case EVENT_BREAKPOINT:
        if (!semihost(core, pc)) {
            core->nvic.hard_fault_status |= HFSR_DEBUGEVT;
            exceptions_fault(core, EXCEPTION_HARD_FAULT, 0u, pc);
        }
        break;
    case EVENT_NO_COPROCESSOR:
        exceptions_fault(core, EXCEPTION_USAGE_FAULT, CFSR_NOCP, pc);
        break;
    case EVENT_INVALID_STATE:
        exceptions_fault(core, EXCEPTION_USAGE_FAULT, CFSR_INVSTATE, pc);
        break;
    default:
        exceptions_fault(core, EXCEPTION_USAGE_FAULT, CFSR_UNDEFINSTR, pc);
        break;
    }
}

static void handle_error(struct core *core, uc_err error, uint32_t pc) {
    switch (error) {
    case UC_ERR_READ_UNMAPPED:
    case UC_ERR_WRITE_UNMAPPED:
    case UC_ERR_READ_PROT:
    case UC_ERR_WRITE_PROT:
        core->nvic.bus_fault_address = core->fault_address;
        exceptions_fault(core, EXCEPTION_BUS_FAULT, CFSR_PRECISERR | CFSR_BFARVALID, pc);
        break;
    case UC_ERR_FETCH_UNMAPPED:
        exceptions_fault(core, EXCEPTION_BUS_FAULT, CFSR_IBUSERR, pc);
        break;
    case UC_ERR_FETCH_PROT:
        exceptions_fault(core, EXCEPTION_MEMORY_FAULT, CFSR_IACCVIOL, pc);
        break;
    case UC_ERR_READ_UNALIGNED:
    case UC_ERR_WRITE_UNALIGNED:
        exceptions_fault(core, EXCEPTION_USAGE_FAULT, CFSR_UNALIGNED, pc);
        break;
    default:
        exceptions_fault(core, EXCEPTION_USAGE_FAULT,
                         core->event == EVENT_INVALID_STATE ? CFSR_INVSTATE : CFSR_UNDEFINSTR, pc);
        break;
    }
}

/* Blocks up to the deadline, or to something that only the emulator can do. */
static void run_blocks(struct core *core) {
    core->stopped = false;
    core->event = CORE_NO_EVENT;
    core->if_then_lost = 0u;
    const uc_err error = uc_emu_start(core->engine, core_register(core, UC_ARM_REG_PC) | 1u, 0, 0, 0);
    const uint32_t pc = core_register(core, UC_ARM_REG_PC);
    undo_flash_write(core);
    if (core->if_then_lost != 0u) {
        const uint32_t state = core->if_then_lost;
        core_set_register(core, UC_ARM_REG_EPSR, 1u << 24 | (state & 3u) << 25 | (state & 0xfcu) << 8);
        core->block_end = pc; /* goes on from there, unless an exception comes first */
    }
    if (core->event != CORE_NO_EVENT) {
        handle_event(core, pc);
    } else if (error != UC_ERR_OK) {
        handle_error(core, error, pc);
    } else if (!core->stopped) {
        core->sleeping = true;
        if (core->running == 0u) {
            end_thread_run(core);
        }
    }
}

static int64_t earlier(int64_t a, int64_t b) {
    return a < b ? a : b;
}

void core_run(struct core *core, int64_t until_ticks) {
    while (core->now_ticks < until_ticks && !core->nvic.reset_requested && !core->finished) {
        schedule_run(&core->schedule, core->now_ticks);
        if (core->now_ticks < core->stalled_ticks) {
            core->now_ticks = earlier(core->stalled_ticks, earlier(core->schedule.next_ticks, until_ticks));
            continue;
        }
        if (core->nvic.pending_count > 0 && !core->held) {
            if (core->sleeping && exceptions_wake(core)) {
                core->sleeping = false;
            }
            exceptions_take(core);
        }
        core->deadline_ticks = earlier(core->schedule.next_ticks, until_ticks);
        if (core->sleeping || core->locked_up || core->held) {
            core->now_ticks = core->deadline_ticks > core->now_ticks ? core->deadline_ticks : core->now_ticks;
        } else {
            run_blocks(core);
        }
    }
}
