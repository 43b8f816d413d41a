/* Encoders at timers: digital filters, quadrature counting, captures and compare matches of the count; RM0090
 * sections 18.3.5, 18.3.8 and 18.3.12 ("capture, compare ... continue to work as normal").
 *
 * A level counts once it has held for the filter's samples. The phase of its sampling clock against the edges
 * is not modelled: an edge passes the filter exactly N samples after it came, a pulse shorter than that
 * never. */
#include "machine.h"

enum { CEN = 1 << 0, UIF = 1 << 0, CC1IF = 1 << 1, CC1OF = 1 << 9, CHANNELS = 4 };
enum { OUTPUT = 0, OWN_INPUT = 1 };

bool timer_is_encoder(const struct board *b, int timer)
{
    uint32_t mode = b->timer[timer].smcr & 7u;
    bool able = (timer >= 1 && timer <= 5) || timer == 8;
    return able && mode >= 1 && mode <= 3;
}

static bool same_pin(struct board_pin one, struct board_pin other)
{
    return one.port == other.port && one.number == other.number;
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
        if (w->wired && same_pin(w->a, one) && same_pin(w->b, two)) {
            return e + 1;
        }
        if (w->wired && same_pin(w->b, one) && same_pin(w->a, two)) {
            return -(e + 1);
        }
    }
    return 0;
}

static int encoder_of(const struct timer *t)
{
    return (t->encoder_source < 0 ? -t->encoder_source : t->encoder_source) - 1;
}

/* Which phase of its encoder a channel sees, and which channel a phase reaches. */
static int crossed(const struct timer *t, int phase)
{
    return t->encoder_source > 0 ? phase : 1 - phase;
}

/* The levels that the lines have now have long passed the filters. */
static void settle_inputs(const struct board *b, struct timer *t)
{
    const uint32_t levels = b->encoder[encoder_of(t)].levels;
    for (int channel = 0; channel < 2; channel++) {
        const bool level = encoder_line_is_high(levels, crossed(t, channel));
        t->input[channel] = (struct timer_input){.level = level, .passed = level};
    }
}

/* Pins have been routed anew, or the timer's mode has changed. */
void timer_route_encoder(struct board *b, int timer)
{
    struct timer *t = &b->timer[timer];
    const int source = timer_is_encoder(b, timer) ? source_of(b, timer) : 0;
    if (source == t->encoder_source) {
        return;
    }
    t->encoder_source = source;
    b->encoder_timers &= ~(1u << timer);
    b->encoder_timers |= source != 0 ? 1u << timer : 0u;
    encoder_lines_begin(b);
    encoder_lines_follow(b);
    if (source != 0) {
        settle_inputs(b, t);
    }
}

static uint32_t channel_mode(const struct timer *t, int channel)
{
    return t->ccmr[channel / 2] >> (8 * (channel % 2)) & 3u;
}

/* For how long a level must hold, ICxF: number of samples, and their clock as a division. */
static uint64_t filter_ps(const struct board *b, int timer, int channel)
{
    static const struct {
        uint8_t samples, divisor;
    } filters[16] = {{0, 0}, {2, 1}, {4, 1},  {8, 1},  {6, 2},  {8, 2},  {6, 4},  {8, 4},
                     {6, 8}, {8, 8}, {5, 16}, {6, 16}, {8, 16}, {5, 32}, {6, 32}, {8, 32}};
    const struct timer *t = &b->timer[timer];
    const uint32_t choice = t->ccmr[channel / 2] >> (8 * (channel % 2) + 4) & 0xFu;
    const uint32_t dts = choice < 4 ? 1u : 1u << (t->cr1 >> 8 & 3u);
    const uint64_t cycles =
        (uint64_t)filters[choice].samples * filters[choice].divisor * dts * rcc_timer_divisor(b, timer);
    return cycles * PS_PER_S / b->clock.hz;
}

static void capture(struct timer *t, int channel, uint32_t count)
{
    const uint32_t flag = (uint32_t)CC1IF << channel;
    t->sr |= (t->sr & flag) != 0 ? (uint32_t)CC1OF << channel : 0u;
    t->sr |= flag;
    t->ccr[channel] = count;
}

/* Compare matches of the counts on the way. */
static void match(struct timer *t, uint32_t before, int64_t counts)
{
    for (int channel = 0; channel < CHANNELS; channel++) {
        const uint32_t range = t->arr_active + 1;
        const uint32_t way = counts > 0 ? t->ccr_active[channel] - before : before - t->ccr_active[channel];
        const uint32_t ahead = range == 0 ? way : way % range;
        const bool passed = ahead != 0 && ahead <= (uint64_t)(counts > 0 ? counts : -counts);
        if (passed && channel_mode(t, channel) == OUTPUT) {
            t->sr |= (uint32_t)CC1IF << channel;
        }
    }
}

