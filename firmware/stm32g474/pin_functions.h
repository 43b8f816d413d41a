/* Which pins of the STM32G474 (LQFP64) reach which peripheral, and by which alternate function: datasheet
 * DS12288, tables of pins and alternate functions, of which only what the board in boards/ uses is taken. */
#ifndef PIN_FUNCTIONS_H
#define PIN_FUNCTIONS_H

#ifndef TRUING_BOARD_HEADER
#define TRUING_BOARD_HEADER "boards/nucleo_g474re.h"
#endif

#define FUNCTION_OF_TIMER(timer) ((timer) == 1u ? 2u : 4u)
#define FUNCTION_OF_BREAK(timer) ((timer) == 1u ? 6u : 4u)
#define FUNCTION_OF_ENCODER      2u
#define FUNCTION_SERIAL          7u
#define FUNCTION_CAN             9u

/* Eight samples at 170 MHz / 4 / 16: 3.01 us (RM0440, chapter TIM2, IC1F). */
#define ENCODER_FILTER 12u

/* The pins of ports A to C on which a timer's channel comes out. */
#define REACHES_TIM1(channel, pin) ((channel) >= 1u && (channel) <= 4u && (pin) + 1u == PC(0) + (channel))
#define REACHES_TIM8(channel, pin) ((channel) >= 1u && (channel) <= 4u && (pin) == PC(5) + (channel))
#define REACHES_TIM3_1(pin)        ((pin) == PA(6) || (pin) == PB(4) || (pin) == PC(6))
#define REACHES_TIM3_2(pin)        ((pin) == PA(4) || (pin) == PA(7) || (pin) == PB(5) || (pin) == PC(7))
#define REACHES_BRIDGE(timer, channel, pin)                                                                  \
    (((timer) == 1u && REACHES_TIM1(channel, pin)) || ((timer) == 8u && REACHES_TIM8(channel, pin)))
#define REACHES_ENCODER(timer, a, b)                                                                         \
    (((timer) == 3u && REACHES_TIM3_1(a) && REACHES_TIM3_2(b)) ||                                            \
     ((timer) == 4u && (a) == PB(6) && (b) == PB(7)))
#define REACHES_ADC1(pin)                                                                                    \
    ((pin) <= PA(3) || (pin) == PB(0) || (pin) == PB(1) || ((pin) >= PC(0) && (pin) <= PC(3)))
#define REACHES_BREAK(timer, pin) ((pin) == ((timer) == 1u ? PB(12) : PA(6)))
#define TIM1_BREAK_PINS           "TIM1_BKIN is on PB12"
#define TIM8_BREAK_PINS           "TIM8_BKIN is on PA6"
#define REACHES_SERIAL(tx, rx)    ((tx) == PA(2) && (rx) == PA(3))
#define SERIAL_PINS               "USART2 is on PA2, PA3"
/* PB8 is BOOT0 as well, which a bus at rest would pull to the ROM loader. */
#define REACHES_CAN(rx, tx) ((rx) == PA(11) && (tx) == PA(12))
#define CAN_PINS            "FDCAN1 is on PA11, PA12"

/* The PLL is given 4 MHz, and divides by a whole number (clock_tree.h). */
#define CRYSTAL_SUITS(hz) ((hz) >= 4000000u && (hz) <= 48000000u && (hz) % 4000000u == 0u)
#define CRYSTALS          "a multiple of 4 MHz up to 48"

#endif
