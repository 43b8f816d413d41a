/* DMA1 and DMA2: eight streams each, in direct mode, with the requests of the serial ports; RM0090
 * section 10.
 *
 * A transfer happens at the moment of its request; on the chip it takes a few cycles of the bus more. */
#include "machine.h"

#include <string.h>

/* Event flags of one stream, within its six bits of LISR or HISR (sections 10.5.1 and 10.5.2). */
enum { FEIF = 1 << 0, DMEIF = 1 << 2, TEIF = 1 << 3, HTIF = 1 << 4, TCIF = 1 << 5 };
/* DMA_SxCR, section 10.5.5. */
enum {
    EN = 1 << 0,
    DMEIE = 1 << 1,
    TEIE = 1 << 2,
    HTIE = 1 << 3,
    TCIE = 1 << 4,
    PFCTRL = 1 << 5,
    DIR = 3 << 6,
    DIR_TO_PERIPHERAL = 1 << 6,
    CIRC = 1 << 8,
    PINC = 1 << 9,
    MINC = 1 << 10,
    PINCOS = 1 << 15,
    DBM = 1 << 18,
    BURSTS = 15 << 21
};
enum { PSIZE = 11, MSIZE = 13, CHSEL = 25 }; /* first bits of these fields */
/* Writable at any time; the other bits of CR only while EN is 0. */
enum { CR_ALWAYS = EN | DMEIE | TEIE | HTIE | TCIE };
enum { DMDIS = 1 << 2, FEIE = 1 << 7, FCR_RESET = 0x21, CR_BITS = 0x0FEFFFFF };
enum { APB1_BASE = 0x40000000, APB1_SIZE = 0x8000, APB_SIZE = 0x16000 };
enum { LISR, HISR, LIFCR, HIFCR, FIRST_STREAM_AT = 0x10, STREAM_SIZE = 0x18 };

/* Where the flags of streams 0 to 3, and of 4 to 7, lie in their register. */
static const uint8_t flags_at[4] = {0, 6, 16, 22};

/* Requests that are modelled, RM0090 tables 42 and 43: those of serial ports, by DMA, stream and channel. */
static const struct source {
    uint8_t dma, stream, channel, usart;
    bool transmit;
} sources[] = {{1, 5, 4, 2, false}, {1, 6, 4, 2, true},  {1, 1, 4, 3, false}, {1, 3, 4, 3, true},
               {1, 4, 7, 3, true},  {2, 2, 4, 1, false}, {2, 5, 4, 1, false}, {2, 7, 4, 1, true}};
enum { SOURCES = sizeof sources / sizeof sources[0] };

static uint32_t flag_shift(unsigned stream)
{
    return flags_at[stream % 4];
}

/* Interrupts of the streams, RM0090 table 62. */
static void update_line(struct board *b, unsigned dma, unsigned stream)
{
    static const uint8_t irq[DMAS][DMA_STREAMS] = {{11, 12, 13, 14, 15, 16, 17, 47},
                                                   {56, 57, 58, 59, 60, 68, 69, 70}};
    const struct dma_stream *s = &b->dma[dma - 1][stream];
    uint32_t on = (s->flags & TCIF) != 0 ? s->cr & TCIE : 0;
    on |= (s->flags & HTIF) != 0 ? s->cr & HTIE : 0;
    on |= (s->flags & TEIF) != 0 ? s->cr & TEIE : 0;
    on |= (s->flags & DMEIF) != 0 ? s->cr & DMEIE : 0;
    on |= (s->flags & FEIF) != 0 ? s->fcr & FEIE : 0;
    nvic_set_line(b, irq[dma - 1][stream], on != 0);
}

static bool listens(const struct dma_stream *s, const struct source *source)
{
    return (s->cr & EN) != 0 && s->cr >> CHSEL == source->channel &&
           ((s->cr & DIR) == DIR_TO_PERIPHERAL) == source->transmit;
}

