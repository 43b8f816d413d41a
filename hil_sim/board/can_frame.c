/* The length of a CAN frame on the wire: its bits after ISO 11898-1, stuff bits included. */
#include "board.h"

enum {
    CRC_POLYNOMIAL = 0x4599,
    CRC_BITS = 15,
    TAIL_BITS = 10 /* CRC delimiter, acknowledgment, end of frame */
};

struct wire {
    uint32_t crc, bits, run;
    bool last;
};

static void stuffed_bit(struct wire *w, bool bit)
{
    w->bits++;
    w->run = bit == w->last && w->bits > 1 ? w->run + 1 : 1;
    w->last = bit;
    if (w->run == 5) { /* the stuff bit opens a run of its own */
        w->bits++;
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

uint32_t board_can_bits(const struct board_can_frame *frame)
{
    struct wire w = {.crc = 0};
    put(&w, 0, 1);
    if (frame->extended) {
        put(&w, frame->id >> 18, 11);
        put(&w, 3, 2); /* SRR, IDE */
        put(&w, frame->id & 0x3FFFFu, 18);
        put(&w, (uint32_t)frame->remote << 2, 3);
    } else {
        put(&w, frame->id, 11);
        put(&w, (uint32_t)frame->remote << 2, 3);
    }
    put(&w, frame->length, 4);
    for (unsigned i = 0; i < frame->length && !frame->remote; i++) {
        put(&w, frame->data[i], 8);
    }
    uint32_t crc = w.crc;
    for (int i = CRC_BITS - 1; i >= 0; i--) {
        stuffed_bit(&w, (crc >> i & 1u) != 0);
    }
    return w.bits + TAIL_BITS;
}
