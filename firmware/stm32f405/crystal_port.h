/* The crystal on channel 1 of TIM11: HSE_RTC is the crystal over RTCPRE, and TI1_RMP connects it without the
 * RTC or the backup domain being touched (RM0090 sections 7.2.11, 7.3.3 and 19.5.11). */
#ifndef CRYSTAL_PORT_H
#define CRYSTAL_PORT_H

#include "registers.h"

#define CRYSTAL_TIMER   TIM11
#define CRYSTAL_DIVIDER 31u

static inline void crystal_connect(void)
{
    RCC->cfgr |= RCC_CFGR_RTCPRE(CRYSTAL_DIVIDER);
    RCC->apb2enr |= RCC_APB2ENR_TIM11;
    (void)RCC->apb2enr;
    TIM11->option = TIM11_OR_HSE_RTC;
}

static inline void crystal_disconnect(void)
{
    RCC->apb2enr &= ~RCC_APB2ENR_TIM11;
    RCC->cfgr &= ~RCC_CFGR_RTCPRE(CRYSTAL_DIVIDER);
}

#endif
