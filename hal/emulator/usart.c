#include "emulator/usart.h"

#include <string.h>

#define CR1_UE 1u
#define CR1_RE 4u
#define CR1_RXNEIE 0x20u
#define CR3_EIE 1u
#define CR3_OVRDIS (1u << 12)
#define ISR_FE 2u
#define ISR_NE 4u
#define ISR_ORE 8u
#define ISR_RXNE 0x20u
#define ISR_IDLE_LINE 0x006000c0u /* transmitter empty, receiver and transmitter acknowledged */
#define BAUD_OFF_PERMILLE                                                                                    \
    35u /* more than that and the stop bit is missed (RM0440, tolerance of the receiver) */

static void set_line(struct usart *usart) {
    const bool data = (usart->control[0] & CR1_RXNEIE) != 0 && (usart->status & (ISR_RXNE | ISR_ORE)) != 0;
    const bool error =
        (usart->control[2] & CR3_EIE) != 0 && (usart->status & (ISR_FE | ISR_NE | ISR_ORE)) != 0;
    core_line(usart->core, NVIC_FIRST_IRQ + usart->irq, data || error);
}

static bool in_step(const struct usart *usart, uint32_t baud) {
    const uint64_t own = usart->divisor > 0u ? usart->clock_hz / usart->divisor : 0u;
    const uint64_t off = own > baud ? own - baud : baud - own;
    return own > 0u && off * 1000u <= (uint64_t)baud * BAUD_OFF_PERMILLE;
}

static void hear(struct usart *usart, const struct usart_byte *byte) {
    const bool misread = byte->broken || !in_step(usart, byte->baud);
    if ((usart->status & ISR_RXNE) != 0 && (usart->control[2] & CR3_OVRDIS) == 0) {
        usart->status |= ISR_ORE;
        usart->overruns++;
        return;
    }
    usart->data = misread ? (uint32_t)(uint8_t)(byte->value ^ 0x55u) : byte->value;
    usart->status |= ISR_RXNE | (misread ? ISR_FE : 0u);
    usart->misread += misread ? 1u : 0u;
    usart->delivered++;
}

static void plan(struct usart *usart) {
    schedule_set(&usart->core->schedule, usart->slot,
                 usart->count > 0 ? usart->queue[usart->first].at_ticks : SCHEDULE_NEVER);
}

static void on_byte(void *context, int64_t at_ticks) {
    struct usart *usart = context;
    const struct usart_byte byte = usart->queue[usart->first];
    (void)at_ticks;
    usart->first = (usart->first + 1u) % USART_QUEUE;
    usart->count--;
    if ((usart->control[0] & (CR1_UE | CR1_RE)) == (CR1_UE | CR1_RE)) {
        hear(usart, &byte);
        if (usart->heard != NULL) {
            usart->heard(usart->context, &byte);
        }
    } else {
        usart->unheard++;
    }
    set_line(usart);
    plan(usart);
}

void usart_init(struct usart *usart, struct core *core, uint32_t irq) {
    memset(usart, 0, sizeof *usart);
    usart->core = core;
    usart->irq = irq;
    usart->slot = schedule_add(&core->schedule, on_byte, usart);
}

void usart_reset(struct usart *usart, uint32_t clock_hz) {
    memset(usart->control, 0, sizeof usart->control);
    usart->divisor = usart->status = usart->data = 0u;
    usart->clock_hz = clock_hz;
    set_line(usart);
}

void usart_clock(struct usart *usart, uint32_t clock_hz) {
    usart->clock_hz = clock_hz;
}

bool usart_line(struct usart *usart, const struct usart_byte *byte) {
    if (usart->count == USART_QUEUE) {
        usart->refused++;
        return false;
    }
    usart->queue[(usart->first + usart->count++) % USART_QUEUE] = *byte;
    plan(usart);
    return true;
}

bool usart_read(void *context, uint32_t offset, uint32_t *value) {
    struct usart *usart = context;
    switch (offset) {
    case 0x00u:
    case 0x04u:
    case 0x08u:
        *value = usart->control[offset / 4u];
        return true;
    case 0x0cu:
        *value = usart->divisor;
        return true;
    case 0x1cu:
        *value = usart->status | ISR_IDLE_LINE;
        return true;
    case 0x24u:
        *value = usart->data;
        usart->status &= ~ISR_RXNE;
        set_line(usart);
        return true;
    default:
        return false;
    }
}

bool usart_write(void *context, uint32_t offset, uint32_t value) {
    struct usart *usart = context;
    switch (offset) {
    case 0x00u:
    case 0x04u:
    case 0x08u:
        usart->control[offset / 4u] = value;
        break;
    case 0x0cu:
        usart->divisor = value;
        break;
    case 0x20u:
        usart->status &= ~(value & (ISR_FE | ISR_NE | ISR_ORE));
        break;
    default:
        return false;
    }
    set_line(usart);
    return true;
}
