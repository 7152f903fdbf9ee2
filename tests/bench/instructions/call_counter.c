/* Instructions are counted a basic block at a time: a block hook adds the block's length, which is read off its Thumb
 * code once and kept by address. A function that is followed is entered at a block that starts it and left at a block
 * that starts where its return address points, with the stack as it was. */
#include "call_counter.h"

#include <elf.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <unicorn/unicorn.h>

#include "frame.h"

#define HALFWORDS (FRAME_FLASH_BYTES / 2u)
#define DEPTH 32

struct block {
    uint32_t bytes; /* 0: not met yet */
    uint16_t instructions;
    int16_t function; /* that starts here, -1: none */
};

struct activation {
    uint32_t back;
    uint32_t stack;
    int16_t function;
    uint64_t before;
};

struct call_counter {
    uc_engine *engine;
    uc_hook block_hook, code_hook, fault_hook;
    uint8_t *elf;
    size_t elf_bytes;
    struct block *block;
    uint32_t home; /* image_return */
    uint64_t instructions;
    uint64_t most;
    bool faulted;
    uint32_t it_from, it_bytes; /* the last IT block, when counting singly */
    struct activation activation[DEPTH];
    size_t depth;
    struct call_counter_function function[CALL_COUNTER_FUNCTIONS];
    size_t functions;
};

/* --- the ELF --- */

static bool read_elf(struct call_counter *counter, const char *path) {
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return false;
    }
    counter->elf = malloc(FRAME_TABLE_BYTES * 4u);
    counter->elf_bytes = counter->elf == NULL ? 0 : fread(counter->elf, 1, FRAME_TABLE_BYTES * 4u, file);
    (void)fclose(file);
    return counter->elf_bytes > sizeof(Elf32_Ehdr) && memcmp(counter->elf, ELFMAG, SELFMAG) == 0 &&
           counter->elf[EI_CLASS] == ELFCLASS32;
}

static bool load_segments(struct call_counter *counter) {
    const Elf32_Ehdr *header = (const Elf32_Ehdr *)(const void *)counter->elf;
    bool loaded = true;
    for (size_t i = 0; i < header->e_phnum && loaded; i++) {
        const Elf32_Phdr *segment = (const Elf32_Phdr *)(const void *)(counter->elf + header->e_phoff) + i;
        if (segment->p_type == PT_LOAD && segment->p_filesz > 0u) {
            loaded = (size_t)segment->p_offset + segment->p_filesz <= counter->elf_bytes &&
                     call_counter_write(counter, segment->p_vaddr, counter->elf + segment->p_offset, segment->p_filesz);
        }
    }
    return loaded;
}

uint32_t call_counter_symbol(const struct call_counter *counter, const char *name) {
    const Elf32_Ehdr *header = (const Elf32_Ehdr *)(const void *)counter->elf;
    const Elf32_Shdr *section = (const Elf32_Shdr *)(const void *)(counter->elf + header->e_shoff);
    for (size_t s = 0; s < header->e_shnum; s++) {
        if (section[s].sh_type != SHT_SYMTAB) {
            continue;
        }
        const Elf32_Sym *symbol = (const Elf32_Sym *)(const void *)(counter->elf + section[s].sh_offset);
        const char *names = (const char *)counter->elf + section[section[s].sh_link].sh_offset;
        for (size_t i = 0; i < section[s].sh_size / sizeof *symbol; i++) {
            if (strcmp(names + symbol[i].st_name, name) == 0) {
                return symbol[i].st_value;
            }
        }
    }
    return 0u;
}

/* --- counting --- */

static uint16_t code_at(const struct call_counter *counter, uint32_t address) {
    uint16_t half = 0u;
    (void)uc_mem_read(counter->engine, address, &half, sizeof half);
    return half;
}

static uint32_t length_of(uint16_t half) {
    return (half >> 11) >= 0x1du ? 4u : 2u; /* ARMv7-M A5.1: 0b11101, 0b11110 and 0b11111 begin 32 bits */
}

static void measure_block(struct call_counter *counter, uint32_t address, uint32_t bytes, struct block *block) {
    uint16_t instructions = 0u;
    for (uint32_t at = 0u; at < bytes; instructions++) {
        at += length_of(code_at(counter, address + at));
    }
    block->bytes = bytes;
    block->instructions = instructions;
}

static uint32_t read_register(const struct call_counter *counter, int which) {
    uint32_t value = 0u;
    (void)uc_reg_read(counter->engine, which, &value);
    return value;
}

