/* Timers TIM1 to TIM14: counting, update events and registers, RM0090 sections 17 to 20. */
#include "machine.h"

enum { CEN = 1 << 0, UDIS = 1 << 1, URS = 1 << 2, OPM = 1 << 3, DIR = 1 << 4, CMS = 3 << 5, ARPE = 1 << 7 };
enum { UIF = 1 << 0, CCIF = 0xF << 1, UIE = 1 << 0, UG = 1 << 0 };

static bool wide(int timer)
{
    return timer == 2 || timer == 5;
}

static bool basic(int timer)
{
    return timer == 6 || timer == 7;
}

static uint32_t mask(int timer)
{
    return wide(timer) ? 0xFFFFFFFFu : 0xFFFFu;
}

static bool centred(const struct timer *t)
{
    return (t->cr1 & CMS) != 0;
}

/* CPU cycles of one tick of the counter. */
static uint64_t tick_cycles(const struct board *b, int timer)
{
    return (uint64_t)rcc_timer_divisor(b, timer) * (b->timer[timer].psc_active + 1u);
}

/* Ticks from one overflow to the same one again. */
static uint64_t period(const struct timer *t)
{
    uint64_t top = t->arr_active;
    return centred(t) ? (top == 0 ? 1 : 2 * top) : top + 1;
}

/* Counter value for a position within its period: up, down, or up and down again. */
static uint32_t count_of(const struct timer *t, uint32_t position)
{
    if (centred(t)) {
        return position <= t->arr_active ? position : 2 * t->arr_active - position;
    }
    return (t->cr1 & DIR) != 0 ? t->arr_active - position : position;
}

static uint32_t position_of(const struct timer *t, uint32_t count)
{
    count = count > t->arr_active ? t->arr_active : count;
    return !centred(t) && (t->cr1 & DIR) != 0 ? t->arr_active - count : count;
}

static void load_shadows(struct timer *t)
{
    t->psc_active = t->psc;
    t->arr_active = t->arr;
    for (int i = 0; i < 4; i++) {
        t->ccr_active[i] = t->ccr[i];
    }
    t->repeats = t->rcr;
}

static bool shadows_differ(const struct timer *t)
{
    bool differ = t->psc_active != t->psc || t->arr_active != t->arr;
    for (int i = 0; i < 4; i++) {
        differ = differ || t->ccr_active[i] != t->ccr[i];
    }
    return differ;
}

/* Interrupts: TIM1 and TIM8 share that of their updates with TIM10 and TIM13, the others have one for update,
 * captures and matches (RM0090 table 62). */
void timer_update_line(struct board *b, int timer)
{
    static const uint8_t irq[TIMERS + 1] = {0, 25, 28, 29, 30, 50, 54, 55, 44, 24, 25, 26, 43, 44, 45};
    const struct timer *t = &b->timer[timer];
    const uint32_t own = timer >= 2 && timer <= 5 ? UIF | CCIF : UIF;
    nvic_set_line(b, irq[timer], (t->sr & t->dier & own) != 0);
}

static void raise_update(struct board *b, int timer)
{
    b->timer[timer].sr |= UIF;
    timer_update_line(b, timer);
}

/* Brings the counter to the present moment. Overflows that no event was set for only leave their flag. */
void timer_sync(struct board *b, int timer)
{
    struct timer *t = &b->timer[timer];
    if (timer_is_encoder(b, timer)) {
        encoder_lines_follow(b);
        return;
    }
    if ((t->cr1 & CEN) == 0 || t->frozen) {
        t->origin = b->moment;
        return;
    }
    uint64_t tick = tick_cycles(b, timer);
    uint64_t ticks = (b->moment - t->origin) / tick;
    uint64_t reached = t->from + ticks;
    uint64_t overflows = reached / period(t);
    t->origin += ticks * tick;
    t->from = (uint32_t)(reached % period(t));
    if (overflows == 0 || (t->cr1 & UDIS) != 0) {
        return;
    }
    if (overflows > t->repeats) {
        t->repeats = t->rcr - (uint32_t)((overflows - t->repeats - 1) % (t->rcr + 1ULL));
        if ((t->sr & UIF) == 0) {
            raise_update(b, timer);
        }
        bool stop = (t->cr1 & OPM) != 0;
        if (shadows_differ(t)) {
            uint32_t repeats = t->repeats;
            load_shadows(t);
            t->repeats = repeats;
        }
        if (stop) {
            t->cr1 &= ~(uint32_t)CEN;
            t->from = 0;
        }
    } else {
        t->repeats -= (uint32_t)overflows;
    }
}

