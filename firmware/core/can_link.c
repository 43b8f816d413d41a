/* The link over CAN: frames without COBS as ISO-TP messages, calls to all boards, and status broadcasts. */
#include "can_link.h"

#include <string.h>

#include "crc32.h"

enum { LENGTH_SIZE = 2 };

void can_link_init(struct can_link *link, const uint8_t *board_id, size_t board_id_length)
{
    memset(link, 0, sizeof *link);
    isotp_init(&link->channel, link->message, sizeof link->message, CAN_LINK_BLOCK);
    link->board = crc32_update(0, board_id, board_id_length);
}

void can_link_configure(struct can_link *link, uint8_t node, uint32_t bits_per_s)
{
    /* The reply to the request that changed this is sent first, as long as the bus accepts it. */
    const bool waiting = (link->queue_length > 0 || link->waiting_length > 0) && hal_can_writable() > 0;
    if ((node == link->node && bits_per_s == link->bits_per_s) || waiting) {
        return;
    }
    const uint16_t ids[2] = {(uint16_t)(PROTO_CAN_HOST_TO_BOARD + node), (uint16_t)PROTO_CAN_HOST_TO_BOARD};
    link->node = node;
    link->bits_per_s = bits_per_s;
    hal_can_start(bits_per_s, ids);
}

/* A call to all boards is one byte, the id of the request that is meant. */
static enum can_link_event take_call(struct can_link *link, const struct hal_can_frame *frame,
                                     uint32_t now_ms)
{
    if (frame->length == 0) {
        return CAN_LINK_NOTHING;
    }
    if (frame->data[0] == PROTO_ID_HELLO) {
        /* By the chip's own id: boards that were given the same node number differ in it. */
        link->announce_at_ms = now_ms + 1u + link->board % CAN_LINK_SPREAD_MS;
        link->announce_due = true;
    }
    return frame->data[0] == PROTO_ID_STOP ? CAN_LINK_STOP : CAN_LINK_NOTHING;
}

bool can_link_has_room(const struct can_link *link, size_t size)
{
    return sizeof link->queue - link->queue_length >= size + LENGTH_SIZE;
}

/* Includes the one short reply for which requests.c keeps room. */
static bool has_room_for_longest(const struct can_link *link)
{
    return can_link_has_room(link, LINK_LARGEST_FRAME + LINK_SMALL_FRAME);
}

/* Queues a complete request; false: it can be handled at once. */
static bool hold(struct can_link *link, size_t length)
{
    const bool busy = link->waiting_length > 0 || !has_room_for_longest(link);
    if (!busy || link->message[0] == PROTO_ID_STOP ||
        (link->waiting_length == 0 && length > CAN_LINK_WAITING_LONGEST)) {
        return false;
    }
    if (link->waiting_length < CAN_LINK_WAITING && length <= CAN_LINK_WAITING_LONGEST) {
        struct can_link_request *const last =
            &link->waiting[(link->waiting_first + (size_t)link->waiting_length) % CAN_LINK_WAITING];
        last->length = (uint8_t)length;
        memcpy(last->bytes, link->message, length);
        link->waiting_length++;
    }
    return true;
}

static bool next_waiting(struct can_link *link, struct frame *out)
{
    if (link->waiting_length == 0 || !has_room_for_longest(link)) {
        return false;
    }
    const struct can_link_request *const first = &link->waiting[link->waiting_first];
    link->waiting_first = (uint8_t)((link->waiting_first + 1u) % CAN_LINK_WAITING);
    link->waiting_length--;
    return frame_open(first->bytes, first->length, out); /* its slot is not reused before the next frame */
}

enum can_link_event can_link_receive(struct can_link *link, uint32_t now_ms, struct frame *out)
{
    struct hal_can_frame frame;
    if (next_waiting(link, out)) {
        return CAN_LINK_REQUEST;
    }
    while (hal_can_read(&frame)) {
        size_t length;
        if (frame.id == PROTO_CAN_HOST_TO_BOARD) {
            const enum can_link_event event = take_call(link, &frame, now_ms);
            if (event != CAN_LINK_NOTHING) {
                return event;
            }
        } else if (isotp_receive(&link->channel, frame.data, frame.length, now_ms, &length)) {
            if (!frame_open(link->message, length, out)) {
                link->dropped++;
            } else if (!hold(link, length)) {
                return CAN_LINK_REQUEST;
            }
        }
    }
    return CAN_LINK_NOTHING;
}

