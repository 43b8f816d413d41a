/* A CAN frame on the wire: its bits after ISO 11898-1, stuff bits included. */
#include "board.h"

enum {
    CRC_POLYNOMIAL = 0x4599,
    CRC_BITS = 15,
    TAIL_BITS = 10 /* CRC delimiter, acknowledgment, end of frame */
};

struct wire {
    uint32_t crc, bits, run;
    bool last;
    uint8_t *out; /* NULL: only their number is wanted */
};

static void level(struct wire *w, bool bit)
{
    if (w->out != NULL && w->bits < BOARD_CAN_BITS_MAX) {
        w->out[w->bits] = bit;
    }
    w->bits++;
}

static void stuffed_bit(struct wire *w, bool bit)
{
    level(w, bit);
    w->run = bit == w->last && w->bits > 1 ? w->run + 1 : 1;
    w->last = bit;
    if (w->run == 5) { /* the stuff bit opens a run of its own */
        level(w, !bit);
        w->last = !bit;
        w->run = 1;
    }
}

static void put(struct wire *w, uint32_t value, uint32_t count)
{
    while (count-- > 0) {
        bool bit = (value >> count & 1u) != 0;
        bool feedback = bit != ((w->crc >> (CRC_BITS - 1) & 1u) != 0);
        w->crc = (w->crc << 1 & 0x7FFFu) ^ (feedback ? CRC_POLYNOMIAL : 0);
        stuffed_bit(w, bit);
    }
}

static void stuff(const struct board_can_frame *frame, struct wire *w)
{
    put(w, 0, 1);
    if (frame->extended) {
        put(w, frame->id >> 18, 11);
        put(w, 3, 2); /* SRR, IDE */
        put(w, frame->id & 0x3FFFFu, 18);
        put(w, (uint32_t)frame->remote << 2, 3);
    } else {
        put(w, frame->id, 11);
        put(w, (uint32_t)frame->remote << 2, 3);
    }
    put(w, frame->length, 4);
    for (unsigned i = 0; i < frame->length && !frame->remote; i++) {
        put(w, frame->data[i], 8);
    }
    uint32_t crc = w->crc;
    for (int i = CRC_BITS - 1; i >= 0; i--) {
        stuffed_bit(w, (crc >> i & 1u) != 0);
    }
}

uint32_t board_can_bits(const struct board_can_frame *frame)
{
    struct wire w = {.out = NULL};
    stuff(frame, &w);
    return w.bits + TAIL_BITS;
}

/* NOLINTNEXTLINE(readability-non-const-parameter): written to through the struct */
uint32_t board_can_wire(const struct board_can_frame *frame, uint8_t out[BOARD_CAN_BITS_MAX])
{
    struct wire w = {.out = out};
    stuff(frame, &w);
    level(&w, true); /* CRC delimiter */
    return w.bits;
}
