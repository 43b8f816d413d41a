/* Reset and clock control: oscillators with start-up times, the clock tree, peripheral clocks, reset
 * causes. */
#include "machine.h"

#include <string.h>

enum { AHB1, AHB2, AHB3, APB1, APB2 };
enum {
    HSION = 1 << 0,
    HSIRDY = 1 << 1,
    HSEON = 1 << 16,
    HSERDY = 1 << 17,
    HSEBYP = 1 << 18,
    CSSON = 1 << 19
};
enum { PLLON = 1 << 24, PLLRDY = 1 << 25, PLLI2SON = 1 << 26, PLLI2SRDY = 1 << 27 };
enum { SW_HSI, SW_HSE, SW_PLL };
enum { CSSF = 1 << 7, CSSC = 1 << 23 };
/* Start-up times, STM32F405 datasheet tables 33, 34, 36 and 37 (typical). */
#define HSE_START_PS (2000 * PS_PER_US)
#define HSI_START_PS (2 * PS_PER_US)
#define PLL_LOCK_PS  (200 * PS_PER_US)
#define LSI_START_PS (15 * PS_PER_US)

static bool hse_ready(const struct board *b)
{
    return (b->rcc.cr & HSERDY) != 0;
}

static uint32_t pll_hz(const struct board *b)
{
    uint32_t r = b->rcc.pllcfgr;
    uint64_t source = (r & 1u << 22) != 0 ? b->options.crystal_hz : b->hsi_hz;
    uint32_t m = r & 0x3Fu;
    uint32_t n = r >> 6 & 0x1FFu;
    uint32_t p = 2 * ((r >> 16 & 3u) + 1);
    return m < 2 || n < 50 ? 0 : (uint32_t)(source * n / m / p);
}

static uint32_t prescaler(uint32_t bits, uint32_t first)
{
    static const uint32_t ahb[] = {2, 4, 8, 16, 64, 128, 256, 512};
    return bits < first ? 1 : first == 8 ? ahb[bits - 8] : 2u << (bits - first);
}

/* The datasheet's limits apply to nominal crystal frequencies. */
static bool above(uint32_t hz, uint32_t limit_hz)
{
    return hz > limit_hz + limit_hz / 2000u;
}

/* Applies the settings: switches the system clock when the source asked for is ready. */
static void apply(struct board *b)
{
    struct rcc *r = &b->rcc;
    const uint32_t ready[] = {r->cr & HSIRDY, r->cr & HSERDY, r->cr & PLLRDY, 0};
    const uint32_t wanted = r->cfgr & 3u;
    if (ready[wanted] != 0) {
        r->cfgr = (r->cfgr & ~(3u << 2)) | wanted << 2;
    }
    const uint32_t source_hz[] = {b->hsi_hz, b->options.crystal_hz, pll_hz(b), b->hsi_hz};
    uint32_t sysclk = source_hz[r->cfgr >> 2 & 3u];
    uint32_t hpre = prescaler(r->cfgr >> 4 & 0xFu, 8);
    uint32_t ppre1 = prescaler(r->cfgr >> 10 & 7u, 4);
    uint32_t ppre2 = prescaler(r->cfgr >> 13 & 7u, 4);
    uint32_t hz = sysclk / hpre == 0 ? 1 : sysclk / hpre;
    if (hz == b->clock.hz && ppre1 == r->ppre1 && ppre2 == r->ppre2) {
        return;
    }
    for (int i = 1; i <= TIMERS; i++) {
        timer_sync(b, i);
    }
    r->hpre = hpre;
    r->ppre1 = ppre1;
    r->ppre2 = ppre2;
    time_set_hz(b, hz);
    for (int i = 1; i <= TIMERS; i++) {
        timer_schedule(b, i);
    }
    pins_update(b);
    if (above(sysclk, 168000000u)) {
        warn_once(b, 0xF0000002u, "CPU clock %u Hz is above the 168 MHz of the datasheet", (unsigned)sysclk);
    }
    if (above(hz / ppre1, 42000000u) || above(hz / ppre2, 84000000u)) {
        warn_once(b, 0xF0000003u, "APB clock above its limit: APB1 %u Hz, APB2 %u Hz", (unsigned)(hz / ppre1),
                  (unsigned)(hz / ppre2));
    }
    /* 30 MHz for each wait state at 2.7 to 3.6 V, RM0090 table 10. */
    if (above(hz, 30000000u * ((b->flash.acr & 7u) + 1))) {
        warn_once(b, 0xF0000004u, "flash has %u wait states at %u Hz: too few", (unsigned)(b->flash.acr & 7u),
                  (unsigned)hz);
    }
}

