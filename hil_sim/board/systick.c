/* SysTick and the cycle counter of the DWT: both count CPU cycles. */
#include "machine.h"

#include <string.h>

enum { ENABLE = 1, TICKINT = 2, CLKSOURCE = 4, COUNTFLAG = 1 << 16, EXTERNAL_DIVISOR = 8 };

static uint32_t divisor(const struct board *b)
{
    return (b->systick.ctrl & CLKSOURCE) != 0 ? 1 : EXTERNAL_DIVISOR;
}

static uint32_t value_at(const struct board *b, uint64_t cycle)
{
    const struct systick *s = &b->systick;
    if ((s->ctrl & ENABLE) == 0 || b->halted) {
        return s->from;
    }
    uint64_t ticks = (cycle - s->origin) / divisor(b);
    if (ticks <= s->from) {
        return s->from - (uint32_t)ticks;
    }
    if (s->load == 0) {
        return 0;
    }
    uint64_t past = (ticks - s->from - 1) % ((uint64_t)s->load + 1);
    return s->load - (uint32_t)past;
}

static void fold(struct board *b)
{
    b->systick.from = value_at(b, b->moment);
    b->systick.origin = b->moment;
}

/* The counter raises its exception when it goes from 1 to 0 (PM0214 4.5). */
static void schedule(struct board *b)
{
    const struct systick *s = &b->systick;
    if ((s->ctrl & ENABLE) == 0 || (s->from == 0 && s->load == 0)) {
        event_cancel(b, EVENT_SYSTICK);
        return;
    }
    uint64_t ticks = s->from != 0 ? s->from : (uint64_t)s->load + 1;
    event_at_cycle(b, EVENT_SYSTICK, s->origin + ticks * divisor(b));
}

void systick_event(struct board *b)
{
    b->systick.from = 0;
    b->systick.origin = b->moment;
    b->systick.ctrl |= COUNTFLAG;
    if ((b->systick.ctrl & TICKINT) != 0) {
        nvic_pend(b, EXC_SYSTICK, true);
    }
    schedule(b);
}

void systick_freeze(struct board *b, bool frozen)
{
    if (frozen) {
        fold(b);
        b->dwt.frozen_at = b->moment;
        event_cancel(b, EVENT_SYSTICK);
    } else {
        b->systick.origin = b->moment;
        b->dwt.origin += b->moment - b->dwt.frozen_at;
        schedule(b);
    }
}

void systick_reset(struct board *b)
{
    memset(&b->systick, 0, sizeof b->systick);
    b->systick.origin = b->moment;
    b->dwt = (struct dwt){.ctrl = 0x40000000u, .origin = b->moment, .frozen_at = b->moment};
    event_cancel(b, EVENT_SYSTICK);
}

/* Offsets from 0xE000E010. */
bool systick_access(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    struct systick *s = &b->systick;
    switch (offset) {
    case 0x0: /* CTRL */
        if (write) {
            fold(b);
            s->ctrl = (s->ctrl & COUNTFLAG) | (*value & 7u);
            schedule(b);
        } else {
            *value = s->ctrl;
            s->ctrl &= ~(uint32_t)COUNTFLAG;
        }
        return true;
    case 0x4: /* LOAD */
        if (write) {
            fold(b);
            s->load = *value & 0xFFFFFFu;
            schedule(b);
        } else {
            *value = s->load;
        }
        return true;
    case 0x8: /* VAL: any write clears it */
        if (write) {
            s->from = 0;
            s->origin = b->moment;
            s->ctrl &= ~(uint32_t)COUNTFLAG;
            schedule(b);
        } else {
            *value = value_at(b, b->moment);
        }
        return true;
    case 0xC: /* CALIB: 10.5 MHz reference gives 1 ms */
        *value = 0x40002904u;
        return true;
    default:
        return false;
    }
}

uint64_t board_next_tick_ps(const struct board *board)
{
    const uint64_t at = board->events[EVENT_SYSTICK].at;
    return at == NEVER ? UINT64_MAX : time_to_ps(board, at);
}
