/* USART1 to USART3: baud from the divider, byte timing both ways, flags and interrupts, RM0090 section 30. */
#include "machine.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { FE = 1 << 1, NF = 1 << 2, ORE = 1 << 3, IDLE = 1 << 4, RXNE = 1 << 5, TC = 1 << 6, TXE = 1 << 7 };
enum { RE = 1 << 2, TE = 1 << 3, IDLEIE = 1 << 4, RXNEIE = 1 << 5, TCIE = 1 << 6, TXEIE = 1 << 7 };
enum { PCE = 1 << 10, M = 1 << 12, UE = 1 << 13 };
enum { EIE = 1 << 0, DMAR = 1 << 6, DMAT = 1 << 7, FIRST_CAPACITY = 256 };
/* Within these every sample of 8N1 lies in its bit, whatever the phase: the last, at 9 + 10/16 + 1/16 bits or
 * 9 + 6/8 + 1/8, before the end of the stop bit. */
#define BAUD_TOLERANCE       0.03
#define BAUD_TOLERANCE_OVER8 0.012

/* CPU cycles of one bit: 0 while the divider is not set. */
static uint64_t bit_cycles(const struct board *b, int usart)
{
    const struct usart *u = &b->usart[usart];
    uint64_t clocks = u->brr & 0xFFFFu;
    if ((u->cr1 & USART_OVER8) != 0) {
        clocks = (clocks >> 4) * 8 + (clocks & 7u);
    }
    return clocks * rcc_usart_divisor(b, usart);
}

static uint64_t frame_bits(const struct usart *u)
{
    uint32_t stop = (u->cr2 >> 12 & 3u) == 2 ? 2 : 1;
    return 1u + ((u->cr1 & M) != 0 ? 9u : 8u) + stop;
}

static double baud(const struct board *b, int usart)
{
    uint64_t bit = bit_cycles(b, usart);
    return bit == 0 ? 0 : (double)b->clock.hz / (double)bit;
}

static bool matches(const struct usart *u, double one, double other)
{
    const double tolerance = (u->cr1 & USART_OVER8) != 0 ? BAUD_TOLERANCE_OVER8 : BAUD_TOLERANCE;
    return one > 0 && other > 0 && fabs(one / other - 1) <= tolerance;
}

static void update_line(struct board *b, int usart)
{
    const struct usart *u = &b->usart[usart];
    uint32_t on = u->sr & u->cr1 & (RXNE | TC | TXE | IDLE);
    on |= (u->sr & ORE) != 0 && (u->cr1 & RXNEIE) != 0 ? ORE : 0;
    on |= (u->sr & (FE | NF | ORE)) != 0 && (u->cr3 & EIE) != 0 ? FE : 0;
    nvic_set_line(b, IRQ_USART1 + (unsigned)usart - 1, on != 0 && (u->cr1 & UE) != 0);
}

static void start_shifting(struct board *b, int usart)
{
    struct usart *u = &b->usart[usart];
    uint64_t bit = bit_cycles(b, usart);
    if (u->shifting || !u->tdr_full || (u->cr1 & (UE | TE)) != (UE | TE) || bit == 0) {
        return;
    }
    u->shift = u->tdr;
    u->tdr_full = false;
    u->shifting = true;
    u->sr |= TXE;
    event_at_cycle(b, EVENT_USART_TX0 + (unsigned)usart - 1, b->moment + bit * frame_bits(u));
}

/* DMA requests last as long as their flags: RXNE, and TXE while the transmitter is on (section 30.3.13). */
static void request_dma(struct board *b, int usart)
{
    const struct usart *u = &b->usart[usart];
    while ((u->cr3 & DMAR) != 0 && (u->sr & RXNE) != 0 && dma_serve_usart(b, usart, false)) {
    }
    while ((u->cr3 & DMAT) != 0 && (u->sr & TXE) != 0 && (u->cr1 & (UE | TE)) == (UE | TE) &&
           dma_serve_usart(b, usart, true)) {
    }
}

/* A stream has just been enabled: what waits for one is served. */
void usart_dma_ready(struct board *b)
{
    for (int i = 1; i <= USARTS; i++) {
        request_dma(b, i);
    }
}

