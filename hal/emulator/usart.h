/* USART3 as a receiver: a byte at a time arrives with its frame's end, at a given bit rate; overrun, framing
 * and noise errors as the chip reports them. RM0440, chapter 37. Sending, FIFO and DMA are not modelled. */
#ifndef TRIBEND_EMULATOR_USART_H
#define TRIBEND_EMULATOR_USART_H

#include "emulator/core.h"

#define USART_QUEUE 8192u /* bytes on their way */

struct usart {
    struct core *core;
    uint32_t irq;
    uint32_t control[3], divisor, status, data;
    uint32_t clock_hz;
    struct usart_byte {
        int64_t at_ticks; /* the stop bit's end */
        uint32_t baud;    /* of the sender */
        uint8_t value;
        bool broken; /* the stop bit was not seen */
    } queue[USART_QUEUE];
    size_t first, count;
    size_t slot;
    /* A byte went into the data register, or would have. */
    void (*heard)(void *context, const struct usart_byte *byte);
    void *context;
    uint32_t delivered, overruns, misread, unheard,
        refused; /* unheard: the receiver was off; refused: queue full */
};

void usart_init(struct usart *usart, struct core *core, uint32_t irq);
void usart_reset(struct usart *usart, uint32_t clock_hz);
void usart_clock(struct usart *usart, uint32_t clock_hz);
bool usart_read(void *context, uint32_t offset, uint32_t *value);
bool usart_write(void *context, uint32_t offset, uint32_t value);
/* The line carries a byte whose frame ends at `at_ticks`, after those that came before. False: no room. */
bool usart_line(struct usart *usart, const struct usart_byte *byte);

#endif
