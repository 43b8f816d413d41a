/* The clock tree of the STM32G474: voltage, flash and buses, and the clocks of its peripherals. */
#include "clock_tree.h"

#include <stdbool.h>
#include <stddef.h>

#include "clock.h"
#include "cortex.h"
#include "fault.h"
#include "store.h"

/* RM0440, chapter FLASH: up to 170 MHz in range 1 boost takes four wait states. */
#define FLASH_WAIT_STATES 4u

/* The regulator's microsecond at 85 MHz, since each read takes a cycle at the least; more than flash needs.
 */
enum { SETTLE_READS = 200 };

/* Range 1 is the reset value; a program that jumped here may have changed it. */
void clock_tree_prepare(void)
{
    PWR->cr1 = (PWR->cr1 & ~PWR_CR1_VOS_MASK) | PWR_CR1_VOS_RANGE1;
}

/* Beyond 150 MHz the core needs range 1 boost, and the CPU has to pass half its speed on the way up (RM0440,
 * chapter PWR, range 1 boost mode). Flash keeps the bits that this firmware does not know. */
bool clock_tree_brace(void)
{
    RCC->cfgr = (RCC->cfgr & ~RCC_CFGR_HPRE_MASK) | RCC_CFGR_HPRE_DIV2;
    PWR->cr5 &= ~PWR_CR5_R1MODE;
    FLASH_ACR = (FLASH_ACR & ~FLASH_ACR_LATENCY_MASK) | FLASH_WAIT_STATES | FLASH_ACR_PRFTEN |
                FLASH_ACR_ICEN | FLASH_ACR_DCEN;
    bool taken = false;
    for (uint32_t i = 0; i < SETTLE_READS && !taken; i++) {
        taken = (FLASH_ACR & FLASH_ACR_LATENCY_MASK) == FLASH_WAIT_STATES;
    }
    return taken;
}

void clock_tree_settle(void)
{
    for (uint32_t i = 0; i < SETTLE_READS; i++) {
        (void)RCC->cfgr;
    }
    RCC->cfgr &= ~RCC_CFGR_HPRE_MASK;
}

/* CCIPR stays as reset leaves it: FDCAN from the crystal, USART2 from APB1, the random numbers from HSI48. */
void clock_peripherals(void)
{
    RCC->ahb1enr |= RCC_AHB1ENR_DMA1 | RCC_AHB1ENR_DMAMUX1;
    RCC->ahb2enr |=
        RCC_AHB2ENR_GPIOA | RCC_AHB2ENR_GPIOB | RCC_AHB2ENR_GPIOC | RCC_AHB2ENR_ADC12 | RCC_AHB2ENR_RNG;
    RCC->apb1enr1 |= RCC_APB1ENR1_TIM2 | RCC_APB1ENR1_TIM3 | RCC_APB1ENR1_TIM4 | RCC_APB1ENR1_USART2 |
                     RCC_APB1ENR1_FDCAN | RCC_APB1ENR1_PWR;
    RCC->apb2enr |= RCC_APB2ENR_TIM1 | RCC_APB2ENR_TIM8;
    RCC->crrcr |= RCC_CRRCR_HSI48ON;
    (void)RCC->apb2enr;        /* a clock needs two cycles to arrive */
    TIM1->af1 = TIM_AF1_BKINE; /* the emergency stop's pins, not inverted, and no comparator */
    TIM8->af1 = TIM_AF1_BKINE;
    PWR->cr3 |= PWR_CR3_UCPD_DBDIS; /* or PB4 and PB6 may be pulled down (chapter PWR) */
}

/* Flash has found two wrong bits in a double word. Where a parameter is being read, its writing was cut off:
 * the reader checks what it gets (store.c). Anywhere else it is the program.
 *
 * Or the clock security system has seen the crystal stop and has put the CPU on the 16 MHz oscillator. Every
 * divider is wrong from here on, so the chip starts over, and start-up finds a clock. */
void NMI_Handler(void)
{
    const uint32_t eccr = FLASH->eccr;
    if ((eccr & FLASH_ECCR_ECCD) != 0 && store_reads) {
        FLASH->eccr = eccr;
        cpu_finish_writes();
        return;
    }
    if ((RCC->cifr & RCC_CIFR_CSSF) != 0) {
        RCC->cicr = RCC_CICR_CSSC;
    }
    record_fault(NULL);
}
