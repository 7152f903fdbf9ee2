/* A program that tests the emulated core from within: masks, priorities, nesting, interrupts inside IT
 * blocks, floating point and flags across pre-emption, both stacks, SVC, PendSV, faults and WFI. It uses
 * nothing but the core, so that it runs the same in the emulator and in QEMU; its counters do not depend on
 * when an interrupt comes. It writes them by semihosting and exits with 0 when all are as the architecture
 * has them. Not part of the firmware. */
#include <stdbool.h>
#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define ICSR REGISTER(0xe000ed04u)
#define AIRCR REGISTER(0xe000ed0cu)
#define CCR REGISTER(0xe000ed14u)
#define SHCSR REGISTER(0xe000ed24u)
#define CFSR REGISTER(0xe000ed28u)
#define HFSR REGISTER(0xe000ed2cu)
#define CPACR REGISTER(0xe000ed88u)
#define SYSTICK_CONTROL REGISTER(0xe000e010u)
#define SYSTICK_RELOAD REGISTER(0xe000e014u)
#define SYSTICK_VALUE REGISTER(0xe000e018u)
#define NVIC_ENABLE REGISTER(0xe000e100u)
#define NVIC_PEND REGISTER(0xe000e200u)
#define NVIC_PRIORITY(irq) (*(volatile uint8_t *)(0xe000e400u + (irq)))
#define SYSTEM_PRIORITY(exception) (*(volatile uint8_t *)(0xe000ed18u + (exception)-4u))

#define PRE_EMPTIONS 2000u
#define TICK 3001u

static volatile uint32_t sequence; /* of handlers, a decimal digit each */
static volatile uint32_t ticks, wakes, service_calls, service_sum, service_return, switches;
static volatile uint32_t faults_seen, fault_status, hard_fault_status, faults_hard;
static volatile uint32_t active_in_handler;
static volatile float float_sink;
static volatile uint32_t handler_fpscr;
static uint32_t failures;
static uint32_t process_stack[256] __attribute__((aligned(8)));

static void note(uint32_t digit) {
    sequence = sequence * 10u + digit;
}

/* --- semihosting --- */

static void semihost(uint32_t operation, const void *argument) {
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}

static void finish(uint32_t status) {
    const uint32_t block[2] = {0x20026u, status};
    semihost(0x20u, block);
    for (;;) {
    }
}

static void show(const char *name, uint32_t value, uint32_t expected) {
    static char digits[16];
    uint32_t at = 12u;
    digits[12] = '\n';
    digits[13] = '\0';
    semihost(0x04u, name);
    do {
        digits[--at] = (char)('0' + value % 10u);
        value /= 10u;
    } while (value > 0u && at > 1u);
    digits[--at] = ' ';
    semihost(0x04u, &digits[at]);
    (void)expected;
}

static void check(const char *name, uint32_t value, uint32_t expected) {
    show(name, value, expected);
    if (value != expected) {
        failures++;
        semihost(0x04u, "  failed: expected ");
        show("", expected, expected);
    }
}

/* --- handlers --- */

static uint32_t floats_kept(uint32_t rounds) {
    uint32_t wrong = 0;
    for (uint32_t i = 0; i < rounds; i++) {
        float sum = 1.0f, weight = 0.5f;
        for (uint32_t k = 0; k < 24u; k++) {
            sum += weight;
            weight *= 0.5f;
        }
        wrong += sum == 2.0f ? 0u : 1u;
    }
    return wrong;
}

/* Uses every caller-saved register, the flags, GE bits, an IT block and FPSCR. */
void on_systick(void) {
    uint32_t fpscr;
    ticks++;
    __asm__ volatile("vmrs %0, fpscr" : "=r"(fpscr));
    handler_fpscr |= fpscr;
    float_sink = float_sink * 3.0f + (float)ticks;
    __asm__ volatile(
        "mvn r0, #0\n uadd8 r0, r0, r0\n movs r0, #0\n ittt eq\n moveq r1, #1\n moveq r2, #2\n moveq r3, #3\n"
        "mov r12, #12\n adds r0, r0, #1\n"
        "vmov s0, r1\n vmov s1, r2\n vmov s2, r3\n vmov s3, r1\n vmov s4, r1\n vmov s5, r1\n vmov s6, r1\n"
        "vmov s7, r1\n vmov s8, r1\n vmov s9, r1\n vmov s10, r1\n vmov s11, r1\n vmov s12, r1\n vmov s13, "
        "r1\n"
        "vmov s14, r1\n vmov s15, r1\n mvn r1, #0\n vmsr fpscr, r1\n" ::
            : "r0", "r1", "r2", "r3", "r12", "cc", "s0", "s1", "s2", "s3", "s4", "s5", "s6", "s7", "s8", "s9",
              "s10", "s11", "s12", "s13", "s14", "s15");
    if (ticks % 7u == 0u) {
        ICSR = 1u << 28; /* PendSV */
    }
}

