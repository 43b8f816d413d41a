/* The link's two ends: frames out of received bytes, replies into the queue of bytes to send. */
#ifndef LINK_H
#define LINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "frame.h"

enum {
    /* A frame is sent with a zero before it too, so that noise on the idle line does not corrupt it. */
    LINK_LARGEST_FRAME = FRAME_MAX_CODED + 1,
    LINK_SMALL_FRAME = 160, /* the largest frame of a reply that carries no bulk data */
    /* Three full replies, so that the line never idles between them. */
    LINK_QUEUE_SIZE = 4096,
    LINK_CHUNK_SIZE = 64,
};

struct link {
    struct frame_decoder decoder;
    uint8_t chunk[LINK_CHUNK_SIZE]; /* received, not yet decoded */
    uint8_t chunk_length;
    uint8_t chunk_at;
    uint8_t queue[LINK_QUEUE_SIZE]; /* coded replies that the line has not taken yet */
    uint16_t queue_first;
    uint16_t queue_length;
    uint8_t coded[LINK_LARGEST_FRAME];
};

/* The next valid frame among the bytes received so far; false when there is none. */
bool link_receive(struct link *link, struct frame *out);

/* Whether a reply with a frame of `size` bytes can be queued now. */
bool link_has_room(const struct link *link, size_t size);

/* Queues a reply; the caller has asked link_has_room. */
void link_send(struct link *link, uint8_t id, uint16_t sequence, const uint8_t *payload, size_t length);

/* Hands queued bytes to the line, as many as it takes. */
void link_flush(struct link *link);

#endif
