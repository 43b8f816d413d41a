/* What timers do at their pins: PWM outputs, and quadrature encoders counted in encoder mode. */
#include "machine.h"

enum { CEN = 1 << 0, CMS = 3 << 5, DIR = 1 << 4, MOE = 1 << 15, OSSI = 1 << 10 };
enum { BKE = 1 << 12, BKP = 1 << 13, BIF = 1 << 7 };

bool has_break(int timer)
{
    return timer == 1 || timer == 8;
}

/* Fraction of the period for which the reference OCxREF is high (RM0090 17.3.9 and 17.3.10). */
static double reference_duty(struct board *b, int timer, int channel)
{
    const struct timer *t = &b->timer[timer];
    uint32_t mode = t->ccmr[(channel - 1) / 2] >> (8 * ((channel - 1) % 2) + 4) & 7u;
    double compare = t->ccr_active[channel - 1];
    bool centred = (t->cr1 & CMS) != 0;
    double period = centred ? (double)t->arr_active : t->arr_active + 1.0;
    double duty;
    switch (mode) {
    case 5:
        return 1;
    case 6:
    case 7:
        if ((t->cr1 & CEN) == 0) {
            duty = t->from < t->ccr_active[channel - 1] ? 1 : 0; /* the counter does not run */
        } else {
            duty = period <= 0 || compare >= period ? 1 : compare / period;
        }
        return mode == 6 ? duty : 1 - duty;
    default: /* frozen, match and toggle modes: inactive until the first match, which is not modelled */
        return 0;
    }
}

/* Level or duty that a channel puts on its pin; below 0: it does not drive it. */
double timer_output(struct board *b, int timer, int channel)
{
    const struct timer *t = &b->timer[timer];
    uint32_t enable = t->ccer >> (4 * (channel - 1)) & 3u;
    bool input = (t->ccmr[(channel - 1) / 2] >> (8 * ((channel - 1) % 2)) & 3u) != 0;
    if (input || (enable & 1u) == 0) {
        return -1;
    }
    bool inverted = (enable & 2u) != 0;
    if (has_break(timer) && ((t->bdtr & MOE) == 0 || dbgmcu_freezes_tim(b, timer))) {
        if ((t->bdtr & OSSI) == 0) {
            return -1; /* outputs released, RM0090 table 96 */
        }
        return (t->cr2 >> (8 + 2 * (channel - 1)) & 1u) != 0 ? 1 : 0; /* idle state OISx */
    }
    double duty = reference_duty(b, timer, channel);
    return inverted ? 1 - duty : duty;
}

/* The break input clears MOE by itself, and holds it and its flag for as long as it is active
 * (RM0090 17.3.12); its source in the clock security system is not modelled. */
void timer_break_update(struct board *b, int timer)
{
    struct timer *t = &b->timer[timer];
    if ((t->bdtr & BKE) != 0 && break_level(b, timer) == ((t->bdtr & BKP) != 0)) {
        t->bdtr &= ~(uint32_t)MOE;
        t->sr |= BIF;
    }
}

bool timer_is_encoder(const struct board *b, int timer)
{
    uint32_t mode = b->timer[timer].smcr & 7u;
    bool able = (timer >= 1 && timer <= 5) || timer == 8;
    return able && mode >= 1 && mode <= 3;
}

/* Which encoder is wired to channels 1 and 2: +n straight, -n with the phases swapped, 0 none (n counts from
 * 1). */
static int source_of(const struct board *b, int timer)
{
    struct board_pin one;
    struct board_pin two;
    if (!pin_of_timer(b, timer, 1, &one) || !pin_of_timer(b, timer, 2, &two)) {
        return 0;
    }
    for (int e = 0; e < ENCODERS; e++) {
        const struct wired_encoder *w = &b->encoder[e];
        if (w->wired && w->a.port == one.port && w->a.number == one.number && w->b.port == two.port &&
            w->b.number == two.number) {
            return e + 1;
        }
        if (w->wired && w->b.port == one.port && w->b.number == one.number && w->a.port == two.port &&
            w->a.number == two.number) {
            return -(e + 1);
        }
    }
    return 0;
}

static int64_t floor_half(int64_t value)
{
    return value >= 0 ? value / 2 : -((1 - value) / 2);
}

/* Edges counted up to a position: all four of a period, or those of one phase alone (RM0090 18.3.12).
   A toggles between states 0 and 1 and between 2 and 3, B between 1 and 2 and between 3 and 0. */
static int64_t edges(uint32_t mode, bool swapped, int64_t position)
{
    if (mode == 3) {
        return position;
    }
    bool phase_a = (mode == 2) != swapped; /* mode 2 counts on TI1's edges, mode 1 on TI2's */
    return floor_half(phase_a ? position + 1 : position);
}

static int64_t position_now(struct board *b, int timer, int source)
{
    const struct timer *t = &b->timer[timer];
    const struct board_wires *wires = &b->options.wires;
    int encoder = source < 0 ? -source - 1 : source - 1;
    int64_t position = wires->encoder_position(wires->context, encoder, time_to_ps(b, b->moment));
    bool invert_one =
        (t->ccer & 1u << 1) != 0; /* CC1P, CC2P: each inverted phase turns the direction round */
    bool invert_two = (t->ccer & 1u << 5) != 0;
    int64_t counted = edges(t->smcr & 7u, source < 0, position);
    bool reverse = (source < 0) != (invert_one != invert_two);
    return reverse ? -counted : counted;
}

void timer_encoder_start(struct board *b, int timer)
{
    struct timer *t = &b->timer[timer];
    t->encoder_source = source_of(b, timer);
    t->encoder_seen = t->encoder_source != 0 ? position_now(b, timer, t->encoder_source) : 0;
}

void timer_encoder_sync(struct board *b, int timer)
{
    struct timer *t = &b->timer[timer];
    if (!timer_is_encoder(b, timer)) {
        return;
    }
    int source = source_of(b, timer);
    if (source != t->encoder_source) {
        timer_encoder_start(b, timer);
        return;
    }
    if (source == 0) {
        return;
    }
    int64_t position = position_now(b, timer, source);
    int64_t moved = position - t->encoder_seen;
    t->encoder_seen = position;
    if (moved == 0 || (t->cr1 & CEN) == 0) {
        return;
    }
    int64_t range = (int64_t)t->arr_active + 1;
    int64_t count = (int64_t)t->from + moved;
    t->down = moved < 0;
    if (count < 0 || count >= range) {
        t->sr |= 1u; /* UIF: an overflow or underflow occurred */
        count = ((count % range) + range) % range;
    }
    t->from = (uint32_t)count;
}
