/* An encoder at timer 3 with a filter, and at external interrupts without one: when and how often each sees
 * an edge. */
#include "chip.h"

#define EXTI(offset)   REG(0x40013C00u + (offset))
#define SYSCFG_EXTICR2 REG(0x4001380C)

volatile struct {
    uint32_t filter; /* ICxF */
} set;
volatile struct {
    uint32_t count, edges, edge_at, matches, match_at, captured, capture_flag, flag_afterwards;
} get;

void irq10(void) /* EXTI4: phase A */
{
    get.edge_at = DWT_CYCCNT;
    get.edges++;
    EXTI(0x14) = 1u << 4;
}

static void await_next_count(void)
{
    uint32_t count = TIM3(0x24);
    TIM3(0x3C) = (count + 1) & 0xFFFFu;
    TIM3(0x40) = (count - 1) & 0xFFFFu;
    TIM3(0x10) = ~0x18u;
}

void irq29(void)
{
    get.match_at = DWT_CYCCNT;
    get.matches++;
    await_next_count();
}

void systick(void)
{
    get.count = TIM3(0x24);
    if ((TIM3(0x10) & 2u) != 0) {
        get.capture_flag = 1;
        get.captured = TIM3(0x34);
        get.flag_afterwards = TIM3(0x10) & 2u;
    }
}

int main(void)
{
    clock_168mhz();
    DEMCR |= 1u << 24;
    DWT_CTRL |= 1u;
    RCC_AHB1ENR |= 2u;
    RCC_APB1ENR |= 2u;
    RCC_APB2ENR |= 1u << 14;
    GPIO_MODER(1) = (GPIO_MODER(1) & ~(0xFu << 8)) | 0xAu << 8; /* PB4, PB5 */
    GPIO_AFRL(1) = 0x00220000u;
    TIM3(0x00) = 2u << 8; /* filter clock 84 MHz / 4 */
    TIM3(0x08) = 3;
    TIM3(0x18) = 0x0101u * (1u | set.filter << 4);
    TIM3(0x20) = 1; /* capture on rising edges of phase A */
    TIM3(0x2C) = 0xFFFF;
    TIM3(0x24) = 100;
    TIM3(0x00) |= 1u;
    await_next_count();
    TIM3(0x0C) = 0x18;
    SYSCFG_EXTICR2 = 1;
    EXTI(0x00) = 1u << 4;
    EXTI(0x08) = 1u << 4;
    EXTI(0x0C) = 1u << 4;
    enable_irq(10, 0x20);
    enable_irq(29, 0x20);
    SYST_RVR = 168000 - 1;
    SYST_CVR = 0;
    SYST_CSR = 7;
    for (;;) {
        __asm volatile("wfi");
    }
}