/* An event at the next update is needed only when it has an effect at that time. */
void timer_schedule(struct board *b, int timer)
{
    struct timer *t = &b->timer[timer];
    const unsigned id = EVENT_TIMER0 + (unsigned)timer - 1;
    bool noticed = shadows_differ(t) || (t->dier & UIE) != 0 || (t->cr1 & OPM) != 0;
    if ((t->cr1 & (CEN | UDIS)) != CEN || t->frozen || timer_is_encoder(b, timer) || !noticed) {
        event_cancel(b, id);
        return;
    }
    uint64_t ticks = (t->repeats + 1ULL) * period(t) - t->from;
    event_at_cycle(b, id, t->origin + ticks * tick_cycles(b, timer));
}

void timer_event(struct board *b, int timer)
{
    timer_sync(b, timer);
    timer_schedule(b, timer);
    pins_update(b);
}

void timer_reset(struct board *b, int timer)
{
    b->timer[timer] = (struct timer){.arr = mask(timer), .arr_active = mask(timer), .origin = b->moment};
    b->encoder_timers &= ~(1u << timer);
    encoder_lines_begin(b);
    event_cancel(b, EVENT_TIMER0 + (unsigned)timer - 1);
    timer_update_line(b, timer);
    pins_update(b);
}

/* EGR.UG: starts a new period and takes the preloaded values in (RM0090 17.4.6). */
static void generate(struct board *b, int timer)
{
    struct timer *t = &b->timer[timer];
    timer_sync(b, timer);
    load_shadows(t);
    t->from = 0;
    t->origin = b->moment;
    if ((t->cr1 & URS) == 0 && (t->cr1 & UDIS) == 0) {
        raise_update(b, timer);
    }
}

/* A capture register is read-only (RM0090 18.4.13). */
static void write_compare(struct timer *t, int timer, uint32_t channel, uint32_t value)
{
    if ((t->ccmr[channel / 2] >> (8 * (channel % 2)) & 3u) != 0) {
        return;
    }
    uint32_t preload = t->ccmr[channel / 2] >> (8 * (channel % 2) + 3) & 1u;
    t->ccr[channel] = value & mask(timer);
    if (preload == 0) {
        t->ccr_active[channel] = t->ccr[channel];
    }
}

static void note_inputs(struct board *b, int timer)
{
    const struct timer *t = &b->timer[timer];
    for (int channel = 0; channel < 4; channel++) {
        const uint32_t mode = t->ccmr[channel / 2] >> (8 * (channel % 2)) & 0xFFu;
        if ((mode & 3u) == 2 || ((mode & 3u) != 0 && (mode & 0xCu) != 0)) {
            warn_once(b, 0xF0000040u + (uint32_t)timer, "TIM%d captures the other input, or every few edges",
                      timer);
        }
    }
}