/* HSE_RTC, the crystal over RTCPRE (RM0090 section 7.3.3); 0: none. In mHz, for the remainder. */
uint64_t rcc_hse_rtc_mhz(const struct board *b)
{
    const uint32_t divider = b->rcc.cfgr >> 16 & 0x1Fu;
    return divider >= 2 && hse_ready(b) ? (uint64_t)b->options.crystal_hz * 1000u / divider : 0;
}

void rcc_clock_changed(struct board *b)
{
    apply(b);
}

/* Timers run at twice the bus clock when the bus is divided (RM0090 7.2). In CPU cycles. */
uint32_t rcc_timer_divisor(const struct board *b, int timer)
{
    bool apb2 = timer == 1 || (timer >= 8 && timer <= 11);
    uint32_t ppre = apb2 ? b->rcc.ppre2 : b->rcc.ppre1;
    return ppre == 1 ? 1 : ppre / 2;
}

uint32_t rcc_usart_divisor(const struct board *b, int usart)
{
    return usart == 1 ? b->rcc.ppre2 : b->rcc.ppre1;
}

void rcc_event(struct board *b, unsigned id)
{
    static const uint32_t ready[] = {HSIRDY, HSERDY, PLLRDY};
    if (id == EVENT_RCC_LSI) {
        b->rcc.csr |= 2u;
        return;
    }
    b->rcc.cr |= ready[id - EVENT_RCC_HSI];
    if (id == EVENT_RCC_HSE && (b->rcc.cr & PLLON) != 0 && (b->rcc.pllcfgr & 1u << 22) != 0) {
        event_at_ps(b, EVENT_RCC_PLL, time_to_ps(b, b->moment) + PLL_LOCK_PS);
    }
    apply(b);
}

/* An oscillator's switch: when it goes on, its ready flag follows later; off takes both at once. */
static void turn(struct board *b, uint32_t before, uint32_t on, uint32_t ready, unsigned event,
                 uint64_t delay)
{
    if ((b->rcc.cr & on) == 0) {
        b->rcc.cr &= ~ready;
        event_cancel(b, event);
    } else if ((before & on) == 0) {
        event_at_ps(b, event, delay == NEVER ? NEVER : time_to_ps(b, b->moment) + delay);
    }
}

static void write_cr(struct board *b, uint32_t value)
{
    struct rcc *r = &b->rcc;
    const uint32_t before = r->cr;
    const uint32_t used = r->cfgr >> 2 & 3u; /* the running clock cannot be switched off */
    uint32_t locked = used == SW_HSI ? HSION : used == SW_HSE ? HSEON : PLLON;
    if (used == SW_PLL) {
        locked |= (r->pllcfgr & 1u << 22) != 0 ? HSEON : HSION;
    }
    const uint32_t writable = HSION | 0xF8u | HSEON | HSEBYP | CSSON | PLLON | PLLI2SON;
    r->cr = (before & ~writable) | (value & writable) | (before & locked);
    bool crystal = b->crystal_alive && b->options.crystal_hz != 0;
    turn(b, before, HSION, HSIRDY, EVENT_RCC_HSI, HSI_START_PS);
    turn(b, before, HSEON, HSERDY, EVENT_RCC_HSE, crystal ? HSE_START_PS : NEVER);
    bool source = (r->pllcfgr & 1u << 22) != 0 ? hse_ready(b) : (r->cr & HSIRDY) != 0;
    turn(b, before, PLLON, PLLRDY, EVENT_RCC_PLL,
         source && !b->pll_dead && pll_hz(b) != 0 ? PLL_LOCK_PS : NEVER);
    r->cr = (r->cr & PLLI2SON) != 0 ? r->cr | PLLI2SRDY : r->cr & ~(uint32_t)PLLI2SRDY;
    apply(b);
}

/* The crystal stopped. The clock security system moves the CPU to HSI and raises the NMI (RM0090 7.2.7);
 * without it a CPU that ran from the crystal stops until the independent watchdog resets it. */
void rcc_crystal_changed(struct board *b)
{
    struct rcc *r = &b->rcc;
    if (b->crystal_alive) {
        if ((r->cr & HSEON) != 0 && !hse_ready(b)) {
            event_at_ps(b, EVENT_RCC_HSE, time_to_ps(b, b->moment) + HSE_START_PS);
        }
        return;
    }
    const bool was_ready = hse_ready(b);
    const uint32_t used = r->cfgr >> 2 & 3u;
    const bool from_crystal = used == SW_HSE || (used == SW_PLL && (r->pllcfgr & 1u << 22) != 0);
    event_cancel(b, EVENT_RCC_HSE);
    r->cr &= ~(uint32_t)HSERDY;
    if (!was_ready) {
        return;
    }
    if ((r->cr & CSSON) != 0) {
        r->cr &= ~(uint32_t)(HSEON | CSSON);
        r->cir |= CSSF;
        if (from_crystal) {
            r->cr = (r->cr & ~(uint32_t)(used == SW_PLL ? PLLON | PLLRDY : 0)) | HSION | HSIRDY;
            r->cfgr &= ~3u;
        }
        apply(b);
        nvic_pend(b, EXC_NMI, true);
    } else if (from_crystal) {
        b->clock_dead = true;
        warn_once(b, 0xF0000005u, "the crystal stopped under a running CPU without clock security");
    }
}

