/* The clock tree of the STM32G474; what clock.c needs of it. */
#ifndef CLOCK_TREE_H
#define CLOCK_TREE_H

#include "registers.h"
#include "wiring.h"

/* Both give the PLL 4 MHz and an output of VCO / 2. From the crystal, 340 MHz / 2 = 170 MHz, the chip's
 * limit. From the RC oscillator, 328 MHz / 2 = 164 MHz: no more than 170 where that is 3.6 % too fast; the
 * datasheet gives it 1.5 % over temperature. APB1's 164 MHz divide to 921600 baud within 0.03 %. */
#define PLL_FROM_CRYSTAL                                                                                     \
    (RCC_PLLCFGR_SRC_HSE | RCC_PLLCFGR_M(BOARD_CRYSTAL_HZ / 4000000u) | RCC_PLLCFGR_N(85) |                  \
     RCC_PLLCFGR_REN | RCC_PLLCFGR_R_2)
#define PLL_FROM_INTERNAL                                                                                    \
    (RCC_PLLCFGR_SRC_HSI | RCC_PLLCFGR_M(4) | RCC_PLLCFGR_N(82) | RCC_PLLCFGR_REN | RCC_PLLCFGR_R_2)
#define CRYSTAL_PLL_HZ  170000000u
#define INTERNAL_PLL_HZ 164000000u

/* All buses run at full speed. FDCAN takes the crystal itself, which divides to every usual bit rate. */
#define APB1_DIVIDER       1u
#define TIMER_APB1_DIVIDER 1u
#define CAN_HZ(cpu_hz)     BOARD_CRYSTAL_HZ

#endif
