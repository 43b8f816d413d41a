/* The trace hash: one running 128-bit digest over everything that happens at the pins, with its time. */
#include "machine.h"

/* Multiply, rotate and add in two lanes; distinguishes runs, not cryptographic. */
static void absorb(uint64_t lane[2], uint64_t word)
{
    lane[0] = (lane[0] ^ word) * 0x9E3779B97F4A7C15ULL;
    lane[0] = (lane[0] << 29) | (lane[0] >> 35);
    lane[1] = (lane[1] + word + lane[0]) * 0xD6E8FEB86659FD93ULL;
    lane[1] ^= lane[1] >> 32;
}

void trace_add(struct board *b, enum trace_kind kind, uint32_t source, uint64_t value)
{
    absorb(b->trace, b->moment);
    absorb(b->trace, ((uint64_t)kind << 32) | source);
    absorb(b->trace, value);
    b->trace_count++;
}

void board_trace_hash(const struct board *board, uint64_t out[2])
{
    out[0] = board->trace[0];
    out[1] = board->trace[1];
    absorb(out, board->trace_count);
}

uint64_t board_trace_count(const struct board *board)
{
    return board->trace_count;
}
