/* The link over CAN: frames without COBS as ISO-TP messages, calls to all boards, and status broadcasts.
 *
 * Ids and layouts are the schema's: requests come on PROTO_CAN_HOST_TO_BOARD + node, replies go out on
 * PROTO_CAN_BOARD_TO_HOST + node. */
#ifndef CAN_LINK_H
#define CAN_LINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "frame.h"
#include "hal.h"
#include "isotp.h"
#include "link.h"
#include "proto.h"

enum {
    /* One full reply and two short ones: the bus is slower than the controller answers waiting requests. */
    CAN_LINK_QUEUE_SIZE = LINK_LARGEST_FRAME + 2 * LINK_SMALL_FRAME + 4,
    CAN_LINK_WAITING = 8,          /* requests that wait for room, as many as a host may have under way */
    CAN_LINK_WAITING_LONGEST = 24, /* a longer request than this cannot wait; it is lost, as on a full line */
    CAN_LINK_BLOCK = 8,   /* frames that a host may send before it waits: a fraction of the driver's queue */
    CAN_LINK_RESERVE = 4, /* frames of the driver's queue reserved for flow control and status */
    CAN_LINK_SPREAD_MS = 64, /* boards answer a call after a delay of 1 to this */
};

enum can_link_event { CAN_LINK_NOTHING, CAN_LINK_REQUEST, CAN_LINK_STOP };

/* A complete request, as received. */
struct can_link_request {
    uint8_t length;
    uint8_t bytes[CAN_LINK_WAITING_LONGEST];
};

struct can_link {
    struct isotp channel;
    uint8_t message[FRAME_MAX_PLAIN];   /* received */
    uint8_t queue[CAN_LINK_QUEUE_SIZE]; /* replies, each with its length in two bytes before it */
    uint16_t queue_length;
    bool sending; /* the first of the queue is on its way */
    uint8_t waiting_first;
    uint8_t waiting_length;
    struct can_link_request waiting[CAN_LINK_WAITING];
    uint32_t dropped;
    uint32_t bits_per_s;
    uint32_t board; /* CRC-32 of the board's id */
    uint8_t node;
    bool announce_due;
    uint32_t announce_at_ms;
    uint32_t status_at_ms;
};

void can_link_init(struct can_link *link, const uint8_t *board_id, size_t board_id_length);

/* Joins the bus as `node`, when that is not the case already and nothing waits to be sent. */
void can_link_configure(struct can_link *link, uint8_t node, uint32_t bits_per_s);

/* The next input: a valid request in *out, or a broadcast stop. Requests wait here while there is no room for
 * the longest reply, and keep their order; a stop overtakes them. */
enum can_link_event can_link_receive(struct can_link *link, uint32_t now_ms, struct frame *out);

bool can_link_has_room(const struct can_link *link, size_t size);
void can_link_send(struct can_link *link, uint8_t id, uint16_t sequence, const uint8_t *payload,
                   size_t length);

/* Hands frames to the driver, as many as it takes. */
void can_link_flush(struct can_link *link, uint32_t now_ms);

/* Whether a status broadcast is due now, `rate_hz` times a second; 0: never. It counts as sent. */
bool can_link_status_due(struct can_link *link, uint32_t now_ms, uint32_t rate_hz);
void can_link_broadcast(struct can_link *link, const struct proto_status_reply *status);

#endif
