/* The tip sensor's bytes: USART3 receives them by interrupt into a ring, each with the time of its arrival.
 * What they mean is the comms layer's. */
#ifndef TRIBEND_STM32G4_TIP_UART_H
#define TRIBEND_STM32G4_TIP_UART_H

#include <stdint.h>

struct tip_uart_errors {
    uint32_t overrun; /* bytes lost in the receiver */
    uint32_t framing; /* bytes dropped for a wrong stop bit, */
    uint32_t noise;   /* or for noise on the line */
    uint32_t lost;    /* bytes for which there was no room */
};

struct tip_uart_byte {
    uint32_t arrived_us; /* in time_base_now_us() */
    uint8_t byte;
};

void tip_uart_start(uint32_t clock_hz);
/* The next bytes, at most so many; returns how many there were. */
uint32_t tip_uart_take(struct tip_uart_byte *bytes, uint32_t most);
void tip_uart_errors(struct tip_uart_errors *errors);

#endif
