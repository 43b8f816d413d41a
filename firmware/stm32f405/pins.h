/* Which pin does what: configures a pin's mode, pull and alternate function (RM0090 section 8.4). */
#ifndef PINS_H
#define PINS_H

#include "registers.h"

enum pin_pull { PULL_NONE = 0, PULL_UP = 1, PULL_DOWN = 2 };

/* Gives bits of width `width` at place `index` of a register the value `value`. */
static inline void pin_field(reg32 *reg, uint32_t index, uint32_t width, uint32_t value)
{
    const uint32_t mask = ((1u << width) - 1u) << (index * width);
    *reg = (*reg & ~mask) | (value << (index * width));
}

/* Chooses the peripheral that may have a pin, push-pull at medium speed (25 MHz: 20 kHz and 921600 baud lie
 * far below). The pin goes over to it with its mode. */
static inline void pin_prepare(struct gpio *port, uint32_t pin, uint32_t function, enum pin_pull pull)
{
    pin_field(&port->pupdr, pin, 2, (uint32_t)pull);
    pin_field(&port->ospeedr, pin, 2, 1);
    pin_field(&port->afr[pin / 8u], pin % 8u, 4, function);
}

/* Hands a pin to a peripheral. */
static inline void pin_to_peripheral(struct gpio *port, uint32_t pin, uint32_t function, enum pin_pull pull)
{
    pin_prepare(port, pin, function, pull);
    pin_field(&port->moder, pin, 2, 2);
}

static inline void pin_to_analogue(struct gpio *port, uint32_t pin)
{
    pin_field(&port->pupdr, pin, 2, PULL_NONE);
    pin_field(&port->moder, pin, 2, 3);
}

static inline void pin_to_output(struct gpio *port, uint32_t pin)
{
    pin_field(&port->moder, pin, 2, 1);
}

#endif
