/* Refuses a board's header that gives a pin twice, or a pin to what cannot reach it; what reaches what
 * says the chip's pin_functions.h. */
#ifndef WIRING_CHECKS_H
#define WIRING_CHECKS_H

/* What is compared are a header's numbers: that they agree is the point.
 * NOLINTBEGIN(misc-redundant-expression) */
_Static_assert(BOARD_LEFT_TIMER == 1u || BOARD_LEFT_TIMER == 8u,
               "left bridge: TIM1 or TIM8, which have a break");
_Static_assert(BOARD_RIGHT_TIMER == 1u || BOARD_RIGHT_TIMER == 8u,
               "right bridge: TIM1 or TIM8, which have a break");
_Static_assert(BOARD_LEFT_CHANNEL == 1u || BOARD_LEFT_CHANNEL == 3u, "left bridge: channels 1, 2 or 3, 4");
_Static_assert(BOARD_RIGHT_CHANNEL == 1u || BOARD_RIGHT_CHANNEL == 3u, "right bridge: channels 1, 2 or 3, 4");
_Static_assert(REACHES_BRIDGE(BOARD_LEFT_TIMER, BOARD_LEFT_CHANNEL, BOARD_LEFT_PIN_1),
               "left bridge: the timer's channel does not come out on the first pin");
_Static_assert(REACHES_BRIDGE(BOARD_LEFT_TIMER, BOARD_LEFT_CHANNEL + 1u, BOARD_LEFT_PIN_2),
               "left bridge: the timer's channel does not come out on the second pin");
_Static_assert(REACHES_BRIDGE(BOARD_RIGHT_TIMER, BOARD_RIGHT_CHANNEL, BOARD_RIGHT_PIN_1),
               "right bridge: the timer's channel does not come out on the first pin");
_Static_assert(REACHES_BRIDGE(BOARD_RIGHT_TIMER, BOARD_RIGHT_CHANNEL + 1u, BOARD_RIGHT_PIN_2),
               "right bridge: the timer's channel does not come out on the second pin");
_Static_assert(REACHES_BRIDGE(BOARD_ENABLE_TIMER, BOARD_ENABLE_CHANNEL, BOARD_ENABLE_PIN),
               "driver enable: TIM1's or TIM8's channel does not come out on the pin");
/* Two channels share a register, which either the bridges or the enable pin has to itself. */
_Static_assert((BOARD_ENABLE_TIMER != BOARD_LEFT_TIMER ||
                (BOARD_ENABLE_CHANNEL > 2u) != (BOARD_LEFT_CHANNEL > 2u)) &&
                   (BOARD_ENABLE_TIMER != BOARD_RIGHT_TIMER ||
                    (BOARD_ENABLE_CHANNEL > 2u) != (BOARD_RIGHT_CHANNEL > 2u)),
               "driver enable: shares a pair of channels with a bridge");
_Static_assert(BOARD_ENABLE_TIMER == 8u || BOARD_LEFT_TIMER == 8u || BOARD_RIGHT_TIMER == 8u,
               "emergency stop: TIM8 drives neither a bridge nor the enable pin");
_Static_assert(REACHES_BREAK(1u, BOARD_TIM1_BREAK_PIN), "emergency stop: " TIM1_BREAK_PINS);
_Static_assert(REACHES_BREAK(8u, BOARD_TIM8_BREAK_PIN), "emergency stop: " TIM8_BREAK_PINS);
_Static_assert(BOARD_LEFT_ENCODER_TIMER != BOARD_RIGHT_ENCODER_TIMER, "encoders: one timer each");
_Static_assert(REACHES_ENCODER(BOARD_LEFT_ENCODER_TIMER, BOARD_LEFT_ENCODER_A, BOARD_LEFT_ENCODER_B),
               "left encoder: not channels 1 and 2 of TIM3 or TIM4");
_Static_assert(REACHES_ENCODER(BOARD_RIGHT_ENCODER_TIMER, BOARD_RIGHT_ENCODER_A, BOARD_RIGHT_ENCODER_B),
               "right encoder: not channels 1 and 2 of TIM3 or TIM4");
