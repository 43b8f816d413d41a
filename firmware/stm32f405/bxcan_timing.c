/* The bit timing of CAN1 from the clock that it has. */
#include "bxcan_timing.h"

/* RM0090 section 32.7.7: a bit is 1 + TS1 + TS2 quanta, TS1 up to 16, TS2 up to 8; fewer than 8 quanta
 * resolve a bit too coarsely. */
enum { QUANTA_MIN = 8, QUANTA_MAX = 25, TS1_MAX = 16, SJW_MAX = 4, PRESCALER_MAX = 1024 };

/* The sample point lies at four fifths of the bit: late enough for the longest line, and with a second
 * segment that bears the resynchronisation jump of four quanta which RC oscillators need. */
static uint32_t second_segment(uint32_t quanta)
{
    const uint32_t wanted = (quanta + 2u) / 5u;
    return quanta - 1u - wanted > TS1_MAX ? quanta - 1u - TS1_MAX : wanted;
}

bool bxcan_timing(uint32_t clock_hz, uint32_t bits_per_s, uint32_t *btr)
{
    uint32_t min_error = UINT32_MAX;
    if (bits_per_s == 0) {
        return false;
    }
    /* From many quanta to few: the finest wins among equals. */
    for (uint32_t quanta = QUANTA_MAX; quanta >= QUANTA_MIN; quanta--) {
        const uint32_t prescaler = (clock_hz + bits_per_s * quanta / 2u) / (bits_per_s * quanta);
        if (prescaler == 0 || prescaler > PRESCALER_MAX) {
            continue;
        }
        const uint32_t made = clock_hz / (prescaler * quanta);
        const uint32_t error = made > bits_per_s ? made - bits_per_s : bits_per_s - made;
        if (error < min_error) {
            const uint32_t ts2 = second_segment(quanta);
            const uint32_t sjw = ts2 < SJW_MAX ? ts2 : SJW_MAX;
            min_error = error;
            *btr = (sjw - 1u) << 24 | (ts2 - 1u) << 20 | (quanta - 2u - ts2) << 16 | (prescaler - 1u);
        }
    }
    return min_error <= bits_per_s / 80u;
}
