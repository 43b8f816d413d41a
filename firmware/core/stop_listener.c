/* Hears a stop in the received bytes and CAN frames as they arrive, beside the main loop that answers
 * requests. */
#include "stop_listener.h"

#include <string.h>

#include "frame.h"
#include "proto.h"

/* On the line: a zero, the code byte, id, sequence and CRC, a zero. */
enum { STOP_LENGTH = 7, CODED_LENGTH = 8, AFTER_ID = 7, ID = PROTO_ID_STOP };

/* The cheap questions first: most frames are others. */
static bool is_stop(const uint8_t *plain, size_t length)
{
    struct frame frame;
    return length == STOP_LENGTH && plain[0] == (uint8_t)PROTO_ID_STOP && frame_open(plain, length, &frame);
}

/* Takes COBS off the bytes between two zeros; false where a zero lies among them or the runs do not fit. */
static bool unstuff(const uint8_t *coded, uint8_t *plain)
{
    uint8_t at = 0;
    uint8_t filled = 0;
    while (at < CODED_LENGTH) {
        const uint8_t code = coded[at];
        if (code == 0 || code > CODED_LENGTH - at) {
            return false;
        }
        for (uint8_t i = 1; i < code; i++) {
            if (coded[at + i] == 0) {
                return false;
            }
            plain[filled] = coded[at + i];
            filled++;
        }
        at = (uint8_t)(at + code);
        if (at < CODED_LENGTH) {
            plain[filled] = 0;
            filled++;
        }
    }
    return filled == STOP_LENGTH;
}

/* Whether a stop and the zeros around it lie here, its id at `at`. The id is no zero, so it stands behind the
 * first code byte as it is. */
static bool is_stop_at(const uint8_t *bytes, size_t at)
{
    uint8_t plain[CODED_LENGTH];
    return bytes[at] == ID && bytes[at - 2u] == 0 && bytes[at + AFTER_ID] == 0 &&
           unstuff(bytes + at - 1, plain) && is_stop(plain, STOP_LENGTH);
}

/* Looks for the id, four bytes at a time, since most bytes are none. */
static bool has_stop(const uint8_t *bytes, size_t count)
{
    size_t at = 2;
    while (at + AFTER_ID < count) {
        uint32_t word;
        memcpy(&word, bytes + at, sizeof word);
        const uint32_t others = word ^ (0x01010101u * ID); /* a byte is zero where it is the id */
        const size_t end = at + sizeof word;
        if (((others - 0x01010101u) & ~others & 0x80808080u) != 0) { /* a zero borrows */
            for (; at < end && at + AFTER_ID < count; at++) {
                if (is_stop_at(bytes, at)) {
                    return true;
                }
            }
        }
        at = end;
    }
    return false;
}

bool stop_listener_hear(struct stop_listener *listener, const uint8_t *bytes, size_t count)
{
    uint8_t seam[2 * STOP_LISTENER_KEPT];
    const size_t first = count < STOP_LISTENER_KEPT ? count : STOP_LISTENER_KEPT;
    memcpy(seam, listener->last, STOP_LISTENER_KEPT);
    memcpy(seam + STOP_LISTENER_KEPT, bytes, first);
    const bool heard = has_stop(seam, STOP_LISTENER_KEPT + first) || has_stop(bytes, count);
    if (count < STOP_LISTENER_KEPT) {
        memcpy(listener->last, seam + first, STOP_LISTENER_KEPT);
    } else {
        memcpy(listener->last, bytes + count - STOP_LISTENER_KEPT, STOP_LISTENER_KEPT);
    }
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