static void move_counter(struct timer *t, int64_t counts)
{
    const int64_t range = (int64_t)t->arr_active + 1;
    const uint32_t before = t->from;
    int64_t count = (int64_t)before + counts;
    if (counts == 0 || (t->cr1 & CEN) == 0 || t->frozen) {
        return;
    }
    t->down = counts < 0;
    if (count < 0 || count >= range) {
        t->sr |= UIF;
        count = ((count % range) + range) % range;
    }
    t->from = (uint32_t)count;
    match(t, before, counts);
}

/* CCxP: each inverted input turns the direction round. */
static bool inverted(const struct timer *t, int channel)
{
    return (t->ccer >> (4 * channel + 1) & 1u) != 0;
}

/* An edge that has passed its filter: counted, and captured by its own channel where it is a rising one (a
 * falling one when inverted). */
static void pass_edge(struct board *b, int timer, int channel)
{
    struct timer *t = &b->timer[timer];
    const uint32_t mode = t->smcr & 7u; /* 2 counts on TI1's edges, 1 on TI2's, 3 on both (RM0090 table 95) */
    const bool level = (t->input[channel].passed != inverted(t, channel));
    const bool other = (t->input[1 - channel].passed != inverted(t, 1 - channel));
    const bool up = (level != other) == (channel == 0);
    if ((mode & (channel == 0 ? 2u : 1u)) != 0) {
        move_counter(t, up ? 1 : -1);
    }
    const uint32_t enable = t->ccer >> (4 * channel);
    if (level && (enable & 1u) != 0 && channel_mode(t, channel) == OWN_INPUT) {
        capture(t, channel, t->from);
    }
    timer_update_line(b, timer);
}

/* Edges whose filters' time is over by then. */
static void pass_due(struct board *b, int timer, uint64_t time_ps)
{
    struct timer *t = &b->timer[timer];
    for (;;) {
        int first = -1;
        for (int channel = 0; channel < 2; channel++) {
            const struct timer_input *in = &t->input[channel];
            const bool due = in->level != in->passed && in->due_ps <= time_ps;
            if (due && (first < 0 || in->due_ps < t->input[first].due_ps)) {
                first = channel;
            }
        }
        if (first < 0) {
            return;
        }
        t->input[first].passed = t->input[first].level;
        pass_edge(b, timer, first);
    }
}

void timer_line_edge(struct board *b, int encoder, int phase, bool high, uint64_t time_ps)
{
    for (uint32_t left = b->encoder_timers; left != 0; left &= left - 1) {
        const int timer = __builtin_ctz(left);
        struct timer *t = &b->timer[timer];
        if (encoder_of(t) != encoder) {
            continue;
        }
        const int channel = crossed(t, phase);
        pass_due(b, timer, time_ps);
        t->input[channel].level = high;
        t->input[channel].due_ps = time_ps + filter_ps(b, timer, channel);
        pass_due(b, timer, time_ps);
    }
}

/* Whether what its encoder does at which moment shows in nothing but the timer's count. */
bool timer_only_counts(const struct board *b)
{
    for (uint32_t left = b->encoder_timers; left != 0; left &= left - 1) {
        const struct timer *t = &b->timer[__builtin_ctz(left)];
        if ((t->dier & ~t->sr & 0x1Fu) != 0 || (t->ccer & 0x1111u) != 0 || (t->smcr & 7u) != 3) {
            return false;
        }
    }
    return true;
}

/* Counts that no filter sees: the present levels hold afterwards. */
void timer_disc_turned(struct board *b, int encoder, int64_t counts)
{
    for (uint32_t left = b->encoder_timers; left != 0; left &= left - 1) {
        const int timer = __builtin_ctz(left);
        struct timer *t = &b->timer[timer];
        if (encoder_of(t) != encoder) {
            continue;
        }
        const bool reverse = (t->encoder_source < 0) != (inverted(t, 0) != inverted(t, 1));
        const int64_t seen = (t->smcr & 7u) == 3 ? counts : counts / 2;
        settle_inputs(b, t);
        move_counter(t, reverse ? -seen : seen);
    }
}

/* Takes in the edges that have passed their filters by then. */
void timer_inputs_pass(struct board *b, uint64_t time_ps)
{
    for (uint32_t left = b->encoder_timers; left != 0; left &= left - 1) {
        pass_due(b, __builtin_ctz(left), time_ps);
    }
}

/* Until when the timers that count an encoder have to be left alone: the next edge under way in a filter,
 * `change_ps` for the next one at the pins, NEVER where no count would interrupt. */
uint64_t timer_inputs_await(const struct board *b, int encoder, uint64_t change_ps)
{
    uint64_t next_ps = NEVER;
    for (uint32_t left = b->encoder_timers; left != 0; left &= left - 1) {
        const struct timer *t = &b->timer[__builtin_ctz(left)];
        const uint32_t awaited = t->dier & ~t->sr & 0x1Fu;
        if (encoder_of(t) != encoder || awaited == 0) {
            continue;
        }
        next_ps = change_ps < next_ps ? change_ps : next_ps;
        for (int channel = 0; channel < 2; channel++) {
            const struct timer_input *in = &t->input[channel];
            next_ps = in->level != in->passed && in->due_ps < next_ps ? in->due_ps : next_ps;
        }
    }
    return next_ps;
}
