/* The interrupt controller and the system control block of a Cortex-M4: which exceptions are enabled, pending
 * and active, at which priorities, and which of them is to run next (ARMv7-M Architecture Reference Manual,
 * B1.5 and B3). SysTick is here too, on the core's clock. Pure state: stacking and unstacking are in
 * exceptions.h. */
#ifndef TRIBEND_EMULATOR_NVIC_H
#define TRIBEND_EMULATOR_NVIC_H

#include <stdbool.h>
#include <stdint.h>

#define NVIC_PERIPHERALS 102u /* interrupts of the STM32G474 */
#define NVIC_FIRST_IRQ 16u
#define NVIC_EXCEPTIONS (NVIC_FIRST_IRQ + NVIC_PERIPHERALS)
#define NVIC_PRIORITY_BITS 4u
#define NVIC_THREAD 256 /* priority of no exception at all */
#define NVIC_NONE 0u

enum nvic_exception {
    EXCEPTION_RESET = 1,
    EXCEPTION_NMI = 2,
    EXCEPTION_HARD_FAULT = 3,
    EXCEPTION_MEMORY_FAULT = 4,
    EXCEPTION_BUS_FAULT = 5,
    EXCEPTION_USAGE_FAULT = 6,
    EXCEPTION_SVCALL = 11,
    EXCEPTION_DEBUG = 12,
    EXCEPTION_PENDSV = 14,
    EXCEPTION_SYSTICK = 15
};

/* CFSR and HFSR bits that the emulator sets. */
#define CFSR_IACCVIOL 0x00000001u
#define CFSR_IBUSERR 0x00000100u
#define CFSR_PRECISERR 0x00000200u
#define CFSR_UNSTKERR 0x00000800u
#define CFSR_STKERR 0x00001000u
#define CFSR_BFARVALID 0x00008000u
#define CFSR_UNDEFINSTR 0x00010000u
#define CFSR_INVSTATE 0x00020000u
#define CFSR_INVPC 0x00040000u
#define CFSR_NOCP 0x00080000u
#define CFSR_UNALIGNED 0x01000000u
#define HFSR_VECTTBL 0x00000002u
#define HFSR_FORCED 0x40000000u
#define HFSR_DEBUGEVT 0x80000000u

/* The core's own mask registers at the moment of asking. */
struct nvic_masks {
    bool primask;
    bool faultmask;
    uint8_t basepri;
};

struct nvic {
    bool enabled[NVIC_EXCEPTIONS];
    bool pending[NVIC_EXCEPTIONS];
    bool active[NVIC_EXCEPTIONS];
    bool line[NVIC_EXCEPTIONS]; /* the peripheral's request as it stands */
    int16_t priority[NVIC_EXCEPTIONS];
    uint32_t pending_count; /* enabled and pending: 0 in nearly every look */
    uint32_t priority_group;
    uint32_t vector_table;
    uint32_t configuration;  /* CCR */
    uint32_t system_control; /* SCR */
    uint32_t fault_enables;  /* SHCSR 16 to 18 */
    uint32_t fault_status;   /* CFSR */
    uint32_t hard_fault_status;
    uint32_t debug_fault_status, memory_fault_address, bus_fault_address;
    uint32_t coprocessors; /* CPACR */
    bool reset_requested;
    uint32_t systick_control, systick_reload;
    int64_t systick_zero_ticks; /* when it reached, or will have reached, zero */
    bool systick_counted;
};

void nvic_reset(struct nvic *nvic);
/* The request line of a peripheral's interrupt, or of the NMI; its rise makes it pending. */
void nvic_line(struct nvic *nvic, uint32_t exception, bool level);
void nvic_pend(struct nvic *nvic, uint32_t exception);
void nvic_unpend(struct nvic *nvic, uint32_t exception);
/* Of what runs, masks included; NVIC_THREAD when nothing does. */
int nvic_running_priority(const struct nvic *nvic, const struct nvic_masks *masks);
/* Group priority that decides on pre-emption. */
int nvic_group_priority(const struct nvic *nvic, uint32_t exception);
/* The pending exception that pre-empts what runs under these masks, or NVIC_NONE. */
uint32_t nvic_next(const struct nvic *nvic, const struct nvic_masks *masks);
/* It starts: no longer pending, active. */
void nvic_enter(struct nvic *nvic, uint32_t exception);
/* It ends; a line that still asks makes it pending again. */
void nvic_leave(struct nvic *nvic, uint32_t exception);
bool nvic_any_active(const struct nvic *nvic);
/* The fault as configured: itself where it is enabled and may pre-empt, else the hard fault. */
uint32_t nvic_fault(struct nvic *nvic, uint32_t exception, uint32_t status, const struct nvic_masks *masks);

/* Registers from 0xe000e000 on. `running`: the active exception. False: no such register. SysTick's own are
 * in core.c. */
bool nvic_read(struct nvic *nvic, uint32_t offset, uint32_t running, uint32_t *value);
bool nvic_write(struct nvic *nvic, uint32_t offset, uint32_t value);

#endif