void usart_tx_event(struct board *b, int usart)
{
    struct usart *u = &b->usart[usart];
    u->shifting = false;
    if (b->usart_routed[true][usart]) {
        trace_add(b, TRACE_TX, (uint32_t)usart, u->shift);
        if (b->options.wires.usart_sent != NULL) {
            b->options.wires.usart_sent(b->options.wires.context, usart, u->shift, baud(b, usart),
                                        time_to_ps(b, b->moment));
        }
    } else {
        warn_once(b, 0xF0000040u + (uint32_t)usart, "USART%d sends, but no pin carries its TX", usart);
    }
    start_shifting(b, usart);
    request_dma(b, usart);
    if (!u->shifting) {
        u->sr |= TC;
    }
    update_line(b, usart);
}

static void schedule_inbound(struct board *b, int usart)
{
    const struct usart *u = &b->usart[usart];
    unsigned id = EVENT_USART_RX0 + (unsigned)usart - 1;
    if (u->in_count == 0) {
        event_cancel(b, id);
    } else {
        /* The analyser does not see that in_count is 0 until an entry has been written. */
        event_at_ps(b, id, u->inbound[u->in_head].end_ps); /* NOLINT(clang-analyzer-core.CallAndMessage) */
    }
}

void usart_rx_event(struct board *b, int usart)
{
    struct usart *u = &b->usart[usart];
    struct inbound in = u->inbound[u->in_head];
    u->in_head = (u->in_head + 1) % u->in_capacity;
    u->in_count--;
    schedule_inbound(b, usart);
    uint64_t bit = bit_cycles(b, usart);
    bool heard = b->powered && (u->cr1 & (UE | RE)) == (UE | RE) && bit != 0;
    if (!heard) {
        return;
    }
    if (!b->usart_routed[false][usart]) {
        warn_once(b, 0xF0000050u + (uint32_t)usart, "a byte came in for USART%d, but no pin carries its RX",
                  usart);
        return;
    }
    struct usart_sampled sampled = {.byte = in.byte, .heard = true};
    if (b->usart_noisy || !matches(u, (double)in.baud, baud(b, usart))) {
        const struct inbound *next = u->in_count != 0 ? &u->inbound[u->in_head] : NULL;
        sampled = usart_sample(b, usart, &in, next, (double)PS_PER_S / baud(b, usart));
    }
    if (!sampled.heard) {
        return;
    }
    const uint8_t byte = sampled.byte;
    u->sr |= (sampled.noise ? NF : 0u) | (sampled.framing ? FE : 0u);
    if (!matches(u, (double)in.baud, baud(b, usart)) && (byte != in.byte || sampled.framing)) {
        warn_once(b, 0xF0000060u + (uint32_t)usart,
                  "USART%d hears %.0f baud while set to %.0f: bytes garbled", usart, (double)in.baud,
                  baud(b, usart));
    }
    trace_add(b, TRACE_RX, (uint32_t)usart, byte);
    if ((u->sr & RXNE) != 0) {
        u->sr |= ORE; /* the new byte is lost, the old one stays (RM0090 30.3.3) */
    } else {
        u->rdr = byte;
        u->sr |= RXNE;
        request_dma(b, usart);
    }
    event_at_cycle(b, EVENT_USART_IDLE0 + (unsigned)usart - 1, b->moment + bit * frame_bits(u));
    update_line(b, usart);
}

/* One frame of silence after a byte; a start bit in between makes it no idle line. */
void usart_idle_event(struct board *b, int usart)
{
    struct usart *u = &b->usart[usart];
    if (u->in_count != 0) {
        double frame_ps = 10.0 * (double)PS_PER_S / (double)u->inbound[u->in_head].baud;
        if ((double)u->inbound[u->in_head].end_ps - frame_ps <= (double)time_to_ps(b, b->moment)) {
            return;
        }
    }
    u->sr |= IDLE;
    update_line(b, usart);
}