/* DMA1 reaches the peripherals of APB1 alone, DMA2 those of both (RM0090 figure 33). */
static bool reaches(unsigned dma, uint32_t peripheral)
{
    return peripheral - APB1_BASE < (dma == 1 ? APB1_SIZE : APB_SIZE);
}

/* One item from the peripheral to memory or back. False: the bus refused, as for CCM, which is not on it
 * (RM0090 section 2.3.1). */
static bool move(struct board *b, unsigned dma, const struct dma_stream *s)
{
    const unsigned size = 1u << (s->cr >> PSIZE & 3u); /* direct mode: MSIZE has no effect (10.3.10) */
    const uint32_t step = (s->cr & PINCOS) != 0 ? 4 : size;
    const uint32_t peripheral = s->par + ((s->cr & PINC) != 0 ? s->done * step : 0);
    const uint32_t address = s->m0ar + ((s->cr & MINC) != 0 ? s->done * size : 0);
    const bool transmit = (s->cr & DIR) == DIR_TO_PERIPHERAL;
    uint8_t *memory = cpu_memory(b, address, size, !transmit);
    uint32_t value = 0;
    if (memory == NULL || address - CCM_BASE < CCM_SIZE || !reaches(dma, peripheral)) {
        return false;
    }
    if (transmit) {
        memcpy(&value, memory, size);
        bus_master_access(b, peripheral, true, &value, size);
    } else {
        bus_master_access(b, peripheral, false, &value, size);
        memcpy(memory, &value, size);
    }
    return true;
}

static void finish_item(struct dma_stream *s)
{
    s->done++;
    s->ndtr--;
    if (s->done == s->items - s->items / 2) {
        s->flags |= HTIF;
    }
    if (s->ndtr == 0) {
        s->flags |= TCIF;
        if ((s->cr & CIRC) != 0) {
            s->ndtr = s->items;
            s->done = 0;
        } else {
            s->cr &= ~(uint32_t)EN;
        }
    }
}

/* A serial port has a byte, or room for one; true when a stream served it. */
bool dma_serve_usart(struct board *b, int usart, bool transmit)
{
    for (size_t i = 0; i < SOURCES; i++) {
        const struct source *source = &sources[i];
        if (source->usart != usart || source->transmit != transmit) {
            continue;
        }
        struct dma_stream *s = &b->dma[source->dma - 1][source->stream];
        if (!listens(s, source)) {
            continue;
        }
        const uint32_t before = s->flags;
        const bool moved = move(b, source->dma, s);
        if (moved) {
            finish_item(s);
        } else {
            s->flags |= TEIF;
            s->cr &= ~(uint32_t)EN;
        }
        if (s->flags != before) {
            update_line(b, source->dma, source->stream);
        }
        return moved;
    }
    return false;
}

static bool is_known(unsigned dma, unsigned stream, const struct dma_stream *s)
{
    for (size_t i = 0; i < SOURCES; i++) {
        if (sources[i].dma == dma && sources[i].stream == stream && listens(s, &sources[i])) {
            return true;
        }
    }
    return false;
}

/* Section 10.3.17: a stream starts only with its event flags cleared. */
static void enable(struct board *b, unsigned dma, unsigned stream)
{
    struct dma_stream *s = &b->dma[dma - 1][stream];
    const uint32_t key = 0xF0000200u + 16u * dma + stream;
    if (s->flags != 0) {
        warn_once(b, key, "DMA%u stream %u enabled with event flags set: it does not start", dma, stream);
        s->cr &= ~(uint32_t)EN;
        return;
    }
    if (s->ndtr == 0) {
        warn_once(b, key, "DMA%u stream %u enabled with nothing to transfer", dma, stream);
        s->cr &= ~(uint32_t)EN;
        return;
    }
    if ((s->cr & (PFCTRL | DBM | BURSTS)) != 0 || (s->fcr & DMDIS) != 0) {
        warn_once(b, key, "DMA%u stream %u: only direct mode with one buffer is modelled", dma, stream);
    } else if (!is_known(dma, stream, s)) {
        warn_once(b, key, "DMA%u stream %u: no request is modelled for its channel and direction", dma,
                  stream);
    }
    s->items = s->ndtr;
    s->done = 0;
    usart_dma_ready(b);
}

