/* The clock tree of the STM32F405: voltage, flash and buses, and the clocks of its peripherals. */
#include "clock_tree.h"

#include <stddef.h>

#include "clock.h"
#include "fault.h"

/* RM0090 table 10: 150 to 168 MHz at 2.7 to 3.6 V takes five wait states. */
#define FLASH_WAIT_STATES 5u

/* First silicon (revision A) must not prefetch (ES0182, "ART Accelerator prefetch queue"), and it gives
 * itself out for an STM32F2 of revision 0x2000 ("MCU device ID is incorrect"): so only what is known to be
 * an STM32F405 or F407 and no revision A prefetches. The caches are good in all. */
#define IDCODE_DEVICE     0x413u
#define IDCODE_REVISION_A 0x1000u

void clock_tree_prepare(void)
{
    /* Scale 1, which 168 MHz needs, is the reset value; a program that jumped here may have changed it. */
    RCC->apb1enr |= RCC_APB1ENR_PWR;
    (void)RCC->apb1enr;
    PWR_CR |= PWR_CR_VOS;
}

static bool prefetch_allowed(void)
{
    uint32_t id;
    return guarded_read(DBGMCU_IDCODE_ADDRESS, &id) && (id & 0xFFFu) == IDCODE_DEVICE &&
           (id >> 16) != IDCODE_REVISION_A;
}

bool clock_tree_brace(void)
{
    FLASH_ACR = FLASH_ACR_LATENCY(FLASH_WAIT_STATES) | FLASH_ACR_ICEN | FLASH_ACR_DCEN |
                (prefetch_allowed() ? FLASH_ACR_PRFTEN : 0u);
    if ((FLASH_ACR & FLASH_ACR_LATENCY_MASK) != FLASH_WAIT_STATES) { /* RM0090 section 3.5.1 */
        return false;
    }
    RCC->cfgr = RCC_CFGR_PPRE1_DIV4 | RCC_CFGR_PPRE2_DIV2;
    return true;
}

void clock_tree_settle(void)
{
    /* flash and buses are as they are to stay */
}

void clock_peripherals(void)
{
    RCC->ahb1enr |=
        RCC_AHB1ENR_GPIOA | RCC_AHB1ENR_GPIOB | RCC_AHB1ENR_GPIOC | RCC_AHB1ENR_CCM | RCC_AHB1ENR_DMA1;
    RCC->ahb2enr |= RCC_AHB2ENR_RNG;
    RCC->apb1enr |=
        RCC_APB1ENR_TIM2 | RCC_APB1ENR_TIM3 | RCC_APB1ENR_TIM4 | RCC_APB1ENR_USART3 | RCC_APB1ENR_CAN1;
    RCC->apb2enr |= RCC_APB2ENR_TIM1 | RCC_APB2ENR_TIM8 | RCC_APB2ENR_ADC1;
    (void)RCC->apb2enr; /* a clock needs two cycles to arrive (ES0182); the read takes longer */
}

/* The clock security system has seen the crystal stop and has put the CPU on the 16 MHz oscillator (RM0090
 * section 7.2.7). Every divider is wrong from here on, so the chip starts over, and start-up finds a clock.
 */
void NMI_Handler(void)
{
    if ((RCC->cir & RCC_CIR_CSSF) != 0) {
        RCC->cir |= RCC_CIR_CSSC;
    }
    record_fault(NULL);
}
