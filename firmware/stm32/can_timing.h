/* The bit timing of a CAN controller from the clock that it has. */
#ifndef CAN_TIMING_H
#define CAN_TIMING_H

#include <stdbool.h>
#include <stdint.h>

/* What a controller can do. */
struct can_limits {
    uint32_t prescaler;
    uint32_t segment_1; /* quanta from the synchronisation to the sample point */
    uint32_t jump;      /* quanta of a resynchronisation */
};

/* A bit is one quantum, segment 1, the sample point, segment 2. */
struct can_timing {
    uint32_t prescaler;
    uint32_t segment_1;
    uint32_t segment_2;
    uint32_t jump;
};

/* The timing for a bit rate; false when no divider comes within 1.25 % of it. */
bool can_timing(uint32_t clock_hz, uint32_t bits_per_s, const struct can_limits *limits,
                struct can_timing *out);

#endif