static void leave(struct call_counter *counter) {
    const struct activation *last = &counter->activation[--counter->depth];
    struct call_counter_function *function = &counter->function[last->function];
    const uint64_t used = counter->instructions - last->before;
    function->calls++;
    function->total += used;
    function->worst = used > function->worst ? used : function->worst;
}

static void follow(struct call_counter *counter, uint32_t address, int16_t function) {
    while (counter->depth > 0 && counter->activation[counter->depth - 1].back == address &&
           counter->activation[counter->depth - 1].stack == read_register(counter, UC_ARM_REG_SP)) {
        leave(counter);
    }
    if (function >= 0 && counter->depth < DEPTH) {
        counter->activation[counter->depth++] = (struct activation){.back = read_register(counter, UC_ARM_REG_LR) & ~1u,
                                                                    .stack = read_register(counter, UC_ARM_REG_SP),
                                                                    .function = function,
                                                                    .before = counter->instructions};
    }
}

static void on_block(uc_engine *engine, uint64_t address, uint32_t bytes, void *context) {
    struct call_counter *counter = context;
    const uint32_t at = (uint32_t)address;
    if (at - FRAME_FLASH_ADDRESS >= FRAME_FLASH_BYTES) {
        counter->faulted = true;
        (void)uc_emu_stop(engine);
        return;
    }
    struct block *block = &counter->block[(at - FRAME_FLASH_ADDRESS) / 2u];
    follow(counter, at, block->function);
    if (at == counter->home || counter->instructions > counter->most) {
        (void)uc_emu_stop(engine);
        return;
    }
    if (block->bytes != bytes) {
        measure_block(counter, at, bytes, block);
    }
    counter->instructions += block->instructions;
}

/* Instructions that the one at `address` makes conditional (ARMv7-M A7.7.37), and where they lie. */
static uint32_t it_covers(struct call_counter *counter, uint32_t address) {
    const uint32_t half = code_at(counter, address), mask = half & 15u;
    const uint32_t covered = (half >> 8) == 0xbfu && mask != 0u ? 4u - (uint32_t)__builtin_ctz(mask) : 0u;
    counter->it_from = address + 2u;
    counter->it_bytes = 0u;
    for (uint32_t i = 0; i < covered; i++) {
        counter->it_bytes += length_of(code_at(counter, counter->it_from + counter->it_bytes));
    }
    return covered;
}

static void on_code(uc_engine *engine, uint64_t address, uint32_t bytes, void *context) {
    struct call_counter *counter = context;
    const uint32_t at = (uint32_t)address;
    (void)bytes;
    if (at == counter->home || counter->instructions > counter->most) {
        (void)uc_emu_stop(engine);
        return;
    }
    if (at - counter->it_from < counter->it_bytes) {
        return; /* counted with its IT; the hook is not called where the condition does not hold */
    }
    counter->instructions += 1u + it_covers(counter, at);
}

static bool on_bad_memory(uc_engine *engine, uc_mem_type type, uint64_t address, int size, int64_t value,
                          void *context) {
    (void)engine, (void)type, (void)address, (void)size, (void)value;
    ((struct call_counter *)context)->faulted = true;
    return false;
}

/* --- calls --- */

static bool run(struct call_counter *counter, uint32_t entry, uint64_t most, uint64_t *instructions) {
    const uint32_t stack = FRAME_RAM_ADDRESS + FRAME_RAM_BYTES, back = counter->home | 1u;
    counter->instructions = 0u;
    counter->most = most;
    counter->faulted = false;
    counter->it_bytes = 0u;
    counter->depth = 0;
    (void)uc_reg_write(counter->engine, UC_ARM_REG_SP, &stack);
    (void)uc_reg_write(counter->engine, UC_ARM_REG_LR, &back);
    const uc_err error = uc_emu_start(counter->engine, entry | 1u, 0, 0, 0);
    *instructions = counter->instructions;
    return error == UC_ERR_OK && !counter->faulted && counter->instructions <= most;
}

bool call_counter_call(struct call_counter *counter, uint32_t entry, uint64_t most, uint64_t *instructions) {
    if (counter->code_hook != 0) {
        (void)uc_hook_del(counter->engine, counter->code_hook);
        counter->code_hook = 0;
    }
    if (counter->block_hook == 0 && uc_hook_add(counter->engine, &counter->block_hook, UC_HOOK_BLOCK,
                                                (void *)(uintptr_t)on_block, counter, 1, 0) != UC_ERR_OK) {
        return false;
    }
    return run(counter, entry, most, instructions);
}