void on_pendsv(void) {
    switches++;
    note(9u);
}

static void on_irq_0(void) {
    note(1u);
    active_in_handler = ICSR & 0x1ffu;
}

static void on_irq_1(void) { /* low priority: raises 2 (high) and 3 (equal) */
    note(2u);
    NVIC_PEND = 1u << 2;
    __asm__ volatile("dsb\n isb");
    note(3u);
}

static void on_irq_2(void) {
    note(4u);
    NVIC_PEND = 1u << 3;
    __asm__ volatile("dsb\n isb");
    note(5u);
}

static void on_irq_3(void) {
    note(6u);
}

/* The frame's r0 is the first argument; SVC's number lies before the return address. */
static __attribute__((used)) void service(uint32_t *frame, uint32_t exception_return) {
    service_calls++;
    service_sum += *((const uint8_t *)frame[6] - 2);
    service_return = exception_return & 0xffu;
    frame[0] = frame[0] + frame[1];
}

__attribute__((naked)) void on_service(void) {
    __asm__ volatile("mov r1, lr\n tst lr, #4\n ite eq\n mrseq r0, msp\n mrsne r0, psp\n b service");
}

/* Goes on at the label whose address the faulting code left in r4's place: r0 of the frame. */
static __attribute__((used)) void fault(uint32_t *frame, uint32_t hard) {
    faults_seen++;
    faults_hard += hard;
    fault_status = CFSR;
    hard_fault_status = HFSR;
    CFSR = fault_status;
    HFSR = hard_fault_status;
    CPACR = 0xfu << 20;
    frame[6] = frame[0];
}

__attribute__((naked)) void on_hard_fault(void) {
    __asm__ volatile("mov r1, #1\n tst lr, #4\n ite eq\n mrseq r0, msp\n mrsne r0, psp\n b fault");
}

__attribute__((naked)) void on_fault(void) {
    __asm__ volatile("mov r1, #0\n tst lr, #4\n ite eq\n mrseq r0, msp\n mrsne r0, psp\n b fault");
}

static void on_nothing(void) {
    finish(99u);
}

/* --- the tests --- */

static void mask_interrupts(void) {
    __asm__ volatile("cpsid i" ::: "memory");
}

static void unmask_interrupts(void) {
    __asm__ volatile("cpsie i\n isb" ::: "memory");
}

static void set_basepri(uint32_t level) {
    __asm__ volatile("msr basepri, %0\n isb" ::"r"(level) : "memory");
}

static void test_primask(void) {
    sequence = 7u;
    mask_interrupts();
    NVIC_PEND = 1u << 0;
    __asm__ volatile("dsb\n isb");
    check("masked by PRIMASK", sequence, 7u);
    unmask_interrupts();
    check("after PRIMASK", sequence, 71u);
    check("active number in the handler", active_in_handler, 16u);
}

static void test_basepri(void) {
    sequence = 7u;
    set_basepri(0x60u); /* irq 0 is at 0x40, irq 3 at 0x80 */
    NVIC_PEND = 1u << 0 | 1u << 3;
    __asm__ volatile("dsb\n isb");
    check("under BASEPRI", sequence, 71u);
    set_basepri(0u);
    check("after BASEPRI", sequence, 716u);
}

static void test_nesting(void) {
    sequence = 7u;
    NVIC_PEND = 1u << 1;
    __asm__ volatile("dsb\n isb");
    check("nesting and tail-chaining", sequence, 724536u);
    sequence = 7u;
    mask_interrupts();
    NVIC_PEND = 1u << 3 | 1u << 1 | 1u << 0;
    unmask_interrupts();
    check("order of equal priorities", sequence, 71245366u / 10u);
}

