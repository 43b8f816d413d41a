/* The crystal on channel 1 of TIM17: TISEL connects HSE/32 (RM0440, chapter TIM17). */
#ifndef CRYSTAL_PORT_H
#define CRYSTAL_PORT_H

#include "registers.h"

#define CRYSTAL_TIMER   TIM17
#define CRYSTAL_DIVIDER 32u

static inline void crystal_connect(void)
{
    RCC->apb2enr |= RCC_APB2ENR_TIM17;
    (void)RCC->apb2enr;
    TIM17->tisel = TIM17_TISEL_HSE_32;
}

static inline void crystal_disconnect(void)
{
    RCC->apb2enr &= ~RCC_APB2ENR_TIM17;
}

#endif
