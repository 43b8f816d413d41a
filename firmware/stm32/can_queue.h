/* Frames between the CAN controller's interrupts and the main loop. */
#ifndef CAN_QUEUE_H
#define CAN_QUEUE_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"

/* For the chip's controller: its interrupts, or with them held off. */

/* Numbers from start-up; the controller's own state is not in it. */
extern struct hal_can_report can_counts;

/* A frame has been received: its id, its length code, its bytes as two words, the first byte the lowest. */
void can_queue_received(uint32_t id, uint32_t length, uint32_t low, uint32_t high);

/* The next frame to be sent, taken out; NULL where none waits. */
const struct hal_can_frame *can_queue_next(void);

/* Bytes 0 to 3 or 4 to 7 of a frame, as such a word. */
static inline uint32_t can_frame_word(const struct hal_can_frame *frame, uint32_t first)
{
    const uint8_t *const d = &frame->data[first];
    return d[0] | (uint32_t)d[1] << 8 | (uint32_t)d[2] << 16 | (uint32_t)d[3] << 24;
}

/* A frame has left, and can_feed has been called. */
void can_queue_sent(void);

/* Discards all that wait to be sent. */
void can_queue_discard(void);

/* A copy of can_counts for the main loop. */
void can_queue_counts(struct hal_can_report *out);

/* How a controller on the bus feels, as enum hal_can_state. */
uint8_t can_state_on_bus(bool joining, bool passive, bool warning);

#endif
