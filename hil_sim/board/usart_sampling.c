/* What a USART's receiver makes of a byte on its line: samples of each bit by its own clock, majority, noise
 * and framing (RM0090 section 30.3.3). Asked for when the line is disturbed or the speeds differ by enough to
 * matter; otherwise every sample lies well within its bit.
 *
 * Each byte is looked at by itself: a receiver that has lost the beginning of one finds that of the next. */
#include "machine.h"

#include <math.h>

enum { DATA_BITS = 8, STOP = 9, SAMPLES = 3 };

struct line {
    const struct board *board;
    int usart;
    const struct inbound *byte, *next; /* NULL: nothing is on its way */
};

static double begin_ps(const struct inbound *byte)
{
    return (double)byte->end_ps - 10.0 * (double)PS_PER_S / (double)byte->baud;
}

static bool level_of(const struct inbound *byte, double at_ps)
{
    const double place = (at_ps - begin_ps(byte)) * (double)byte->baud / (double)PS_PER_S;
    if (place < 0 || place >= STOP) {
        return true;
    }
    return place >= 1 && (byte->byte >> ((uint32_t)place - 1u) & 1u) != 0;
}

static bool level(const struct line *line, double at_ps)
{
    const struct board_wires *wires = &line->board->options.wires;
    bool high = level_of(line->byte, at_ps);
    if (line->next != NULL && at_ps >= (double)line->byte->end_ps) {
        high = level_of(line->next, at_ps);
    }
    const bool turned = wires->usart_noise != NULL && line->board->usart_noisy &&
                        wires->usart_noise(wires->context, line->usart, (uint64_t)at_ps);
    return high != turned;
}

/* How many of three samples are high. */
static uint32_t highs(const struct line *line, double begin, double tick_ps, const uint32_t at[SAMPLES])
{
    uint32_t sum = 0;
    for (int i = 0; i < SAMPLES; i++) {
        sum += level(line, begin + at[i] * tick_ps) ? 1u : 0u;
    }
    return sum;
}

struct usart_sampled usart_sample(const struct board *b, int usart, const struct inbound *byte,
                                  const struct inbound *next, double bit_ps)
{
    static const uint32_t start[SAMPLES] = {3, 5, 7};
    static const uint32_t by_16[SAMPLES] = {8, 9, 10};
    static const uint32_t by_8[SAMPLES] = {4, 5, 6};
    const struct usart *u = &b->usart[usart];
    const bool over8 = (u->cr1 & USART_OVER8) != 0;
    const bool one_sample = (u->cr3 & USART_ONEBIT) != 0;
    const struct line line = {b, usart, byte, next};
    const uint32_t *middle = over8 ? by_8 : by_16;
    const double tick_ps = bit_ps / (over8 ? 8 : 16);
    /* The edge is noticed with the next sample. */
    const double first = ceil(begin_ps(byte) / tick_ps) * tick_ps;
    struct usart_sampled out = {.heard = true};
    const uint32_t early = over8 ? 0 : highs(&line, first, tick_ps, start);
    const uint32_t late = highs(&line, first, tick_ps, middle);
    if (early > 1 || late > 1) {
        return (struct usart_sampled){.heard = false}; /* no start bit: the receiver goes back to waiting */
    }
    out.noise = early + late > 0;
    for (uint32_t bit = 1; bit <= STOP; bit++) {
        const double begin = first + bit * bit_ps;
        const uint32_t sum = one_sample ? (level(&line, begin + middle[1] * tick_ps) ? SAMPLES : 0u)
                                        : highs(&line, begin, tick_ps, middle);
        out.noise = out.noise || (sum != 0 && sum != SAMPLES);
        if (bit <= DATA_BITS) {
            out.byte = (uint8_t)(out.byte | (sum > 1 ? 1u : 0u) << (bit - 1));
        } else {
            out.framing = sum <= 1;
        }
    }
    out.noise = out.noise && !one_sample;
    return out;
}