static void write_register(struct board *b, int timer, uint32_t offset, uint32_t value)
{
    struct timer *t = &b->timer[timer];
    bool was_encoder = timer_is_encoder(b, timer);
    timer_sync(b, timer);
    uint32_t count = was_encoder ? t->from : count_of(t, t->from);
    switch (offset) {
    case 0x00:
        t->cr1 = value & 0x3FFu;
        t->from = was_encoder ? t->from : position_of(t, count);
        break;
    case 0x04:
        t->cr2 = value;
        break;
    case 0x08:
        t->smcr = value;
        if ((value & 7u) > 3 || (value & 0x70u) > 0x30u) {
            warn_once(b, 0xF0000020u + (uint32_t)timer, "TIM%d slave mode or trigger %x is not modelled",
                      timer, (unsigned)value & 0x77u);
        }
        break;
    case 0x0C:
        t->dier = value;
        if ((value & ~(uint32_t)(was_encoder && timer <= 5 && timer >= 2 ? UIE | CCIF : UIE)) != 0) {
            warn_once(
                b, 0xF0000030u + (uint32_t)timer,
                "TIM%d requests other than update, or captures and matches of an encoder, are not modelled",
                timer);
        }
        break;
    case 0x10:
        t->sr &= value;
        break;
    case 0x14:
        if ((value & UG) != 0) {
            generate(b, timer);
        }
        break;
    case 0x18:
    case 0x1C:
        t->ccmr[(offset - 0x18) / 4] = value;
        if (timer != 11) { /* clock_capture.c */
            note_inputs(b, timer);
        }
        break;
    case 0x20:
        t->ccer = value;
        break;
    case 0x24:
        t->from = was_encoder ? value & mask(timer) : position_of(t, value & mask(timer));
        break;
    case 0x28:
        t->psc = value & 0xFFFFu;
        break;
    case 0x2C:
        t->arr = value & mask(timer);
        if ((t->cr1 & ARPE) == 0) {
            t->arr_active = t->arr;
            t->from = was_encoder || t->from < period(t) ? t->from : 0;
        }
        break;
    case 0x30:
        t->rcr = value & 0xFFu;
        break;
    case 0x44:
        t->bdtr = value;
        break;
    case 0x48:
        t->dcr = value;
        break;
    case 0x50:
        t->option = value;
        break;
    default:
        write_compare(t, timer, (offset - 0x34) / 4, value);
    }
    if (!was_encoder && timer_is_encoder(b, timer)) {
        t->from = count;
    }
    if (offset == 0x08) {
        timer_route_encoder(b, timer);
    }
    if (t->encoder_source != 0 && (offset == 0x08 || offset == 0x0C || offset == 0x10)) {
        encoder_lines_schedule(b);
    }
    if (has_break(timer)) {
        timer_break_update(b, timer);
    }
    if (timer == 11) {
        clock_capture_sync(b);
    }
    timer_update_line(b, timer);
    timer_schedule(b, timer);
    if (offset != 0x0C && offset != 0x10) { /* enabling and clearing requests changes no output */
        pins_update(b);
    }
}

/* A register that reads as it stands. */
static uint32_t plain_register(const struct timer *t, uint32_t offset)
{
    const uint32_t plain[] = {t->cr1,     t->cr2,    t->smcr,   t->dier, t->sr,  0,      t->ccmr[0],
                              t->ccmr[1], t->ccer,   0,         t->psc,  t->arr, t->rcr, t->ccr[0],
                              t->ccr[1],  t->ccr[2], t->ccr[3], t->bdtr, t->dcr, 0,      t->option};
    return plain[offset / 4];
}

static uint32_t read_register(struct board *b, int timer, uint32_t offset)
{
    struct timer *t = &b->timer[timer];
    if (timer == 11) {
        timer_sync(b, timer);
        clock_capture_sync(b);
    }
    if (offset == 0x24 || offset == 0x10 || offset == 0x00) {
        timer_sync(b, timer);
        if (offset == 0x10) {
            return t->sr;
        }
        bool encoder = timer_is_encoder(b, timer);
        if (offset == 0x00) {
            bool down = encoder ? t->down : centred(t) && t->from > t->arr_active;
            return (t->cr1 & ~(uint32_t)(encoder || centred(t) ? DIR : 0)) | (down ? DIR : 0);
        }
        if (encoder) {
            trace_add(b, TRACE_ENCODER, (uint32_t)timer, t->from);
            return t->from;
        }
        return count_of(t, t->from);
    }
    if (offset >= 0x34 && offset <= 0x40) {
        const uint32_t channel = (offset - 0x34) / 4;
        timer_sync(b, timer);
        if ((t->ccmr[channel / 2] >> (8 * (channel % 2)) & 3u) != 0) {
            t->sr &= ~(2u << channel); /* reading a capture clears its flag */
        }
        return t->ccr[channel];
    }
    return plain_register(t, offset);
}

bool timer_access(struct board *b, int timer, uint32_t offset, bool write, uint32_t *value)
{
    bool exists = offset <= 0x50 && (offset & 3u) == 0 && offset != 0x4C;
    exists =
        exists && (!basic(timer) || offset <= 0x14 || offset == 0x24 || offset == 0x28 || offset == 0x2C);
    if (!exists) {
        return false;
    }
    if (write) {
        write_register(b, timer, offset, *value);
    } else {
        *value = read_register(b, timer, offset);
    }
    return true;
}
