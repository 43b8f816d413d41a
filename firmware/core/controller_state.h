/* Everything that the controller keeps: what controller.c and requests.c work on. */
#ifndef CONTROLLER_STATE_H
#define CONTROLLER_STATE_H

#include <stdbool.h>
#include <stdint.h>

#include "can_link.h"
#include "hal.h"
#include "link.h"
#include "robot_state.h"
#include "stop_listener.h"
#include "update.h"

enum {
    CONTROLLER_TICK_HZ = 1000,
    /* A port's requests wait for the next round once this much of the present one has passed, so that the
     * other port gets its turn and the round ends: a flood of requests is no hang. */
    CONTROLLER_ROUND_MS = 10,
    /* A round takes two of those and what came last: a digest over the whole log takes 10 ms, and discarding
     * blocks of an armed log 8. A main loop that takes longer hangs. */
    CONTROLLER_POLL_MS = 40,
};

/* Where a request came from, and its reply goes to. */
enum controller_port { PORT_SERIAL, PORT_CAN, CONTROLLER_PORTS };

/* The last changing request with its reply: when the same frame comes again, the reply was lost. */
struct reply_cache {
    bool valid;
    uint8_t request_id;
    uint16_t sequence;
    uint32_t crc;
    uint8_t reply_id;
    uint8_t length;
    uint8_t reply[16]; /* the replies of changing requests are short */
};

struct controller {
    struct robot robot;
    struct link link;
    struct can_link can;
    struct stop_listener listener;
    struct update update;
    struct hal_identity identity;
    uint8_t port;                               /* of the request that is being answered */
    uint8_t sequence_port;                      /* of the host that started the last sequence */
    struct reply_cache cache[CONTROLLER_PORTS]; /* one for each port: two hosts do not share one */
    volatile uint32_t
        since_poll_ms;     /* ticks since its round began; the main loop writes 0, the tick counts */
    uint32_t polled_at_ms; /* the tick that the main loop has last seen */
    uint32_t bus_off_ms;   /* when the CAN controller was last seen off a bus that had worked */
    bool bus_off;          /* it was, within the last second */
    uint8_t reply[PROTO_MAX_PAYLOAD];
};

#endif
