#include "stm32g4/pins.h"

static void set_field(reg32 *reg, uint32_t pin, uint32_t bits, uint32_t value) {
    const uint32_t shift = pin * bits, mask = (1u << bits) - 1u;
    *reg = (*reg & ~(mask << shift)) | (value << shift);
}

void pins_start(void) {
    RCC->ahb2enr |= RCC_AHB2ENR_GPIOA | RCC_AHB2ENR_GPIOB | RCC_AHB2ENR_GPIOC;
    (void)RCC->ahb2enr;
}

void pins_output_low(struct gpio_registers *port, uint32_t pin) {
    port->bsrr = 1u << (pin + 16u);
    set_field(&port->pupdr, pin, 2u, GPIO_PULL_DOWN);
    set_field(&port->moder, pin, 2u, GPIO_MODE_OUTPUT);
}

void pins_alternate(struct gpio_registers *port, uint32_t pin, uint32_t function, uint32_t pull) {
    set_field(&port->afr[pin / 8u], pin % 8u, 4u, function);
    set_field(&port->pupdr, pin, 2u, pull);
    set_field(&port->moder, pin, 2u, GPIO_MODE_ALTERNATE);
}

void pins_analog(struct gpio_registers *port, uint32_t pin) {
    set_field(&port->pupdr, pin, 2u, 0u);
    set_field(&port->moder, pin, 2u, GPIO_MODE_ANALOG);
}
