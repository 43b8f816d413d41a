/* The whole controller, for the target's main: one static struct, init once, tick every millisecond, poll for
 * ever. */
#ifndef CONTROLLER_H
#define CONTROLLER_H

#include <stdbool.h>
#include <stdint.h>

#include "can_link.h"
#include "frame.h"
#include "hal.h"
#include "link.h"
#include "robot.h"

enum { CONTROLLER_TICK_HZ = 1000 };

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
    struct hal_identity identity;
    uint8_t port;                               /* of the request that is being answered */
    struct reply_cache cache[CONTROLLER_PORTS]; /* two hosts do not make each other's replies forgotten */
    uint32_t fed_at_ms;                         /* the tick at which the watchdog was last fed */
    uint32_t bus_off_ms; /* when the CAN controller was last seen off a bus that had worked */
    bool bus_off;        /* it was, within the last second */
    uint8_t reply[PROTO_MAX_PAYLOAD];
};

/* Before the tick interrupt is enabled. */
void controller_init(struct controller *controller);

/* Exactly every millisecond, from the tick interrupt. Constant work. */
void controller_tick(struct controller *controller);

/* From the main loop, as often as possible. Feeds the watchdog as long as ticks go on. */
void controller_poll(struct controller *controller);

/* From the tick interrupt's handler, when the next tick was due before this one had ended. */
void controller_note_overrun(struct controller *controller);

#endif
