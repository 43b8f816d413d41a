/* The bit timing of a CAN controller from the clock that it has. */
#include "can_timing.h"

/* Fewer than 8 quanta resolve a bit too coarsely; more than 25 is what no controller of ISO 11898-1 needs to
 * do. */
enum { QUANTA_MIN = 8, QUANTA_MAX = 25 };

/* The sample point lies at four fifths of the bit: late enough for the longest line, and with a second
 * segment that bears the resynchronisation jump of four quanta which RC oscillators need. */
static uint32_t second_segment(uint32_t quanta, uint32_t segment_1_max)
{
    const uint32_t wanted = (quanta + 2u) / 5u;
    return quanta - 1u - wanted > segment_1_max ? quanta - 1u - segment_1_max : wanted;
}

bool can_timing(uint32_t clock_hz, uint32_t bits_per_s, const struct can_limits *limits,
                struct can_timing *out)
{
    uint32_t min_error = UINT32_MAX;
    if (bits_per_s == 0) {
        return false;
    }
    /* From many quanta to few: the finest wins among equals. */
    for (uint32_t quanta = QUANTA_MAX; quanta >= QUANTA_MIN; quanta--) {
        const uint32_t prescaler = (clock_hz + bits_per_s * quanta / 2u) / (bits_per_s * quanta);
        if (prescaler == 0 || prescaler > limits->prescaler) {
            continue;
        }
        const uint32_t made = clock_hz / (prescaler * quanta);
        const uint32_t error = made > bits_per_s ? made - bits_per_s : bits_per_s - made;
        if (error < min_error) {
            const uint32_t segment_2 = second_segment(quanta, limits->segment_1);
            min_error = error;
            *out = (struct can_timing){.prescaler = prescaler,
                                       .segment_1 = quanta - 1u - segment_2,
                                       .segment_2 = segment_2,
                                       .jump = segment_2 < limits->jump ? segment_2 : limits->jump};
        }
    }
    return min_error <= bits_per_s / 80u;
}
