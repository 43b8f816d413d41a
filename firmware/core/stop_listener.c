/* Hears a stop in the received bytes and CAN frames as they arrive, beside the main loop that answers
 * requests. */
#include "stop_listener.h"

#include "frame.h"
#include "proto.h"

enum { STOP_LENGTH = 7 }; /* id, sequence, CRC */

/* The cheap questions first: most frames are others. */
static bool is_stop(const uint8_t *plain, size_t length)
{
    struct frame frame;
    return length == STOP_LENGTH && plain[0] == (uint8_t)PROTO_ID_STOP && frame_open(plain, length, &frame);
}

/* Takes COBS off a frame shorter than its longest run; false where the runs do not fit the frame. */
static bool unstuff(const uint8_t *coded, uint8_t length, uint8_t *plain, uint8_t *plain_length)
{
    uint8_t at = 0;
    uint8_t filled = 0;
    while (at < length) {
        const uint8_t code = coded[at];
        if (code == 0 || code > length - at) {
            return false;
        }
        for (uint8_t i = 1; i < code; i++) {
            plain[filled] = coded[at + i];
            filled++;
        }
        at = (uint8_t)(at + code);
        if (at < length) {
            plain[filled] = 0;
            filled++;
        }
    }
    *plain_length = filled;
    return true;
}

static bool ends_stop(const struct stop_listener *listener)
{
    uint8_t plain[STOP_LISTENER_LONGEST];
    uint8_t length = 0;
    /* The id is no zero, and so stands behind the first code byte as it is. */
    return listener->length == STOP_LENGTH + 1 && listener->coded[1] == (uint8_t)PROTO_ID_STOP &&
           unstuff(listener->coded, listener->length, plain, &length) && is_stop(plain, length);
}

bool stop_listener_hear(struct stop_listener *listener, const uint8_t *bytes, size_t count)
{
    bool heard = false;
    uint8_t length = listener->length;
    for (size_t i = 0; i < count; i++) {
        if (bytes[i] == 0) {
            listener->length = length;
            heard = ends_stop(listener) || heard;
            length = 0;
        } else if (length < STOP_LISTENER_LONGEST) {
            listener->coded[length] = bytes[i];
            length++;
        } else {
            /* too long for a stop */
        }
    }
    listener->length = length;
    return heard;
}

bool stop_listener_is_stop(const struct hal_can_frame *frame)
{
    /* ISO-TP's single frame: its length in the first byte (ISO 15765-2, section 9.6.1). */
    const bool single = frame->length > 1u && frame->data[0] == frame->length - 1u;
    if (frame->id == PROTO_CAN_HOST_TO_BOARD) {
        return frame->length > 0u && frame->data[0] == (uint8_t)PROTO_ID_STOP;
    }
    return single && is_stop(frame->data + 1, frame->length - 1u);
}
