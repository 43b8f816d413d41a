/* Hears a stop in the received bytes and CAN frames as they arrive, beside the main loop that answers
 * requests.
 *
 * The tick asks it, so that a stop brakes within a tick of its arrival, whatever the main loop is busy with.
 */
#ifndef STOP_LISTENER_H
#define STOP_LISTENER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "hal.h"

/* A stop has no payload: with the zeros around it, it takes ten bytes, one more than have to be kept. */
enum { STOP_LISTENER_KEPT = 9 };

/* All zero is the state at the start of a stream. */
struct stop_listener {
    uint8_t last[STOP_LISTENER_KEPT]; /* bytes of the line */
};

/* Takes bytes of the serial line; true when one of them ended a valid stop. */
bool stop_listener_hear(struct stop_listener *listener, const uint8_t *bytes, size_t count);

/* Whether a CAN frame to this node, or to all, is a stop. */
bool stop_listener_is_stop(const struct hal_can_frame *frame);

#endif
