/* Which pins of the STM32F405 (LQFP64) reach which peripheral, and by which alternate function: datasheet
 * DocID022152, table 9. */
#ifndef PIN_FUNCTIONS_H
#define PIN_FUNCTIONS_H

#ifndef TRUING_BOARD_HEADER
#define TRUING_BOARD_HEADER "boards/olimex_h405.h"
#endif

#define FUNCTION_OF_TIMER(timer) ((timer) == 1u ? 1u : 3u)
#define FUNCTION_OF_BREAK(timer) FUNCTION_OF_TIMER(timer)
#define FUNCTION_OF_ENCODER      2u
#define FUNCTION_SERIAL          7u
#define FUNCTION_CAN             9u

/* Eight samples at 84 MHz / 4 / 8: 3.05 us (RM0090 section 18.4.7). */
#define ENCODER_FILTER 9u

/* The pins of ports A to C on which a timer's channel comes out. */
#define REACHES_TIM1(channel, pin) ((channel) >= 1u && (channel) <= 4u && (pin) == PA(7) + (channel))
#define REACHES_TIM8(channel, pin) ((channel) >= 1u && (channel) <= 4u && (pin) == PC(5) + (channel))
#define REACHES_TIM3_1(pin)        ((pin) == PA(6) || (pin) == PB(4) || (pin) == PC(6))
#define REACHES_TIM3_2(pin)        ((pin) == PA(7) || (pin) == PB(5) || (pin) == PC(7))
#define REACHES_BRIDGE(timer, channel, pin)                                                                  \
    (((timer) == 1u && REACHES_TIM1(channel, pin)) || ((timer) == 8u && REACHES_TIM8(channel, pin)))
#define REACHES_ENCODER(timer, a, b)                                                                         \
    (((timer) == 3u && REACHES_TIM3_1(a) && REACHES_TIM3_2(b)) ||                                            \
     ((timer) == 4u && (a) == PB(6) && (b) == PB(7)))
#define REACHES_ADC1(pin)                                                                                    \
    ((pin) <= PA(7) || (pin) == PB(0) || (pin) == PB(1) || ((pin) >= PC(0) && (pin) <= PC(5)))
#define REACHES_BREAK(timer, pin) ((pin) == PA(6) || ((timer) == 1u && (pin) == PB(12)))
#define TIM1_BREAK_PINS           "TIM1_BKIN is on PB12 or PA6"
#define TIM8_BREAK_PINS           "TIM8_BKIN is on PA6"
#define REACHES_SERIAL(tx, rx)    (((tx) == PB(10) && (rx) == PB(11)) || ((tx) == PC(10) && (rx) == PC(11)))
#define SERIAL_PINS               "USART3 is on PB10, PB11 or PC10, PC11"
#define REACHES_CAN(rx, tx)       (((rx) == PB(8) && (tx) == PB(9)) || ((rx) == PA(11) && (tx) == PA(12)))
#define CAN_PINS                  "CAN1 is on PB8, PB9 or PA11, PA12"

/* The PLL is given 2 MHz, and divides by a whole number (clock.c). RM0090 section 7.2.1: 4 to 26 MHz. */
#define CRYSTAL_SUITS(hz) ((hz) >= 4000000u && (hz) <= 26000000u && (hz) % 2000000u == 0u)
#define CRYSTALS          "an even number of MHz from 4 to 26"

#endif