/* An interrupt that is raised, and taken, in the middle of an IT block. */
static void test_it_block(void) {
    uint32_t wrong = 0;
    for (uint32_t i = 0; i < 500u; i++) {
        uint32_t a = 0, b = 0;
        __asm__ volatile(
            "cmp %2, %2\n itttt eq\n streq %3, [%4]\n isbeq\n addeq %0, %0, #1\n addeq %1, %1, #2\n"
            "ittee ne\n addne %0, %0, #4\n addne %1, %1, #8\n addeq %0, %0, #16\n addeq %1, %1, #32\n"
            : "+r"(a), "+r"(b)
            : "r"(i), "r"(1u << 0), "r"(&NVIC_PEND)
            : "cc", "memory");
        sequence = 0u;
        wrong += a == 17u && b == 34u ? 0u : 1u;
    }
    check("IT blocks gone wrong", wrong, 0u);
}

static void systick_on(void) {
    SYSTICK_RELOAD = TICK;
    SYSTICK_VALUE = 0u;
    SYSTICK_CONTROL = 7u;
}

static void test_floats(void) {
    uint32_t wrong = 0, fpscr = 0, kept = 1u << 22; /* round towards plus infinity */
    ticks = 0u;
    sequence = 0u;
    switches = 0u;
    handler_fpscr = 0u;
    __asm__ volatile("vmsr fpscr, %0" ::"r"(kept));
    systick_on();
    while (ticks < PRE_EMPTIONS) {
        wrong += floats_kept(10u);
        __asm__ volatile("vmrs %0, fpscr" : "=r"(fpscr));
        wrong += (fpscr & 0x00c00000u) == kept ? 0u : 1u;
    }
    SYSTICK_CONTROL = 0u;
    __asm__ volatile("vmsr fpscr, %0" ::"r"(0u));
    check("floats gone wrong", wrong, 0u);
    check("FPSCR in the handler", handler_fpscr & 0x00c00000u, 0u);
    check("switches", switches, PRE_EMPTIONS / 7u);
}

static void test_flags(void) {
    uint32_t wrong = 0;
    ticks = 0u;
    systick_on();
    while (ticks < PRE_EMPTIONS) {
        uint32_t selected, carry;
        __asm__ volatile("uadd8 %0, %2, %3\n nop\n b 1f\n 1: nop\n b 2f\n 2: sel %0, %4, %5\n"
                         "cmp %4, %5\n b 3f\n 3: nop\n b 4f\n 4: ite cs\n movcs %1, #1\n movcc %1, #0\n"
                         : "=&r"(selected), "=&r"(carry)
                         : "r"(0xff00ff00u), "r"(0x01010101u), "r"(0xaaaaaaaau), "r"(0x55555555u)
                         : "cc");
        wrong += selected == 0xaa55aa55u && carry == 1u ? 0u : 1u;
    }
    SYSTICK_CONTROL = 0u;
    check("flags gone wrong", wrong, 0u);
}

