/* The clock tree of the STM32F405; what clock.c needs of it. */
#ifndef CLOCK_TREE_H
#define CLOCK_TREE_H

#include "registers.h"
#include "wiring.h"

/* Both give the PLL the 2 MHz that RM0090 section 7.3.2 recommends for least jitter, and an output of VCO /
 * 2. From the crystal, 336 MHz / 2 = 168 MHz and 336 MHz / 7 = 48 MHz for the random number generator. From
 * the RC oscillator, 316 MHz / 2 = 158 MHz: no more than the chip's 168 even where it is 4.5 % too fast, as
 * it may be over temperature (datasheet section 5.3.9), and APB1's 39.5 MHz divide to 921600 baud within 0.33
 * %. */
#define PLL_FROM_CRYSTAL                                                                                     \
    (RCC_PLLCFGR_M(BOARD_CRYSTAL_HZ / 2000000u) | RCC_PLLCFGR_N(168) | RCC_PLLCFGR_P_2 |                     \
     RCC_PLLCFGR_SRC_HSE | RCC_PLLCFGR_Q(7))
#define PLL_FROM_INTERNAL (RCC_PLLCFGR_M(8) | RCC_PLLCFGR_N(158) | RCC_PLLCFGR_P_2 | RCC_PLLCFGR_Q(7))
#define CRYSTAL_PLL_HZ    168000000u
#define INTERNAL_PLL_HZ   158000000u

/* Buses at a fourth and a half: 42 and 84 MHz are their limits, RM0090 section 7.2. A timer runs at twice its
 * bus whenever the bus is divided. */
#define APB1_DIVIDER       4u
#define TIMER_APB1_DIVIDER 2u
#define CAN_HZ(cpu_hz)     ((cpu_hz) / APB1_DIVIDER)

#endif