_Static_assert(REACHES_ADC1(BOARD_BATTERY_PIN), "battery: the pin is no input of ADC1");
_Static_assert(REACHES_SERIAL(BOARD_SERIAL_TX, BOARD_SERIAL_RX), "serial port: " SERIAL_PINS);
_Static_assert(REACHES_CAN(BOARD_CAN_RX, BOARD_CAN_TX), "CAN: " CAN_PINS);
_Static_assert(CRYSTAL_SUITS(BOARD_CRYSTAL_HZ), "crystal: " CRYSTALS);

_Static_assert(sizeof BOARD_NAME <= 16u, "board's name: 15 characters at most");
_Static_assert(BOARD_DRIVER == DRIVER_IN_IN || BOARD_DRIVER == DRIVER_PWM_DIR ||
                   BOARD_DRIVER == DRIVER_PHASE_ENABLE,
               "driver: DRIVER_IN_IN, DRIVER_PWM_DIR or DRIVER_PHASE_ENABLE");

/* SWDIO and SWCLK stay the probe's. Bits that differ have a sum that is their union. */
#define SUM_OF_PINS                                                                                          \
    (PIN_BIT(PA(13)) + PIN_BIT(PA(14)) + PIN_BIT(BOARD_LEFT_PIN_1) + PIN_BIT(BOARD_LEFT_PIN_2) +             \
     PIN_BIT(BOARD_RIGHT_PIN_1) + PIN_BIT(BOARD_RIGHT_PIN_2) + PIN_BIT(BOARD_ENABLE_PIN) +                   \
     PIN_BIT(BOARD_TIM1_BREAK_PIN) + PIN_BIT(BOARD_TIM8_BREAK_PIN) + PIN_BIT(BOARD_LEFT_ENCODER_A) +         \
     PIN_BIT(BOARD_LEFT_ENCODER_B) + PIN_BIT(BOARD_RIGHT_ENCODER_A) + PIN_BIT(BOARD_RIGHT_ENCODER_B) +       \
     PIN_BIT(BOARD_BATTERY_PIN) + PIN_BIT(BOARD_SERIAL_TX) + PIN_BIT(BOARD_SERIAL_RX) +                      \
     PIN_BIT(BOARD_CAN_RX) + PIN_BIT(BOARD_CAN_TX) + PIN_BIT(BOARD_LED))
#define UNION_OF_PINS                                                                                        \
    (PIN_BIT(PA(13)) | PIN_BIT(PA(14)) | PIN_BIT(BOARD_LEFT_PIN_1) | PIN_BIT(BOARD_LEFT_PIN_2) |             \
     PIN_BIT(BOARD_RIGHT_PIN_1) | PIN_BIT(BOARD_RIGHT_PIN_2) | PIN_BIT(BOARD_ENABLE_PIN) |                   \
     PIN_BIT(BOARD_TIM1_BREAK_PIN) | PIN_BIT(BOARD_TIM8_BREAK_PIN) | PIN_BIT(BOARD_LEFT_ENCODER_A) |         \
     PIN_BIT(BOARD_LEFT_ENCODER_B) | PIN_BIT(BOARD_RIGHT_ENCODER_A) | PIN_BIT(BOARD_RIGHT_ENCODER_B) |       \
     PIN_BIT(BOARD_BATTERY_PIN) | PIN_BIT(BOARD_SERIAL_TX) | PIN_BIT(BOARD_SERIAL_RX) |                      \
     PIN_BIT(BOARD_CAN_RX) | PIN_BIT(BOARD_CAN_TX) | PIN_BIT(BOARD_LED))
_Static_assert(SUM_OF_PINS == UNION_OF_PINS, "a pin is given twice, or is one of SWDIO and SWCLK");
_Static_assert((UNION_OF_PINS & BOARD_FREE_PINS) == 0u, "a pin that is to stay free is given away");

/* NOLINTEND(misc-redundant-expression) */

#endif
