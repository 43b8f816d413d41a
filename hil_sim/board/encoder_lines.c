/* The lines of wired encoders: every change of level at their pins, in order, for whatever follows them.
 *
 * Pins are not polled. The wires say until when an encoder's lines cannot change; they are asked again when a
 * register that depends on them is accessed after that, and a change is taken in with the time at which it
 * came. The encoders turn on one robot, so the earliest change of all is taken in first. */
#include "machine.h"

enum { PHASES = 2 };
#define LEAP_MARGIN_PS (100 * PS_PER_US)

/* Whether any part of the chip follows the encoders' lines at present. */
static bool followed(const struct board *b)
{
    return b->encoder_timers != 0 || ((b->exti.rtsr | b->exti.ftsr) & 0xFFFFu) != 0;
}

static int64_t position_at(const struct board *b, int encoder, uint64_t time_ps)
{
    return b->options.wires.encoder_position(b->options.wires.context, encoder, time_ps);
}

static uint8_t noise_at(const struct board *b, int encoder, uint64_t time_ps)
{
    const struct board_wires *wires = &b->options.wires;
    return wires->encoder_noise == NULL ? 0 : wires->encoder_noise(wires->context, encoder, time_ps);
}

static uint8_t levels_of(int64_t position, uint8_t noise)
{
    return (uint8_t)((phase_level(position, false) ? 1u : 0u) | (phase_level(position, true) ? 2u : 0u)) ^
           noise;
}

uint8_t encoder_levels(struct board *b, int encoder)
{
    const uint64_t now_ps = time_to_ps(b, b->moment);
    return levels_of(position_at(b, encoder, now_ps), noise_at(b, encoder, now_ps));
}

static uint64_t quiet_until(const struct board *b, int encoder, uint64_t time_ps)
{
    const struct board_wires *wires = &b->options.wires;
    return wires->encoder_quiet_until == NULL ? NEVER
                                              : wires->encoder_quiet_until(wires->context, encoder, time_ps);
}

/* The lines go over to these levels; A changes before B. */
static void change_levels(struct board *b, int encoder, uint8_t levels, uint64_t time_ps)
{
    struct wired_encoder *w = &b->encoder[encoder];
    const uint8_t changed = w->levels ^ levels;
    w->levels = levels;
    for (int phase = 0; phase < PHASES; phase++) {
        if (encoder_line_is_high(changed, phase)) {
            const bool high = encoder_line_is_high(levels, phase);
            exti_pin_edge(b, phase == 0 ? w->a : w->b, high);
            timer_line_edge(b, encoder, phase, high, time_ps);
        }
    }
}

static void take_in(struct board *b, int encoder, uint64_t time_ps)
{
    struct wired_encoder *w = &b->encoder[encoder];
    const int64_t position = position_at(b, encoder, time_ps);
    const int64_t moved = position - w->position;
    w->position = position;
    if (moved > 1 || moved < -1) {
        /* No wheel does that, but whoever turns the disc in a test: it counts whatever filters say, and its
         * edges repeat beyond a whole period. */
        const int64_t step = moved > 0 ? 1 : -1;
        for (int64_t left = moved * step > 4 ? 4 : moved * step; left > 0; left--) {
            const uint8_t levels = levels_of(position - step * (left - 1), 0);
            for (int phase = 0; phase < PHASES; phase++) {
                if (encoder_line_is_high(w->levels ^ levels, phase)) {
                    exti_pin_edge(b, phase == 0 ? w->a : w->b, encoder_line_is_high(levels, phase));
                }
            }
            w->levels = levels;
        }
        timer_disc_turned(b, encoder, moved);
    }
    change_levels(b, encoder, levels_of(position, noise_at(b, encoder, time_ps)), time_ps);
    w->change_ps = quiet_until(b, encoder, time_ps);
}

/* Begins to follow the lines, at the levels that they have. */
void encoder_lines_begin(struct board *b)
{
    const bool wanted = followed(b) && b->options.wires.encoder_position != NULL;
    const uint64_t now_ps = time_to_ps(b, b->moment);
    for (int i = 0; i < ENCODERS && wanted && !b->encoders_followed; i++) {
        struct wired_encoder *w = &b->encoder[i];
        if (w->wired) {
            w->position = position_at(b, i, now_ps);
            w->levels = levels_of(w->position, noise_at(b, i, now_ps));
            w->change_ps = quiet_until(b, i, now_ps);
        }
    }
    b->encoders_followed = wanted;
}

/* Clean edges that nobody waits for are counted by their number alone, all but those of the last moments,
 * which may still be within a filter. */
static void leap(struct board *b, uint64_t now_ps)
{
    const uint64_t until_ps = now_ps - LEAP_MARGIN_PS;
    uint64_t first_ps = NEVER;
    for (int i = 0; i < ENCODERS; i++) {
        const struct wired_encoder *w = &b->encoder[i];
        if (w->wired && w->noisy) {
            return;
        }
        first_ps = w->wired && w->change_ps < first_ps ? w->change_ps : first_ps;
    }
    if (now_ps < LEAP_MARGIN_PS || first_ps >= until_ps || (b->exti.rtsr & 0xFFFFu) != 0 ||
        (b->exti.ftsr & 0xFFFFu) != 0 || !timer_only_counts(b)) {
        return;
    }
    timer_inputs_pass(b, until_ps);
    for (int i = 0; i < ENCODERS; i++) {
        struct wired_encoder *w = &b->encoder[i];
        if (w->wired && w->change_ps < until_ps) {
            const int64_t position = position_at(b, i, until_ps);
            const int64_t moved = position - w->position;
            w->position = position;
            w->levels = levels_of(position, 0);
            timer_disc_turned(b, i, moved);
            w->change_ps = quiet_until(b, i, until_ps);
        }
    }
}

/* Takes in every change up to the present moment that the wires predict. Whatever moves the robot on comes
 * after this, or its past would be lost. */
void encoder_lines_follow(struct board *b)
{
    if (!b->encoders_followed) {
        return;
    }
    const uint64_t now_ps = time_to_ps(b, b->moment);
    leap(b, now_ps);
    for (;;) {
        int first = -1;
        uint64_t change_ps = now_ps;
        for (int i = 0; i < ENCODERS; i++) {
            if (b->encoder[i].wired && b->encoder[i].change_ps <= change_ps) {
                change_ps = b->encoder[i].change_ps;
                first = i;
            }
        }
        if (first < 0) {
            break;
        }
        take_in(b, first, change_ps);
    }
    timer_inputs_pass(b, now_ps);
}

/* Sets an event for every encoder whose next change, or one that its filter still holds, would interrupt. */
void encoder_lines_schedule(struct board *b)
{
    for (int i = 0; i < ENCODERS; i++) {
        const struct wired_encoder *w = &b->encoder[i];
        const unsigned id = EVENT_ENCODER0 + (unsigned)i;
        uint64_t next_ps = NEVER;
        if (w->wired && b->encoders_followed) {
            next_ps = timer_inputs_await(b, i, w->change_ps);
            next_ps = exti_awaits(b, w) && w->change_ps < next_ps ? w->change_ps : next_ps;
        }
        if (next_ps != NEVER) {
            event_at_ps(b, id, next_ps);
        } else if (b->events[id].at != NEVER) {
            event_cancel(b, id);
        }
    }
}

void encoder_lines_event(struct board *b)
{
    encoder_lines_follow(b);
    encoder_lines_schedule(b);
}
