#include "stm32g4/tip_uart.h"

#include "stm32g4/conversions.h"
#include "stm32g4/core.h"
#include "stm32g4/handlers.h"
#include "stm32g4/pins.h"
#include "stm32g4/registers.h"
#include "stm32g4/time_base.h"

#define BAUD 115200u
#define RING 256u /* 22 ms of bytes; a power of two */
#define PIN 11u
#define FUNCTION 7u
#define PRIORITY 2u

static struct tip_uart_byte ring[RING];
static volatile uint32_t written; /* by the interrupt alone */
static volatile uint32_t taken;   /* by the control step alone */
static struct tip_uart_errors counted;

void tip_uart_start(uint32_t clock_hz) {
    RCC->apb1enr1 |= RCC_APB1ENR1_USART3;
    (void)RCC->apb1enr1;
    pins_alternate(GPIOC, PIN, FUNCTION, GPIO_PULL_UP); /* an open line is idle, not a break */
    USART3->cr1 = 0u;
    USART3->brr = conversions_baud_divisor(clock_hz, BAUD);
    USART3->cr3 = USART_CR3_EIE;
    USART3->cr1 = USART_CR1_UE | USART_CR1_RE | USART_CR1_RXNEIE;
    core_enable_interrupt(IRQ_USART3, PRIORITY);
}

static void keep(uint8_t byte) {
    if (written - taken >= RING) {
        counted.lost++;
        return;
    }
    ring[written % RING] = (struct tip_uart_byte){.arrived_us = time_base_now_us(), .byte = byte};
    written = written + 1u;
}

void handler_usart3(void) {
    const uint32_t status = USART3->isr;
    USART3->icr = status & USART_ICR_ERRORS;
    counted.overrun += (status & USART_ISR_ORE) != 0u ? 1u : 0u; /* the byte that waits is a good one */
    counted.framing += (status & USART_ISR_FE) != 0u ? 1u : 0u;
    counted.noise += (status & USART_ISR_NE) != 0u ? 1u : 0u;
    if ((status & USART_ISR_RXNE) == 0u) {
        return;
    }
    const uint8_t byte = (uint8_t)USART3->rdr;
    if ((status & (USART_ISR_FE | USART_ISR_NE)) == 0u) {
        keep(byte);
    }
}

uint32_t tip_uart_take(struct tip_uart_byte *bytes, uint32_t most) {
    const uint32_t from = taken, waiting = written - from;
    const uint32_t count = waiting < most ? waiting : most;
    for (uint32_t i = 0; i < count; i++) {
        bytes[i] = ring[(from + i) % RING];
    }
    taken = from + count;
    return count;
}

void tip_uart_errors(struct tip_uart_errors *errors) {
    *errors = counted;
}
