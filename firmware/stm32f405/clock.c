/* Starts the fastest clock available, and falls back to the next one when one does not start. */
#include "clock.h"

#include "cortex.h"
#include "crystal.h"
#include "fault.h"
#include "registers.h"
#include "wiring.h"

/* Datasheet DocID022152: a crystal starts in 2 ms typically (section 5.3.8), the RC oscillator within 4 us
 * (5.3.9), the PLL locks within 0.3 ms (5.3.10). The limits leave room for a poor crystal. */
#define CRYSTAL_TIMEOUT_US 50000u
#define PLL_TIMEOUT_US     2000u
#define SWITCH_TIMEOUT_US  1000u

/* RM0090 table 10: 150 to 168 MHz at 2.7 to 3.6 V takes five wait states. */
#define FLASH_WAIT_STATES 5u

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

/* First silicon (revision A) must not prefetch (ES0182, "ART Accelerator prefetch queue"), and it gives
 * itself out for an STM32F2 of revision 0x2000 ("MCU device ID is incorrect"): so only what is known to be
 * an STM32F405 or F407 and no revision A prefetches. The caches are good in all. */
#define IDCODE_DEVICE     0x413u
#define IDCODE_REVISION_A 0x1000u

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
    RCC->cfgr &= ~RCC_CFGR_SW_MASK;
    (void)wait_for(&RCC->cfgr, RCC_CFGR_SWS_MASK, 0, SWITCH_TIMEOUT_US);
    RCC->cfgr = 0;
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
    RCC->pllcfgr = settings; /* only taken while the PLL is off, RM0090 section 7.3.2 */
    RCC->cr |= RCC_CR_PLLON;
    if (wait_for(&RCC->cr, RCC_CR_PLLRDY, RCC_CR_PLLRDY, PLL_TIMEOUT_US)) {
        return true;
    }
    RCC->cr &= ~RCC_CR_PLLON;
    (void)wait_for(&RCC->cr, RCC_CR_PLLRDY, 0, PLL_TIMEOUT_US);
    return false;
}

static bool prefetch_allowed(void)
{
    uint32_t id;
    return guarded_read(DBGMCU_IDCODE_ADDRESS, &id) && (id & 0xFFFu) == IDCODE_DEVICE &&
           (id >> 16) != IDCODE_REVISION_A;
}

/* Flash and buses are slowed down before the CPU speeds up; a flash that does not take it keeps the CPU
 * slow. */
static bool switch_to_pll(void)
{
    FLASH_ACR = FLASH_ACR_LATENCY(FLASH_WAIT_STATES) | FLASH_ACR_ICEN | FLASH_ACR_DCEN |
                (prefetch_allowed() ? FLASH_ACR_PRFTEN : 0u);
    if ((FLASH_ACR & FLASH_ACR_LATENCY_MASK) != FLASH_WAIT_STATES) { /* RM0090 section 3.5.1 */
        return false;
    }
    RCC->cfgr = RCC_CFGR_PPRE1_DIV4 | RCC_CFGR_PPRE2_DIV2;
    RCC->cfgr |= RCC_CFGR_SW_PLL;
    return wait_for(&RCC->cfgr, RCC_CFGR_SWS_MASK, RCC_CFGR_SWS_PLL, SWITCH_TIMEOUT_US);
}

/* Buses at a fourth and a half: 42 and 84 MHz are their limits, RM0090 section 7.2. A timer runs at twice its
 * bus whenever the bus is divided. */
static void describe_pll(struct clock *out, enum clock_source source, uint32_t cpu_hz)
{
    out->source = source;
    out->cpu_hz = cpu_hz;
    out->apb1_hz = cpu_hz / 4u;
    out->timer_apb1_hz = cpu_hz / 2u;
    out->timer_apb2_hz = cpu_hz;
}

void clock_start(struct clock *out)
{
    SYSTICK->load = SYSTICK_MAX;
    SYSTICK->val = 0;
    SYSTICK->ctrl = SYSTICK_CTRL_CLKSOURCE | SYSTICK_CTRL_ENABLE;

    return_to_internal();

    /* Scale 1, which 168 MHz needs, is the reset value; a program that jumped here may have changed it. */
    RCC->apb1enr |= RCC_APB1ENR_PWR;
    (void)RCC->apb1enr;
    PWR_CR |= PWR_CR_VOS;

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
                              .timer_apb1_hz = CLOCK_RESET_HZ,
                              .timer_apb2_hz = CLOCK_RESET_HZ};
    }
    out->crystal_wrong = oscillates && !crystal;
    SYSTICK->ctrl = 0;
}
