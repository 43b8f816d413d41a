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

/* Follows the line's frames as frame.h does, but keeps no bytes: of a frame that begins with a stop's id its
 * CRC as far as it goes, of every other nothing. All zero is the state at the start of a stream. */
struct stop_listener {
    uint8_t place;   /* enum place, within the frame that arrives */
    uint8_t left;    /* data bytes that follow before the next code byte */
    bool zero_owed;  /* the run that ends now stands for a zero, unless the frame ends here */
    uint16_t length; /* bytes of the frame so far, unstuffed */
    uint32_t crc;    /* over those bytes */
};

/* Takes bytes of the serial line; true when one of them ended a valid stop. */
bool stop_listener_hear(struct stop_listener *listener, const uint8_t *bytes, size_t count);

/* Whether a CAN frame to this node, or to all, is a stop, or the first of the frames of one. */
bool stop_listener_is_stop(const struct hal_can_frame *frame);

#endif