static void put(struct can_link *link, const uint8_t *data, size_t length)
{
    memcpy(link->queue + link->queue_length, data, length);
    link->queue_length = (uint16_t)(link->queue_length + length);
}

void can_link_send(struct can_link *link, uint8_t id, uint16_t sequence, const uint8_t *payload,
                   size_t length)
{
    uint8_t header[LENGTH_SIZE + FRAME_HEADER_SIZE];
    const size_t plain = FRAME_HEADER_SIZE + length + FRAME_CRC_SIZE;
    if (plain > FRAME_MAX_PLAIN || !can_link_has_room(link, plain)) {
        return;
    }
    header[0] = (uint8_t)(plain & 0xFFu);
    header[1] = (uint8_t)(plain >> 8);
    header[2] = id;
    header[3] = (uint8_t)(sequence & 0xFFu);
    header[4] = (uint8_t)(sequence >> 8);
    uint32_t crc = crc32_update(0, header + LENGTH_SIZE, FRAME_HEADER_SIZE);
    crc = crc32_update(crc, payload, length);
    const uint8_t trailer[FRAME_CRC_SIZE] = {(uint8_t)(crc & 0xFFu), (uint8_t)((crc >> 8) & 0xFFu),
                                             (uint8_t)((crc >> 16) & 0xFFu), (uint8_t)(crc >> 24)};
    put(link, header, sizeof header);
    put(link, payload, length);
    put(link, trailer, sizeof trailer);
}

static size_t first_length(const struct can_link *link)
{
    return (size_t)(link->queue[0] | link->queue[1] << 8);
}

/* The reply that goes out stays where it is until its last frame is with the driver. */
static void start_next(struct can_link *link)
{
    if (!isotp_is_idle(&link->channel)) {
        return;
    }
    if (link->sending) {
        const size_t gone = LENGTH_SIZE + first_length(link);
        link->queue_length = (uint16_t)(link->queue_length - gone);
        memmove(link->queue, link->queue + gone, link->queue_length);
        link->sending = false;
    }
    if (link->queue_length > 0) {
        link->sending = isotp_send(&link->channel, link->queue + LENGTH_SIZE, first_length(link));
    }
}

static void announce(struct can_link *link)
{
    const struct proto_can_announce out = {.schema_hash = PROTO_SCHEMA_HASH, .board = link->board};
    struct hal_can_frame frame = {.id = (uint16_t)(PROTO_CAN_ANNOUNCE_BASE + link->node)};
    frame.length = (uint8_t)proto_can_announce_encode(&out, frame.data, sizeof frame.data);
    hal_can_write(&frame);
}

void can_link_flush(struct can_link *link, uint32_t now_ms)
{
    isotp_expire(&link->channel, now_ms);
    if (link->announce_due && (int32_t)(now_ms - link->announce_at_ms) >= 0 && hal_can_writable() > 0) {
        link->announce_due = false;
        announce(link);
    }
    while (hal_can_writable() > CAN_LINK_RESERVE) {
        struct hal_can_frame frame = {.id = (uint16_t)(PROTO_CAN_BOARD_TO_HOST + link->node)};
        start_next(link);
        frame.length = (uint8_t)isotp_next_frame(&link->channel, frame.data, now_ms);
        if (frame.length == 0) {
            return;
        }
        hal_can_write(&frame);
    }
}

bool can_link_status_due(struct can_link *link, uint32_t now_ms, uint32_t rate_hz)
{
    if (rate_hz == 0 || now_ms - link->status_at_ms < 1000u / rate_hz || hal_can_writable() < 2) {
        return false;
    }
    link->status_at_ms = now_ms;
    return true;
}

void can_link_broadcast(struct can_link *link, const struct proto_status_reply *status)
{
    const struct proto_can_status how = {
        .faults = status->faults_active | status->faults_latched,
        .state = status->state,
        .mode = status->mode,
        .battery = status->battery_mv,
    };
    const struct proto_can_motion motion = {
        .speed_left = status->speed_mmps[0],
        .speed_right = status->speed_mmps[1],
        .effort_left = status->effort_e4[0],
        .effort_right = status->effort_e4[1],
    };
    struct hal_can_frame frame = {.id = (uint16_t)(PROTO_CAN_STATUS_BASE + link->node)};
    frame.length = (uint8_t)proto_can_status_encode(&how, frame.data, sizeof frame.data);
    hal_can_write(&frame);
    frame.id = (uint16_t)(PROTO_CAN_MOTION_BASE + link->node);
    frame.length = (uint8_t)proto_can_motion_encode(&motion, frame.data, sizeof frame.data);
    hal_can_write(&frame);
}