/* Registers that come once for each bus, at a fixed distance from the first; -1: a hole. */
static int bus_at(uint32_t offset, uint32_t first)
{
    static const int8_t bus[] = {AHB1, AHB2, AHB3, -1, APB1, APB2};
    uint32_t index = (offset - first) / 4;
    return offset >= first && index < sizeof bus ? bus[index] : -1;
}

static bool plain(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    struct rcc *r = &b->rcc;
    uint32_t *store = offset == 0x70   ? &r->bdcr
                      : offset == 0x80 ? &r->sscgr
                      : offset == 0x84 ? &r->plli2scfgr
                                       : NULL;
    if (bus_at(offset, 0x10) >= 0) {
        int bus = bus_at(offset, 0x10);
        store = &r->rstr[bus];
        if (write) {
            bus_reset_peripherals(b, (unsigned)bus, *value & ~*store);
        }
    } else if (bus_at(offset, 0x30) >= 0) {
        store = &r->enr[bus_at(offset, 0x30)];
    } else if (bus_at(offset, 0x50) >= 0) {
        store = &r->lpenr[bus_at(offset, 0x50)];
    }
    if (store == NULL) {
        return false;
    }
    if (write) {
        *store = *value;
    } else {
        *value = *store;
    }
    return true;
}

static void write_csr(struct board *b, uint32_t value)
{
    struct rcc *r = &b->rcc;
    if ((value & 1u << 24) != 0) {
        r->csr &= 0x00FFFFFFu; /* RMVF */
    }
    if ((value & 1u) != 0 && (r->csr & 1u) == 0) {
        event_at_ps(b, EVENT_RCC_LSI, time_to_ps(b, b->moment) + LSI_START_PS);
    } else if ((value & 1u) == 0 && !b->iwdg.running) {
        event_cancel(b, EVENT_RCC_LSI);
        r->csr &= ~2u;
    }
    r->csr = (r->csr & ~1u) | (value & 1u);
}

bool rcc_access(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    struct rcc *r = &b->rcc;
    switch (offset) {
    case 0x00:
        if (write) {
            write_cr(b, *value);
        }
        *value = r->cr;
        return true;
    case 0x04:
        if (write && (r->cr & PLLON) == 0) { /* only while the PLL is off, RM0090 7.3.2 */
            r->pllcfgr = *value & 0x0F437FFFu;
        } else if (write) {
            warn_once(b, 0xF0000006u, "RCC_PLLCFGR written while the PLL runs: ignored");
        }
        *value = r->pllcfgr;
        return true;
    case 0x08:
        if (write) {
            r->cfgr = (r->cfgr & 0xCu) | (*value & ~0x30Cu);
            apply(b);
        }
        *value = r->cfgr;
        return true;
    case 0x0C:
        if (write) {
            r->cir = (*value & CSSC) != 0 ? r->cir & ~(uint32_t)CSSF : r->cir;
        }
        *value = r->cir;
        return true;
    case 0x74:
        if (write) {
            write_csr(b, *value);
        }
        *value = r->csr;
        return true;
    default:
        return plain(b, offset, write, value);
    }
}

/* After reset the CPU runs from HSI; the cause flags accumulate until RMVF clears them (RM0090 7.3.21). */
void rcc_reset(struct board *b, uint32_t cause_flags)
{
    uint32_t flags = (b->rcc.csr & 0xFE000000u) | cause_flags;
    for (unsigned id = EVENT_RCC_HSI; id <= EVENT_RCC_LSI; id++) {
        event_cancel(b, id);
    }
    b->rcc = (struct rcc){.cr = 0x83, .pllcfgr = 0x24003010, .csr = flags, .hpre = 1, .ppre1 = 1, .ppre2 = 1};
    b->rcc.enr[AHB1] = 0x00100000u;
    b->rcc.lpenr[AHB1] = 0x7E6791FFu;
    b->rcc.lpenr[AHB2] = 0xF1u;
    b->rcc.lpenr[AHB3] = 1u;
    b->rcc.lpenr[APB1] = 0x36FEC9FFu;
    b->rcc.lpenr[APB2] = 0x00075F33u;
    b->rcc.plli2scfgr = 0x20003000u;
    time_set_hz(b, b->hsi_hz);
}
