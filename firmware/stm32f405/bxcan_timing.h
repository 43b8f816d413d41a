/* The bit timing of CAN1 from the clock that it has. */
#ifndef BXCAN_TIMING_H
#define BXCAN_TIMING_H

#include <stdbool.h>
#include <stdint.h>

/* The value of CAN_BTR for a bit rate; false when no divider comes within 1.25 % of it. */
bool bxcan_timing(uint32_t clock_hz, uint32_t bits_per_s, uint32_t *btr);

#endif