void board_usart_receive(struct board *board, int usart, uint8_t byte, double line_baud, uint64_t start_ps)
{
    struct usart *u = &board->usart[usart];
    if (u->in_count == u->in_capacity) {
        size_t capacity = u->in_capacity == 0 ? FIRST_CAPACITY : 2 * u->in_capacity;
        struct inbound *grown = malloc(capacity * sizeof *grown);
        if (grown == NULL) {
            return;
        }
        for (size_t i = 0; i < u->in_count; i++) {
            grown[i] = u->inbound[(u->in_head + i) % u->in_capacity];
        }
        free(u->inbound);
        u->inbound = grown;
        u->in_capacity = capacity;
        u->in_head = 0;
    }
    uint64_t start = start_ps > u->line_free_ps ? start_ps : u->line_free_ps;
    uint64_t frame_ps = (uint64_t)(10.0 * (double)PS_PER_S / line_baud);
    struct inbound in = {.end_ps = start + frame_ps, .baud = (float)line_baud, .byte = byte};
    u->inbound[(u->in_head + u->in_count) % u->in_capacity] = in;
    u->line_free_ps = in.end_ps;
    u->in_count++;
    if (u->in_count == 1) {
        schedule_inbound(board, usart);
    }
}

void board_usart_disturbed(struct board *board, bool noisy)
{
    board->usart_noisy = noisy;
}

size_t board_usart_inbound(const struct board *board, int usart)
{
    return board->usart[usart].in_count;
}

void usart_drop_inbound(struct board *b, int usart)
{
    b->usart[usart].in_count = 0;
    schedule_inbound(b, usart);
}

/* Bytes on the line survive the chip's reset. */
void usart_reset(struct board *b, int usart)
{
    struct usart kept = b->usart[usart];
    b->usart[usart] = (struct usart){.sr = TXE | TC,
                                     .inbound = kept.inbound,
                                     .in_capacity = kept.in_capacity,
                                     .in_head = kept.in_head,
                                     .in_count = kept.in_count,
                                     .line_free_ps = kept.line_free_ps};
    event_cancel(b, EVENT_USART_TX0 + (unsigned)usart - 1);
    event_cancel(b, EVENT_USART_IDLE0 + (unsigned)usart - 1);
    update_line(b, usart);
}

static uint32_t read_data(struct usart *u)
{
    if (u->sr_read) {
        u->sr &= ~(uint32_t)(FE | NF | ORE | IDLE);
    }
    u->sr_read = false;
    u->sr &= ~(uint32_t)RXNE;
    return u->rdr;
}

static void write_data(struct board *b, int usart, uint32_t value)
{
    struct usart *u = &b->usart[usart];
    if (u->tdr_full) {
        warn_once(b, 0xF0000070u + (uint32_t)usart,
                  "USART%d data written while TXE is 0: a byte is overwritten", usart);
    }
    u->tdr = (uint8_t)value;
    u->tdr_full = true;
    u->sr &= ~(uint32_t)(TXE | TC);
    start_shifting(b, usart);
}

static void check_modes(struct board *b, int usart)
{
    const struct usart *u = &b->usart[usart];
    if ((u->cr1 & (PCE | M)) != 0 || (u->cr2 & 1u << 14) != 0 || (u->cr3 & 0x33Eu) != 0) {
        warn_once(b, 0xF0000080u + (uint32_t)usart, "USART%d: only 8N1 without flow control is modelled",
                  usart);
    }
}

bool usart_access(struct board *b, int usart, uint32_t offset, bool write, uint32_t *value)
{
    struct usart *u = &b->usart[usart];
    uint32_t *const store[] = {&u->sr, NULL, &u->brr, &u->cr1, &u->cr2, &u->cr3, &u->gtpr};
    if (offset > 0x18 || (offset & 3u) != 0) {
        return false;
    }
    if (!write) {
        *value = offset == 0x04 ? read_data(u) : *store[offset / 4];
        u->sr_read = offset == 0x00 || (u->sr_read && offset != 0x04);
        update_line(b, usart);
        return true;
    }
    if (offset == 0x00) {
        u->sr &= *value | ~(uint32_t)(RXNE | TC); /* only these are cleared by writing 0 */
    } else if (offset == 0x04) {
        write_data(b, usart, *value);
    } else {
        *store[offset / 4] = *value & 0xFFFFu;
        check_modes(b, usart);
        start_shifting(b, usart);
        request_dma(b, usart);
    }
    update_line(b, usart);
    return true;
}
