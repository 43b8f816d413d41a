/* Registers that the test images use, by address from RM0090 and PM0214; independent of firmware and board.
 */
#ifndef CHIP_H
#define CHIP_H

#include <stdint.h>

#define REG(address)     (*(volatile uint32_t *)(address))
#define REG8(address)    (*(volatile uint8_t *)(address))
#define RCC_AHB1ENR      REG(0x40023830)
#define RCC_APB1ENR      REG(0x40023840)
#define RCC_APB2ENR      REG(0x40023844)
#define RCC_CR           REG(0x40023800)
#define RCC_PLLCFGR      REG(0x40023804)
#define RCC_CFGR         REG(0x40023808)
#define RCC_CSR          REG(0x40023874)
#define FLASH_ACR        REG(0x40023C00)
#define GPIO_MODER(port) REG(0x40020000u + 0x400u * (port))
#define GPIO_AFRL(port)  REG(0x40020020u + 0x400u * (port))
#define GPIO_AFRH(port)  REG(0x40020024u + 0x400u * (port))
#define TIM1(offset)     REG(0x40010000u + (offset))
#define TIM3(offset)     REG(0x40000400u + (offset))
#define TIM4(offset)     REG(0x40000800u + (offset))
#define USART3_SR        REG(0x40004800)
#define USART3_DR        REG(0x40004804)
#define USART3_BRR       REG(0x40004808)
#define USART3_CR1       REG(0x4000480C)
#define ADC1(offset)     REG(0x40012000u + (offset))
#define IWDG_KR          REG(0x40003000)
#define IWDG_PR          REG(0x40003004)
#define IWDG_RLR         REG(0x40003008)
#define SYST_CSR         REG(0xE000E010)
#define SYST_RVR         REG(0xE000E014)
#define SYST_CVR         REG(0xE000E018)
#define NVIC_ISER(n)     REG(0xE000E100u + 4u * (n))
#define NVIC_ISPR(n)     REG(0xE000E200u + 4u * (n))
#define NVIC_IPR(irq)    REG8(0xE000E400u + (irq))
#define SCB_ICSR         REG(0xE000ED04)
#define SCB_AIRCR        REG(0xE000ED0C)
#define SCB_SHPR(exc)    REG8(0xE000ED18u + (exc)-4u)
#define SCB_SHCSR        REG(0xE000ED24)
#define SCB_CFSR         REG(0xE000ED28)
#define SCB_HFSR         REG(0xE000ED2C)
#define SCB_BFAR         REG(0xE000ED38)
#define SCB_CPACR        REG(0xE000ED88)
#define DEMCR            REG(0xE000EDFC)
#define DWT_CTRL         REG(0xE0001000)
#define DWT_CYCCNT       REG(0xE0001004)

static inline void pend(unsigned irq)
{
    NVIC_ISPR(irq / 32) = 1u << (irq % 32);
    __asm volatile("dsb\n isb" ::: "memory");
}

static inline void enable_irq(unsigned irq, uint8_t priority)
{
    NVIC_IPR(irq) = priority;
    NVIC_ISER(irq / 32) = 1u << (irq % 32);
}

static inline void enable_fpu(void)
{
    SCB_CPACR |= 0xFu << 20;
    __asm volatile("dsb\n isb" ::: "memory");
}

/* Crystal 8 MHz, PLL to 168 MHz, APB1 42 MHz, APB2 84 MHz. */
static inline void clock_168mhz(void)
{
    FLASH_ACR = 0x705;
    RCC_CR |= 1u << 16;
    while ((RCC_CR & 1u << 17) == 0) {
    }
    RCC_PLLCFGR = 8u | 336u << 6 | 1u << 22 | 7u << 24;
    RCC_CR |= 1u << 24;
    while ((RCC_CR & 1u << 25) == 0) {
    }
    RCC_CFGR = 5u << 10 | 4u << 13 | 2u;
    while ((RCC_CFGR & 0xCu) != 8u) {
    }
}

/* USART3 on PB10 and PB11. */
static inline void usart3(uint32_t divider)
{
    RCC_AHB1ENR |= 2u;
    RCC_APB1ENR |= 1u << 18;
    GPIO_MODER(1) = (GPIO_MODER(1) & ~(0xFu << 20)) | 0xAu << 20;
    GPIO_AFRH(1) = (GPIO_AFRH(1) & ~0xFF00u) | 0x7700u;
    USART3_BRR = divider;
    USART3_CR1 = 1u << 13 | 1u << 3 | 1u << 2;
}

#endif