bool call_counter_call_slowly(struct call_counter *counter, uint32_t entry, uint64_t most, uint64_t *instructions) {
    if (counter->block_hook != 0) {
        (void)uc_hook_del(counter->engine, counter->block_hook);
        counter->block_hook = 0;
    }
    if (counter->code_hook == 0 && uc_hook_add(counter->engine, &counter->code_hook, UC_HOOK_CODE,
                                               (void *)(uintptr_t)on_code, counter, 1, 0) != UC_ERR_OK) {
        return false;
    }
    return run(counter, entry, most, instructions);
}

bool call_counter_write(struct call_counter *counter, uint32_t address, const void *bytes, size_t size) {
    return uc_mem_write(counter->engine, address, bytes, size) == UC_ERR_OK;
}

bool call_counter_read(struct call_counter *counter, uint32_t address, void *bytes, size_t size) {
    return uc_mem_read(counter->engine, address, bytes, size) == UC_ERR_OK;
}

/* --- followed functions --- */

bool call_counter_follow(struct call_counter *counter, const char *name) {
    const uint32_t address = call_counter_symbol(counter, name) & ~1u;
    if (counter->functions == CALL_COUNTER_FUNCTIONS || address - FRAME_FLASH_ADDRESS >= FRAME_FLASH_BYTES) {
        return false;
    }
    counter->block[(address - FRAME_FLASH_ADDRESS) / 2u].function = (int16_t)counter->functions;
    struct call_counter_function *function = &counter->function[counter->functions++];
    (void)snprintf(function->name, sizeof function->name, "%s", name);
    return true;
}

size_t call_counter_followed(const struct call_counter *counter, const struct call_counter_function **functions) {
    *functions = counter->function;
    return counter->functions;
}

void call_counter_reset_counts(struct call_counter *counter) {
    for (size_t i = 0; i < counter->functions; i++) {
        counter->function[i].calls = counter->function[i].total = counter->function[i].worst = 0u;
    }
}

/* --- life --- */

static bool map_memory(uc_engine *engine) {
    return uc_mem_map(engine, FRAME_FLASH_ADDRESS, FRAME_FLASH_BYTES, UC_PROT_READ | UC_PROT_EXEC) == UC_ERR_OK &&
           uc_mem_map(engine, FRAME_TABLE_ADDRESS, FRAME_TABLE_BYTES, UC_PROT_READ) == UC_ERR_OK &&
           uc_mem_map(engine, FRAME_RAM_ADDRESS, FRAME_RAM_BYTES, UC_PROT_READ | UC_PROT_WRITE) == UC_ERR_OK;
}

static bool make_engine(struct call_counter *counter) {
    if (uc_open(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS, &counter->engine) != UC_ERR_OK) {
        return false;
    }
    return uc_ctl_set_cpu_model(counter->engine, UC_CPU_ARM_CORTEX_M4) == UC_ERR_OK && map_memory(counter->engine) &&
           uc_hook_add(counter->engine, &counter->fault_hook, UC_HOOK_MEM_INVALID, (void *)(uintptr_t)on_bad_memory,
                       counter, 1, 0) == UC_ERR_OK;
}

struct call_counter *call_counter_open(const char *elf_path, char *why, size_t why_bytes) {
    struct call_counter *counter = calloc(1, sizeof *counter);
    const char *trouble = NULL;
    if (counter == NULL || (counter->block = malloc(HALFWORDS * sizeof *counter->block)) == NULL) {
        trouble = "out of memory";
    } else if (!make_engine(counter)) {
        trouble = "libunicorn cannot make a Cortex-M4";
    } else if (!read_elf(counter, elf_path) || !load_segments(counter)) {
        trouble = "not a readable 32-bit ELF of the emulated board; build it with make test-programs";
    }
    if (trouble != NULL) {
        (void)snprintf(why, why_bytes, "%s: %s", elf_path, trouble);
        call_counter_close(counter);
        return NULL;
    }
    for (size_t i = 0; i < HALFWORDS; i++) {
        counter->block[i] = (struct block){.function = -1};
    }
    counter->home = call_counter_symbol(counter, "image_return") & ~1u;
    return counter;
}

void call_counter_close(struct call_counter *counter) {
    if (counter == NULL) {
        return;
    }
    if (counter->engine != NULL) {
        (void)uc_close(counter->engine);
    }
    free(counter->elf);
    free(counter->block);
    free(counter);
}
