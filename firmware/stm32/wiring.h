/* What is wired to the chip: the board's header, refused where the chip cannot do what it says. */
#ifndef WIRING_H
#define WIRING_H

#include "pin_functions.h"
#include "registers.h"

/* A pin is a number, its port in the upper bits; a mask of 64 bits holds them. */
#define PA(number) ((uint32_t)(number))
#define PB(number) (0x10u + (uint32_t)(number))
#define PC(number) (0x20u + (uint32_t)(number))

#define PIN_BIT(pin) (1uLL << (pin))
#define NO_PINS      0uLL

/* How a motor driver is told what to do; motors.c. */
#define DRIVER_IN_IN        0u
#define DRIVER_PWM_DIR      1u
#define DRIVER_PHASE_ENABLE 2u

#include TRUING_BOARD_HEADER
#include "wiring_checks.h"

/* The level at which the drivers are on. The resistor at the pin pulls to the other one. */
#ifndef DRIVER_ENABLE_ACTIVE_LOW
#define DRIVER_ENABLE_ACTIVE_LOW 0
#endif

#define TIMER(timer) ((timer) == 1u ? TIM1 : (timer) == 8u ? TIM8 : (timer) == 3u ? TIM3 : TIM4)

#define BREAK_PIN_OF(timer) ((timer) == 1u ? BOARD_TIM1_BREAK_PIN : BOARD_TIM8_BREAK_PIN)

/* The timers whose break holds a bridge. */
#define HOLDS_BRIDGE(timer)  (BOARD_LEFT_TIMER == (timer) || BOARD_RIGHT_TIMER == (timer))
#define BRIDGES_ON_ONE_TIMER (BOARD_LEFT_TIMER == BOARD_RIGHT_TIMER)

/* The enable pin has a timer to itself, whose main output it is; otherwise it shares a bridge's. */
#define ENABLE_HAS_OWN_TIMER (!HOLDS_BRIDGE(BOARD_ENABLE_TIMER))

#endif
