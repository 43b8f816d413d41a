/* External interrupts: edges at the pins of wired encoders, of the voltage detector, and by software; RM0090
 * section 12.2.
 *
 * Edges are taken in when the unit is accessed. */
#include "machine.h"

enum { MODE_OUTPUT = 1, MODE_ANALOG = 3, LINES = 16 };

static unsigned irq_of(unsigned line)
{
    return line < 5 ? IRQ_EXTI0 + line : line < 10 ? IRQ_EXTI9_5 : IRQ_EXTI15_10;
}

static void update_lines(struct board *b)
{
    uint32_t on = b->exti.pr & b->exti.imr;
    for (unsigned i = 0; i < 5; i++) {
        nvic_set_line(b, irq_of(i), (on >> i & 1u) != 0);
    }
    nvic_set_line(b, IRQ_PVD, (on & 0x10000u) != 0);
    nvic_set_line(b, IRQ_EXTI9_5, (on & 0x03E0u) != 0);
    nvic_set_line(b, IRQ_EXTI15_10, (on & 0xFC00u) != 0);
}

/* Bit of the line that watches a pin, 0 when none does. Its input stage is off in analogue mode
   (RM0090 8.3.12); beside an alternate function it stays on (8.3.11). */
static uint32_t line_of(const struct board *b, struct board_pin pin)
{
    uint32_t port = (uint32_t)(pin.port - 'A');
    uint32_t chosen = b->syscfg_exticr[pin.number / 4] >> (4 * (pin.number % 4)) & 0xFu;
    uint32_t mode = b->gpio[port].moder >> (2 * pin.number) & 3u;
    return chosen == port && mode != MODE_OUTPUT && mode != MODE_ANALOG ? 1u << pin.number : 0;
}

/* An edge at a pin. */
void exti_pin_edge(struct board *b, struct board_pin pin, bool rises)
{
    const uint32_t line = line_of(b, pin) & (rises ? b->exti.rtsr : b->exti.ftsr);
    if (line != 0) {
        b->exti.pr |= line;
        update_lines(b);
    }
}

void exti_sync(struct board *b)
{
    encoder_lines_follow(b);
    update_lines(b);
}

/* Whether the next edge of an encoder would interrupt. */
bool exti_awaits(const struct board *b, const struct wired_encoder *w)
{
    const uint32_t awaited = b->exti.imr & (b->exti.rtsr | b->exti.ftsr) & ~b->exti.pr;
    return awaited != 0 && ((line_of(b, w->a) | line_of(b, w->b)) & awaited) != 0;
}

/* An edge of a line that no pin drives. */
void exti_edge(struct board *b, uint32_t line, bool rises)
{
    b->exti.pr |= line & (rises ? b->exti.rtsr : b->exti.ftsr);
    update_lines(b);
    cpu_update_break(b);
}

void exti_reset(struct board *b)
{
    b->exti = (struct exti){0};
    encoder_lines_begin(b);
    encoder_lines_schedule(b);
}

static void note_unwatched(struct board *b)
{
    uint32_t wired = 0;
    for (int i = 0; i < ENCODERS; i++) {
        wired |= b->encoder[i].wired ? 1u << b->encoder[i].a.number | 1u << b->encoder[i].b.number : 0;
    }
    if (((b->exti.rtsr | b->exti.ftsr) & ((1u << LINES) - 1u) & ~wired) != 0) {
        warn_once(b, 0xF00000D0u, "EXTI follows edges at the pins of encoders only");
    }
}

/* The pending register collects edges whether or not they may interrupt: the mask lies behind it (block
 * diagram in 12.2.2).
 */
bool exti_access(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    struct exti *e = &b->exti;
    uint32_t *const store[] = {&e->imr, &e->emr, &e->rtsr, &e->ftsr};
    if (offset > 0x14) {
        return false;
    }
    exti_sync(b);
    if (offset < 0x10) {
        *store[offset / 4] = write ? *value & 0x7FFFFFu : *store[offset / 4];
        *value = *store[offset / 4];
        note_unwatched(b);
        encoder_lines_begin(b);
    } else if (offset == 0x10) {
        e->pr |= write ? *value & e->imr : 0;
        *value = 0;
    } else {
        e->pr &= write ? ~*value : ~0u;
        *value = e->pr;
    }
    if (write) {
        update_lines(b);
        encoder_lines_schedule(b);
    }
    return true;
}
