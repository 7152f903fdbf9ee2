#include "emulator/gpio.h"

#define MODE_OUTPUT 1u
#define MODE_ALTERNATE 2u
#define MODE_ANALOG 3u

void gpio_reset(struct gpio *gpio, uint32_t port) {
    static const uint32_t mode[GPIO_PORTS] = {0xabffffffu, 0xfffffebfu, 0xffffffffu};
    static const uint32_t pull[GPIO_PORTS] = {0x64000000u, 0x00000100u, 0u};
    gpio->mode = mode[port];
    gpio->pull = pull[port];
    gpio->type = gpio->speed = gpio->output = gpio->lock = gpio->alternate[0] = gpio->alternate[1] = 0u;
    if (gpio->changed != NULL) {
        gpio->changed(gpio->context);
    }
}

static uint32_t mode_of(const struct gpio *gpio, uint32_t pin) {
    return gpio->mode >> (2u * pin) & 3u;
}

bool gpio_output_high(const struct gpio *gpio, uint32_t pin) {
    return mode_of(gpio, pin) == MODE_OUTPUT && (gpio->output >> pin & 1u) != 0;
}

bool gpio_is_alternate(const struct gpio *gpio, uint32_t pin, uint32_t function) {
    return mode_of(gpio, pin) == MODE_ALTERNATE &&
           (gpio->alternate[pin / 8u] >> (4u * (pin % 8u)) & 15u) == function;
}

bool gpio_is_analog(const struct gpio *gpio, uint32_t pin) {
    return mode_of(gpio, pin) == MODE_ANALOG;
}

static uint32_t levels(const struct gpio *gpio) {
    uint32_t value = 0;
    for (uint32_t pin = 0; pin < 16u; pin++) {
        const bool pulled_up = (gpio->pull >> (2u * pin) & 3u) == 1u;
        const bool high = mode_of(gpio, pin) == MODE_OUTPUT ? (gpio->output >> pin & 1u) != 0
                                                            : mode_of(gpio, pin) != MODE_ANALOG && pulled_up;
        value |= high ? 1u << pin : 0u;
    }
    return value;
}

static uint32_t *word_at(struct gpio *gpio, uint32_t offset) {
    switch (offset) {
    case 0x00u:
        return &gpio->mode;
    case 0x04u:
        return &gpio->type;
    case 0x08u:
        return &gpio->speed;
    case 0x0cu:
        return &gpio->pull;
    case 0x14u:
        return &gpio->output;
    case 0x1cu:
        return &gpio->lock;
    case 0x20u:
        return &gpio->alternate[0];
    case 0x24u:
        return &gpio->alternate[1];
    default:
        return NULL;
    }
}

bool gpio_read(void *context, uint32_t offset, uint32_t *value) {
    struct gpio *gpio = context;
    const uint32_t *word = word_at(gpio, offset);
    if (word != NULL) {
        *value = *word;
        return true;
    }
    *value = offset == 0x10u ? levels(gpio) : 0u;
    return offset == 0x10u || offset == 0x18u;
}

bool gpio_write(void *context, uint32_t offset, uint32_t value) {
    struct gpio *gpio = context;
    uint32_t *word = word_at(gpio, offset);
    if (word != NULL) {
        *word = value;
    } else if (offset == 0x18u) { /* BSRR: a set wins over a reset */
        gpio->output = (gpio->output & ~(value >> 16)) | (value & 0xffffu);
    } else {
        return false;
    }
    if (gpio->changed != NULL) {
        gpio->changed(gpio->context);
    }
    return true;
}
