/* The bit timing of CAN1 as its register has it. */
#ifndef BXCAN_TIMING_H
#define BXCAN_TIMING_H

#include "can_timing.h"

/* RM0090 section 32.7.7: TS1 up to 16 quanta, TS2 up to 8. */
static const struct can_limits bxcan_limits = {.prescaler = 1024, .segment_1 = 16, .jump = 4};

/* The value of CAN_BTR. */
static inline uint32_t bxcan_btr(const struct can_timing *timing)
{
    return (timing->jump - 1u) << 24 | (timing->segment_2 - 1u) << 20 | (timing->segment_1 - 1u) << 16 |
           (timing->prescaler - 1u);
}

#endif
