/* Starts the fastest clock available, and falls back to the next one when one does not start. */
#include "clock.h"

#include "clock_tree.h"
#include "crystal.h"
#include "registers.h"

/* A crystal starts in 2 ms typically, the RC oscillator within 4 us, the PLL locks within 0.3 ms (datasheet
 * DocID022152, sections 5.3.8 to 5.3.10). The limits leave room for a poor crystal. */
#define CRYSTAL_TIMEOUT_US 50000u
#define PLL_TIMEOUT_US     2000u
#define SWITCH_TIMEOUT_US  1000u

/* True once all bits of `mask` in `reg` read as `value`. SysTick measures, as it runs from the start. */
static bool wait_for(const reg32 *reg, uint32_t mask, uint32_t value, uint32_t timeout_us)
{
    const uint32_t limit = timeout_us * (CLOCK_RESET_HZ / 1000000u);
    const uint32_t start = SYSTICK->val;
    do {
        if ((*reg & mask) == value) {
            return true;
        }
    } while (((start - SYSTICK->val) & SYSTICK_MAX) < limit);
    return false;
}

/* The ROM loader may have left the PLL running; after a reset this finds everything as it should be. */
static void return_to_internal(void)
{
    RCC->cr |= RCC_CR_HSION;
    (void)wait_for(&RCC->cr, RCC_CR_HSIRDY, RCC_CR_HSIRDY, SWITCH_TIMEOUT_US);
    RCC->cfgr = (RCC->cfgr & ~RCC_CFGR_SW_MASK) | RCC_CFGR_SW_INTERNAL;
    (void)wait_for(&RCC->cfgr, RCC_CFGR_SWS_MASK, RCC_CFGR_SWS_INTERNAL, SWITCH_TIMEOUT_US);
    RCC->cfgr = RCC_CFGR_SW_INTERNAL;
    RCC->cr &= ~(RCC_CR_PLLON | RCC_CR_CSSON | RCC_CR_HSEON);
    RCC->cr &= ~RCC_CR_HSEBYP;
    (void)wait_for(&RCC->cr, RCC_CR_PLLRDY, 0, PLL_TIMEOUT_US);
}

static bool start_crystal(void)
{
    RCC->cr |= RCC_CR_HSEON;
    if (wait_for(&RCC->cr, RCC_CR_HSERDY, RCC_CR_HSERDY, CRYSTAL_TIMEOUT_US)) {
        return true;
    }
    RCC->cr &= ~RCC_CR_HSEON;
    return false;
}

static bool start_pll(uint32_t settings)
{
    RCC->pllcfgr = settings; /* only taken while the PLL is off */
    RCC->cr |= RCC_CR_PLLON;
    if (wait_for(&RCC->cr, RCC_CR_PLLRDY, RCC_CR_PLLRDY, PLL_TIMEOUT_US)) {
        return true;
    }
    RCC->cr &= ~RCC_CR_PLLON;
    (void)wait_for(&RCC->cr, RCC_CR_PLLRDY, 0, PLL_TIMEOUT_US);
    return false;
}

static bool switch_to_pll(void)
{
    if (!clock_tree_brace()) {
        return false;
    }
    RCC->cfgr |= RCC_CFGR_SW_PLL;
    if (!wait_for(&RCC->cfgr, RCC_CFGR_SWS_MASK, RCC_CFGR_SWS_PLL, SWITCH_TIMEOUT_US)) {
        return false;
    }
    clock_tree_settle();
    return true;
}

static void describe_pll(struct clock *out, enum clock_source source, uint32_t cpu_hz)
{
    out->source = source;
    out->cpu_hz = cpu_hz;
    out->apb1_hz = cpu_hz / APB1_DIVIDER;
    out->can_hz = CAN_HZ(cpu_hz);
    out->timer_apb1_hz = cpu_hz / TIMER_APB1_DIVIDER;
    out->timer_apb2_hz = cpu_hz;
}

void clock_start(struct clock *out)
{
    SYSTICK->load = SYSTICK_MAX;
    SYSTICK->val = 0;
    SYSTICK->ctrl = SYSTICK_CTRL_CLKSOURCE | SYSTICK_CTRL_ENABLE;

    return_to_internal();

    clock_tree_prepare();
    const bool oscillates = start_crystal();
    const bool crystal = oscillates && crystal_is_right();
    if (oscillates && !crystal) {
        RCC->cr &= ~RCC_CR_HSEON;
    }
    if (crystal && start_pll(PLL_FROM_CRYSTAL) && switch_to_pll()) {
        RCC->cr |= RCC_CR_CSSON; /* a crystal that stops later raises the NMI */
        describe_pll(out, CLOCK_CRYSTAL_PLL, CRYSTAL_PLL_HZ);
    } else if (!crystal && start_pll(PLL_FROM_INTERNAL) && switch_to_pll()) {
        describe_pll(out, CLOCK_INTERNAL_PLL, INTERNAL_PLL_HZ);
    } else {
        return_to_internal();
        *out = (struct clock){.source = CLOCK_INTERNAL,
                              .cpu_hz = CLOCK_RESET_HZ,
                              .apb1_hz = CLOCK_RESET_HZ,
                              .can_hz = CLOCK_RESET_HZ,
                              .timer_apb1_hz = CLOCK_RESET_HZ,
                              .timer_apb2_hz = CLOCK_RESET_HZ};
    }
    out->crystal_wrong = oscillates && !crystal;
    SYSTICK->ctrl = 0;
}
