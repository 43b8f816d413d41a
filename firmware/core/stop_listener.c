/* Hears a stop in the received bytes and CAN frames as they arrive, beside the main loop that answers
 * requests. */
#include "stop_listener.h"

#include <string.h>

#include "crc32.h"
#include "frame.h"
#include "proto.h"

/* What the next byte is. Most frames are others: their bytes are passed over up to the zero. */
enum place { CODE, ID, INSIDE, OTHER };

/* CRC-32 of any bytes with their own CRC behind them, least significant byte first. */
#define CRC_OF_WHOLE 0x2144DF1Cu

/* The first zero in bytes[at..count), four at a time; `count` when there is none. */
static size_t next_zero(const uint8_t *bytes, size_t at, size_t count)
{
    while (at + sizeof(uint32_t) <= count) {
        uint32_t word;
        memcpy(&word, bytes + at, sizeof word);
        if (((word - 0x01010101u) & ~word & 0x80808080u) != 0) { /* a zero borrows */
            break;
        }
        at += sizeof word;
    }
    while (at < count && bytes[at] != 0) {
        at++;
    }
    return at;
}

static void take_plain(struct stop_listener *listener, uint8_t byte)
{
    listener->crc = crc32_update(listener->crc, &byte, 1);
    if (++listener->length > FRAME_MAX_PLAIN) {
        listener->place = OTHER;
    }
}

static void begin_run(struct stop_listener *listener, uint8_t code)
{
    enum { LONGEST_RUN = 0xFF }; /* stands for no zero */
    listener->left = (uint8_t)(code - 1u);
    listener->zero_owed = code != LONGEST_RUN;
}

/* At a zero: whether a whole and valid stop ends here. */
static bool ends_stop(const struct stop_listener *listener)
{
    return listener->place == (uint8_t)INSIDE && listener->left == 0 &&
           listener->length >= FRAME_HEADER_SIZE + FRAME_CRC_SIZE && listener->crc == CRC_OF_WHOLE;
}

/* A byte that is no zero. */
static void take(struct stop_listener *listener, uint8_t byte)
{
    switch (listener->place) {
    case CODE:
        begin_run(listener, byte);
        listener->place = listener->left > 0 ? ID : OTHER; /* no id is zero */
        break;
    case ID:
        listener->crc = 0;
        listener->length = 0;
        listener->place = byte == (uint8_t)PROTO_ID_STOP ? INSIDE : OTHER;
        listener->left--;
        take_plain(listener, byte);
        break;
    default:
        if (listener->left > 0) {
            listener->left--;
            take_plain(listener, byte);
        } else {
            if (listener->zero_owed) {
                take_plain(listener, 0);
            }
            begin_run(listener, byte);
        }
        break;
    }
}

bool stop_listener_hear(struct stop_listener *listener, const uint8_t *bytes, size_t count)
{
    bool heard = false;
    size_t at = 0;
    while (at < count) {
        if (listener->place == (uint8_t)OTHER) {
            at = next_zero(bytes, at, count);
            if (at == count) {
                break;
            }
        }
        if (bytes[at] == 0) {
            heard = ends_stop(listener) || heard;
            listener->place = CODE;
        } else {
            take(listener, bytes[at]);
        }
        at++;
    }
    return heard;
}

/* ISO-TP's single frame: its length in the first byte; its first frame of several: a 1 and twelve bits of
 * length (ISO 15765-2, section 9.6). The others of a longer stop come only when the main loop has allowed
 * them by its flow control, so that the first one stops already. A CAN frame has a CRC of its own. */
bool stop_listener_is_stop(const struct hal_can_frame *frame)
{
    enum { FIRST = 0x10, FIRST_ID = 2, CAN_DATA = 8, SINGLE_MAX = 7 };
    const uint8_t *const data = frame->data;
    struct frame whole;
    if (frame->length == 0) {
        return false;
    }
    if (frame->id == PROTO_CAN_HOST_TO_BOARD) {
        return data[0] == (uint8_t)PROTO_ID_STOP;
    }
    if (frame->length == CAN_DATA && (data[0] & 0xF0u) == FIRST) {
        const uint32_t length = (uint32_t)(data[0] & 0x0Fu) << 8 | data[1];
        return length > SINGLE_MAX && length <= FRAME_MAX_PLAIN && data[FIRST_ID] == (uint8_t)PROTO_ID_STOP;
    }
    return data[0] != 0 && data[0] < frame->length && data[1] == (uint8_t)PROTO_ID_STOP &&
           frame_open(data + 1, data[0], &whole);
}