static void write_cr(struct board *b, unsigned dma, unsigned stream, uint32_t value)
{
    struct dma_stream *s = &b->dma[dma - 1][stream];
    const bool was_on = (s->cr & EN) != 0;
    const uint32_t writable = was_on ? CR_ALWAYS : CR_BITS;
    if (((s->cr ^ value) & CR_BITS & ~writable) != 0 && (value & EN) != 0) {
        warn_once(b, 0xF0000300u + 16u * dma + stream, "DMA%u stream %u configured while enabled", dma,
                  stream);
    }
    s->cr = (s->cr & ~writable) | (value & writable);
    if (was_on && (s->cr & EN) == 0) {
        s->flags |= TCIF; /* the transfers under way have ended, section 10.3.14 */
    } else if (!was_on && (s->cr & EN) != 0) {
        enable(b, dma, stream);
    }
    update_line(b, dma, stream);
}

static bool stream_access(struct board *b, unsigned dma, unsigned stream, uint32_t offset, bool write,
                          uint32_t *value)
{
    struct dma_stream *s = &b->dma[dma - 1][stream];
    uint32_t *const store[] = {&s->cr, &s->ndtr, &s->par, &s->m0ar, &s->m1ar, &s->fcr};
    if (!write) {
        *value = *store[offset / 4];
        return true;
    }
    if (offset == 0) {
        write_cr(b, dma, stream, *value);
    } else if ((s->cr & EN) != 0) {
        warn_once(b, 0xF0000300u + 16u * dma + stream, "DMA%u stream %u configured while enabled", dma,
                  stream);
    } else if (offset == 0x14) {
        s->fcr = (*value & 0x87u) | (s->fcr & 0x38u); /* the FIFO's level is read-only */
        update_line(b, dma, stream);
    } else {
        *store[offset / 4] = offset == 0x04 ? *value & 0xFFFFu : *value;
    }
    return true;
}

static uint32_t read_flags(const struct board *b, unsigned dma, unsigned first)
{
    uint32_t word = 0;
    for (unsigned i = first; i < first + 4; i++) {
        word |= b->dma[dma - 1][i].flags << flag_shift(i);
    }
    return word;
}

static void clear_flags(struct board *b, unsigned dma, unsigned first, uint32_t bits)
{
    for (unsigned i = first; i < first + 4; i++) {
        b->dma[dma - 1][i].flags &= ~(bits >> flag_shift(i));
        update_line(b, dma, i);
    }
}

bool dma_access(struct board *b, int dma, uint32_t offset, bool write, uint32_t *value)
{
    const unsigned unit = (unsigned)dma;
    if (offset >= FIRST_STREAM_AT) {
        const uint32_t stream = (offset - FIRST_STREAM_AT) / STREAM_SIZE;
        return stream < DMA_STREAMS &&
               stream_access(b, unit, stream, (offset - FIRST_STREAM_AT) % STREAM_SIZE, write, value);
    }
    const uint32_t which = offset / 4;
    if (which >= LIFCR && write) {
        clear_flags(b, unit, which == LIFCR ? 0 : 4, *value);
    } else if (!write) {
        *value = which < LIFCR ? read_flags(b, unit, which == LISR ? 0 : 4) : 0;
    }
    return true;
}

void dma_reset(struct board *b, int dma)
{
    for (unsigned i = 0; i < DMA_STREAMS; i++) {
        b->dma[dma - 1][i] = (struct dma_stream){.fcr = FCR_RESET};
        update_line(b, (unsigned)dma, i);
    }
}