static uint32_t call_service(uint32_t a, uint32_t b) {
    register uint32_t r0 __asm__("r0") = a;
    register uint32_t r1 __asm__("r1") = b;
    __asm__ volatile("svc 5" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static void test_stacks(void) {
    uint32_t msp_before, msp_after;
    check("service on the main stack", call_service(40u, 2u), 42u);
    check("return to thread, MSP", service_return | 0x10u, 0xf9u);
    __asm__ volatile("mrs %0, msp" : "=r"(msp_before));
    __asm__ volatile(
        "msr psp, %0\n mrs r0, control\n orr r0, r0, #2\n msr control, r0\n isb" ::"r"(&process_stack[256])
        : "r0", "memory");
    const uint32_t answer = call_service(20u, 3u);
    for (ticks = 0u, SYSTICK_CONTROL = 7u; ticks < 100u;) {
    }
    SYSTICK_CONTROL = 0u;
    __asm__ volatile("mrs %0, msp" : "=r"(msp_after));
    __asm__ volatile("mrs r0, control\n bic r0, r0, #2\n msr control, r0\n isb" ::: "r0", "memory");
    check("service on the process stack", answer, 23u);
    check("return to thread, PSP", service_return | 0x10u, 0xfdu);
    check("main stack untouched", msp_after - msp_before, 0u);
    check("services", service_calls, 2u);
    check("service numbers", service_sum, 10u);
}

/* The frame of an exception is aligned to 8 bytes, and the stack pointer comes back as it was. */
static void test_alignment(void) {
    uint32_t before, after;
    CCR |= 0x200u;
    __asm__ volatile(
        "sub sp, sp, #4\n mov %0, sp\n movs r0, #1\n movs r1, #2\n svc 1\n mov %1, sp\n add sp, sp, #4"
        : "=&r"(before), "=&r"(after)::"r0", "r1", "memory");
    check("stack pointer comes back", after - before, 0u);
}

static void touch_nothing(void) { /* a load from where there is no memory */
    __asm__ volatile(
        "adr r0, 1f\n orr r0, r0, #1\n mov r1, #0x60000000\n ldr r2, [r1]\n nop\n .balign 4\n 1: nop" ::
            : "r0", "r1", "r2", "memory");
}

static void undefined_instruction(void) {
    __asm__ volatile("adr r0, 1f\n orr r0, r0, #1\n udf #7\n nop\n .balign 4\n 1: nop" ::: "r0", "memory");
}

static void float_without_coprocessor(void) {
    CPACR = 0u;
    __asm__ volatile(
        "dsb\n isb\n adr r0, 1f\n orr r0, r0, #1\n b 2f\n 2: vmov.f32 s0, #1.0\n nop\n .balign 4\n 1: nop" ::
            : "r0", "s0", "memory");
}

static void test_faults(void) {
    undefined_instruction();
    check("undefined instruction", fault_status, 1u << 16);
    check("was escalated", hard_fault_status, 1u << 30);
    SHCSR = 7u << 16;
    undefined_instruction();
    check("usage fault", fault_status, 1u << 16);
    check("was not escalated", hard_fault_status, 0u);
    float_without_coprocessor();
    check("no coprocessor", fault_status, 1u << 19);
    touch_nothing();
    check("bus fault", fault_status & 0xff00u, 0x8200u);
    SHCSR = 0u;
    touch_nothing();
    check("bus fault, escalated", hard_fault_status, 1u << 30);
    check("faults", faults_seen, 5u);
    check("hard faults", faults_hard, 2u);
}

static void test_wfi(void) {
    ticks = 0u;
    wakes = 0u;
    systick_on();
    while (wakes < 50u) {
        __asm__ volatile("wfi");
        wakes++;
    }
    const uint32_t seen = ticks;
    mask_interrupts();
    __asm__ volatile("wfi");
    const uint32_t masked = ticks;
    SYSTICK_CONTROL = 5u;
    unmask_interrupts();
    check("a tick each WFI", seen, 50u);
    check("WFI ends under PRIMASK", masked, 50u);
    check("the tick comes after", ticks >= 51u, 1u);
    SYSTICK_CONTROL = 0u;
}

void selftest_start(void) {
    CPACR = 0xfu << 20;
    __asm__ volatile("dsb\n isb");
    for (volatile uint32_t *word = (volatile uint32_t *)0x20000000u; word < (volatile uint32_t *)0x20002000u;
         word++) {
        *word = 0u;
    }
    AIRCR = 0x05fa0300u;
    NVIC_PRIORITY(0) = 0x40u;
    NVIC_PRIORITY(1) = 0x80u;
    NVIC_PRIORITY(2) = 0x20u;
    NVIC_PRIORITY(3) = 0x80u;
    SYSTEM_PRIORITY(14) = 0xf0u;
    SYSTEM_PRIORITY(15) = 0x30u;
    NVIC_ENABLE = 0xfu;
    test_primask();
    test_basepri();
    test_nesting();
    test_it_block();
    test_floats();
    test_flags();
    test_stacks();
    test_alignment();
    test_faults();
    test_wfi();
    check("failures", failures, 0u);
    finish(failures);
}

struct vectors {
    uint32_t stack;
    void (*handler[15 + 4])(void);
};

__attribute__((section(".vectors"), used)) static const struct vectors vectors = {
    0x20010000u,
    {selftest_start, on_nothing, on_hard_fault, on_fault, on_fault, on_fault, 0, 0, 0, 0, on_service, 0, 0,
     on_pendsv, on_systick, on_irq_0, on_irq_1, on_irq_2, on_irq_3}};
