/* Input capture of TIM11's channel 1 from HSE_RTC, the crystal over RTCPRE (RM0090 sections 7.2.11 and
 * 19.5.11), as far as polling sees it: rising edges, the channel's prescaler, CC1IF and CC1OF. The captures
 * up to the present moment are worked out when a register is accessed. */
#include "machine.h"

enum { CEN = 1 << 0, CC1E = 1 << 0, CC1P = 1 << 1, CC1NP = 1 << 3, CC1IF = 1 << 1, CC1OF = 1 << 9 };
enum { TIMER = 11, TI1_RMP = 3, HSE_RTC = 2, CC1S = 3, DIRECT = 1, IC1PSC = 2, IC1F = 0xF0 };

/* Counter of the running timer at an earlier cycle. */
static uint32_t count_at(const struct board *b, uint64_t cycle)
{
    const struct timer *t = &b->timer[TIMER];
    const uint64_t tick = (uint64_t)rcc_timer_divisor(b, TIMER) * (t->psc_active + 1u);
    const uint64_t period = (uint64_t)t->arr_active + 1;
    const uint64_t back = cycle < t->origin ? (t->origin - cycle + tick - 1) / tick : 0;
    return (uint32_t)((t->from + period - back % period) % period);
}

static bool listens(const struct timer *t)
{
    return (t->option & TI1_RMP) == HSE_RTC && (t->ccmr[0] & CC1S) == DIRECT && (t->ccer & CC1E) != 0 &&
           (t->cr1 & CEN) != 0;
}

void clock_capture_sync(struct board *b)
{
    struct timer *t = &b->timer[TIMER];
    struct clock_capture *c = &b->clock_capture;
    const uint64_t now_ps = time_to_ps(b, b->moment);
    const uint64_t source_mhz = rcc_hse_rtc_mhz(b);
    const uint32_t edges_each = 1u << (t->ccmr[0] >> IC1PSC & 3u);
    const bool on = listens(t) && source_mhz != 0;
    if (on && (t->ccmr[0] & IC1F || t->ccer & (CC1P | CC1NP))) {
        warn_once(b, 0xF0000070u, "TIM11: filter and falling edges of HSE_RTC are not modelled");
    }
    if (on != c->on || source_mhz != c->source_mhz || edges_each != c->edges_each) {
        *c = (struct clock_capture){source_mhz, edges_each, on, now_ps, 0};
    }
    if (!on) {
        return;
    }
    /* A capture each so many edges; the source in mHz, so that an uneven crystal keeps its frequency. */
    const uint64_t per_capture_fs = PS_PER_S * 1000000u / source_mhz * edges_each; /* 1e15 fs over 1e-3 */
    const uint64_t captures = (now_ps - c->since_ps) * 1000u / per_capture_fs;
    if (captures == c->taken) {
        return;
    }
    t->sr |= (t->sr & CC1IF) != 0 || captures > c->taken + 1 ? CC1IF | CC1OF : CC1IF;
    c->taken = captures;
    t->ccr[0] = count_at(b, time_to_cycle(b, c->since_ps + captures * per_capture_fs / 1000u));
}
