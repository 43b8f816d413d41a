/* The smallest program worth a comparison: a 1 kHz interrupt that filters a number, and sleep in between. */
#include <stdint.h>

#define REG(address) (*(volatile uint32_t *)(address))
#define SYST_CSR     REG(0xE000E010)
#define SYST_RVR     REG(0xE000E014)
#define SCB_CPACR    REG(0xE000ED88)
#define TIM2_CCR1    REG(0x40000034)
#define TIM3_CNT     REG(0x40000424)

enum { CYCLES = 168000, STEPS = 20, FIRST_USED = 16 };

extern uint32_t stack_top;
static volatile float filtered;

static void start(void)
{
    SCB_CPACR |= 0xFu << 20;
    __asm volatile("dsb\n\tisb");
    SYST_RVR = CYCLES - 1;
    SYST_CSR = 7;
    for (;;) {
        __asm volatile("wfi");
    }
}

static void tick(void)
{
    for (int i = 0; i < STEPS; i++) {
        filtered += 0.01f * (1.0f - filtered);
    }
    TIM2_CCR1 = (uint32_t)(filtered * 1000.0f);
    (void)TIM3_CNT;
}

__attribute__((section(".vectors"), used)) static void (*const vectors[FIRST_USED])(void) = {
    [0] = (void (*)(void))(uintptr_t)&stack_top, [1] = start, [15] = tick};
