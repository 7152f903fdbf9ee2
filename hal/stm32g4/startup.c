/* From reset to main(): the vector table, the FPU, memory as C wants it, and a painted stack, so that its
 * deepest use shows. */
#include "stm32g4/core.h"
#include "stm32g4/handlers.h"
#include "stm32g4/linker.h"
#include "stm32g4/registers.h"

#define CORE_VECTORS 16u
#define STACK_PAINT 0x57ac4b1du

#define UNUSED                                                                                               \
    { .handler = handler_unexpected }

int main(void);

union vector {
    const uint32_t *stack;
    void (*handler)(void);
};

extern const union vector vectors[CORE_VECTORS + IRQ_COUNT];
__attribute__((section(".vectors"), used)) const union vector vectors[CORE_VECTORS + IRQ_COUNT] = {
    [0] = {.stack = linker_stack_top},
    [1] = {.handler = handler_reset},
    [2] = {.handler = handler_nmi},
    [3] = {.handler = handler_fault}, /* hard, */
    [4] = {.handler = handler_fault}, /* memory, */
    [5] = {.handler = handler_fault}, /* bus and */
    [6] = {.handler = handler_fault}, /* usage fault */
    [7] = UNUSED,
    [8] = UNUSED,
    [9] = UNUSED,
    [10] = UNUSED,
    [11] = UNUSED,
    [12] = UNUSED,
    [13] = UNUSED,
    [14] = UNUSED,
    [15] = UNUSED,
    [CORE_VECTORS + 0u] = UNUSED,
    [CORE_VECTORS + IRQ_PVD] = {.handler = handler_pvd},
    [CORE_VECTORS + 2u] = UNUSED,
    [CORE_VECTORS + 3u] = UNUSED,
    [CORE_VECTORS + 4u] = UNUSED,
    [CORE_VECTORS + 5u] = UNUSED,
    [CORE_VECTORS + 6u] = UNUSED,
    [CORE_VECTORS + 7u] = UNUSED,
    [CORE_VECTORS + 8u] = UNUSED,
    [CORE_VECTORS + 9u] = UNUSED,
    [CORE_VECTORS + 10u] = UNUSED,
    [CORE_VECTORS + 11u] = UNUSED,
    [CORE_VECTORS + 12u] = UNUSED,
    [CORE_VECTORS + 13u] = UNUSED,
    [CORE_VECTORS + 14u] = UNUSED,
    [CORE_VECTORS + 15u] = UNUSED,
    [CORE_VECTORS + 16u] = UNUSED,
    [CORE_VECTORS + 17u] = UNUSED,
    [CORE_VECTORS + 18u] = UNUSED,
    [CORE_VECTORS + 19u] = UNUSED,
    [CORE_VECTORS + 20u] = UNUSED,
    [CORE_VECTORS + IRQ_FDCAN1_IT0] = {.handler = handler_fdcan1},
    [CORE_VECTORS + 22u] = UNUSED,
    [CORE_VECTORS + 23u] = UNUSED,
    [CORE_VECTORS + 24u] = UNUSED,
    [CORE_VECTORS + 25u] = UNUSED,
    [CORE_VECTORS + 26u] = UNUSED,
    [CORE_VECTORS + 27u] = UNUSED,
    [CORE_VECTORS + 28u] = UNUSED,
    [CORE_VECTORS + IRQ_TIM3] = {.handler = handler_tim3},
    [CORE_VECTORS + 30u] = UNUSED,
    [CORE_VECTORS + 31u] = UNUSED,
    [CORE_VECTORS + 32u] = UNUSED,
    [CORE_VECTORS + 33u] = UNUSED,
    [CORE_VECTORS + 34u] = UNUSED,
    [CORE_VECTORS + 35u] = UNUSED,
    [CORE_VECTORS + 36u] = UNUSED,
    [CORE_VECTORS + 37u] = UNUSED,
    [CORE_VECTORS + 38u] = UNUSED,
    [CORE_VECTORS + IRQ_USART3] = {.handler = handler_usart3},
};

static uint32_t words_between(const uint32_t *first, const uint32_t *end) {
    return ((uint32_t)(uintptr_t)end - (uint32_t)(uintptr_t)first) / (uint32_t)sizeof(uint32_t);
}

static void copy(uint32_t *to, const uint32_t *end, const uint32_t *from) {
    const uint32_t words = words_between(to, end);
    for (uint32_t i = 0; i < words; i++) {
        to[i] = from[i];
    }
}

static void fill(uint32_t *first, const uint32_t *end, uint32_t value) {
    const uint32_t words = words_between(first, end);
    for (uint32_t i = 0; i < words; i++) {
        first[i] = value;
    }
}

void handler_reset(void) {
    SCB->cpacr |= SCB_CPACR_FPU;
    core_barrier();
    SCB->vtor = (uint32_t)(uintptr_t)vectors;
    fill(linker_stack_bottom, linker_stack_paint_end, STACK_PAINT);
    copy(linker_data_start, linker_data_end, linker_data_image);
    fill(linker_bss_start, linker_bss_end, 0u);
    (void)main();
    handler_unexpected();
}
