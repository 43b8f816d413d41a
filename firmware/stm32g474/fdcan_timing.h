/* The bit timing of FDCAN1 as its register has it. */
#ifndef FDCAN_TIMING_H
#define FDCAN_TIMING_H

#include "can_timing.h"

/* RM0440, FDCAN_NBTP. A jump of all of segment 2 would be allowed; more than 16 quanta never come about. */
static const struct can_limits fdcan_limits = {.prescaler = 512, .segment_1 = 256, .jump = 16};

/* The value of FDCAN_NBTP. */
static inline uint32_t fdcan_nbtp(const struct can_timing *timing)
{
    return (timing->jump - 1u) << 25 | (timing->prescaler - 1u) << 16 | (timing->segment_1 - 1u) << 8 |
           (timing->segment_2 - 1u);
}

#endif
