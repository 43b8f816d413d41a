/* Virtual time: CPU cycles, their length in picoseconds, and the events that wait for them. */
#include "machine.h"

/* Picoseconds of a cycle as a fraction in lowest terms: 128 bits are slow, and needed for long spans only. */
static void set_ratio(struct clock *clock, uint32_t hz)
{
    uint64_t divisor = PS_PER_S;
    uint64_t rest = hz;
    while (rest != 0) {
        const uint64_t next = divisor % rest;
        divisor = rest;
        rest = next;
    }
    clock->hz = hz;
    clock->ps_numerator = PS_PER_S / divisor;
    clock->ps_denominator = hz / divisor;
    if (clock->ps_numerator == 0 || clock->ps_denominator == 0) { /* never: the divisor divides both */
        return;
    }
    clock->exact_cycles = UINT64_MAX / clock->ps_numerator;
    clock->exact_ps = (UINT64_MAX - clock->ps_numerator) / clock->ps_denominator;
}

uint64_t time_to_ps(const struct board *b, uint64_t cycle)
{
    const uint64_t cycles = cycle - b->clock.segment_cycle;
    if (cycles == 0) {
        return b->clock.segment_ps;
    }
    if (cycles <= b->clock.exact_cycles) {
        return b->clock.segment_ps + cycles * b->clock.ps_numerator / b->clock.ps_denominator;
    }
    return b->clock.segment_ps + (uint64_t)((unsigned __int128)cycles * PS_PER_S / b->clock.hz);
}

/* First cycle that begins at or after the given time; a time gone by is the segment's first cycle. */
uint64_t time_to_cycle(const struct board *b, uint64_t ps)
{
    if (ps == NEVER) {
        return NEVER;
    }
    if (ps <= b->clock.segment_ps) {
        return b->clock.segment_cycle;
    }
    const uint64_t span_ps = ps - b->clock.segment_ps;
    const uint64_t numerator = b->clock.ps_numerator;
    if (span_ps <= b->clock.exact_ps) {
        return b->clock.segment_cycle + (span_ps * b->clock.ps_denominator + numerator - 1) / numerator;
    }
    unsigned __int128 span = (unsigned __int128)span_ps * b->clock.hz;
    return b->clock.segment_cycle + (uint64_t)((span + PS_PER_S - 1) / PS_PER_S);
}

static void find_next(struct board *b)
{
    uint64_t next = NEVER;
    for (uint64_t left = b->events_set; left != 0; left &= left - 1) {
        const uint64_t at = b->events[__builtin_ctzll(left)].at;
        next = at < next ? at : next;
    }
    b->next_event = next;
    cpu_update_break(b);
}

/* The CPU clock changes at this moment: events in real time keep their time, those in cycles their count.
 */
void time_set_hz(struct board *b, uint32_t hz)
{
    b->clock.segment_ps = time_to_ps(b, b->moment);
    b->clock.segment_cycle = b->moment;
    set_ratio(&b->clock, hz);
    for (unsigned i = 0; i < EVENTS; i++) {
        if (b->events[i].in_ps && b->events[i].at != NEVER) {
            b->events[i].at = time_to_cycle(b, b->events[i].at_ps);
        }
    }
    b->target = time_to_cycle(b, b->target_ps);
    find_next(b);
}

static void set_event(struct board *b, unsigned id, uint64_t cycle)
{
    uint64_t before = b->events[id].at;
    b->events[id].at = cycle;
    b->events_set = (b->events_set & ~(1ULL << id)) | (uint64_t)(cycle != NEVER) << id;
    if (b->in_event) {
        return; /* events_run looks for the next one afterwards */
    }
    if (cycle < b->next_event) {
        b->next_event = cycle;
        cpu_update_break(b);
    } else if (before == b->next_event) {
        find_next(b);
    }
}

void event_at_cycle(struct board *b, unsigned id, uint64_t cycle)
{
    b->events[id].in_ps = false;
    set_event(b, id, cycle);
}

void event_at_ps(struct board *b, unsigned id, uint64_t ps)
{
    b->events[id].in_ps = true;
    b->events[id].at_ps = ps;
    set_event(b, id, time_to_cycle(b, ps));
}

void event_cancel(struct board *b, unsigned id)
{
    b->events[id].in_ps = false;
    set_event(b, id, NEVER);
}

static void dispatch(struct board *b, unsigned id)
{
    if (id == EVENT_SYSTICK) {
        systick_event(b);
    } else if (id <= EVENT_RCC_LSI) {
        rcc_event(b, id);
    } else if (id == EVENT_IWDG) {
        iwdg_event(b);
    } else if (id == EVENT_FLASH) {
        flash_event(b);
    } else if (id < EVENT_USART_TX0) {
        timer_event(b, (int)(id - EVENT_TIMER0) + 1);
    } else if (id < EVENT_USART_RX0) {
        usart_tx_event(b, (int)(id - EVENT_USART_TX0) + 1);
    } else if (id < EVENT_USART_IDLE0) {
        usart_rx_event(b, (int)(id - EVENT_USART_RX0) + 1);
    } else if (id < EVENT_ADC0) {
        usart_idle_event(b, (int)(id - EVENT_USART_IDLE0) + 1);
    } else if (id == EVENT_CAN) {
        can_event(b);
    } else if (id == EVENT_CAN_JOIN) {
        can_join_event(b);
    } else if (id < EVENT_ENCODER0) {
        adc_event(b, (int)(id - EVENT_ADC0) + 1);
    } else {
        encoder_lines_event(b);
    }
}

/* Runs all events that are due, each at its own time, in order; ties are broken by the event's number. */
void events_run(struct board *b, uint64_t until)
{
    uint64_t resume = b->moment;
    const enum board_phase before = board_enter(b, BOARD_PERIPHERALS);
    while (b->next_event <= until && !b->reset_wanted) {
        uint64_t left = b->events_set;
        while (b->events[__builtin_ctzll(left)].at != b->next_event) {
            left &= left - 1;
        }
        const unsigned due = (unsigned)__builtin_ctzll(left);
        b->moment = b->next_event;
        b->in_event = true;
        event_cancel(b, due);
        dispatch(b, due);
        b->in_event = false;
        find_next(b);
    }
    board_enter(b, before);
    b->moment = resume > b->moment ? resume : b->moment;
    if (!b->reset_wanted) {
        b->moment = until > b->moment ? until : b->moment;
    }
}

uint64_t board_time_ps(const struct board *board)
{
    return board->target_ps;
}
