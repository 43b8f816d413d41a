/* Which pin does what: configures a pin's mode, pull and alternate function (RM0090 section 8.4). */
#ifndef PINS_H
#define PINS_H

#include <stdbool.h>
#include <stdint.h>

#include "registers.h"
#include "wiring.h"

enum pin_pull { PULL_NONE = 0, PULL_UP = 1, PULL_DOWN = 2 };

/* Port and number of one of wiring.h's pins. */
static inline struct gpio *pin_port(uint32_t pin)
{
    return GPIO(pin / 16u);
}

static inline uint32_t pin_number(uint32_t pin)
{
    return pin % 16u;
}

/* Gives bits of width `width` at place `index` of a register the value `value`. */
static inline void pin_field(reg32 *reg, uint32_t index, uint32_t width, uint32_t value)
{
    const uint32_t mask = ((1u << width) - 1u) << (index * width);
    *reg = (*reg & ~mask) | (value << (index * width));
}

/* Chooses the peripheral that may have a pin, push-pull at medium speed (25 MHz: 20 kHz and 921600 baud lie
 * far below). The pin goes over to it with its mode. */
static inline void pin_prepare(uint32_t pin, uint32_t function, enum pin_pull pull)
{
    struct gpio *const port = pin_port(pin);
    const uint32_t number = pin_number(pin);
    pin_field(&port->pupdr, number, 2, (uint32_t)pull);
    pin_field(&port->ospeedr, number, 2, 1);
    pin_field(&port->afr[number / 8u], number % 8u, 4, function);
}

/* Hands a pin to a peripheral. */
static inline void pin_to_peripheral(uint32_t pin, uint32_t function, enum pin_pull pull)
{
    pin_prepare(pin, function, pull);
    pin_field(&pin_port(pin)->moder, pin_number(pin), 2, 2);
}

static inline void pin_to_analogue(uint32_t pin)
{
    pin_field(&pin_port(pin)->pupdr, pin_number(pin), 2, PULL_NONE);
    pin_field(&pin_port(pin)->moder, pin_number(pin), 2, 3);
}

static inline void pin_to_output(uint32_t pin)
{
    pin_field(&pin_port(pin)->moder, pin_number(pin), 2, 1);
}

static inline bool pin_is_high(uint32_t pin)
{
    return (pin_port(pin)->idr & 1u << pin_number(pin)) != 0;
}

#endif
