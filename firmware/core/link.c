/* The link's two ends: frames out of received bytes, replies into the queue of bytes to send. */
#include "link.h"

#include <string.h>

#include "hal.h"

bool link_receive(struct link *link, struct frame *out)
{
    for (;;) {
        if (link->chunk_at == link->chunk_length) {
            link->chunk_length = (uint8_t)hal_link_read(link->chunk, sizeof link->chunk);
            link->chunk_at = 0;
            if (link->chunk_length == 0) {
                return false;
            }
        }
        const uint8_t byte = link->chunk[link->chunk_at];
        link->chunk_at++;
        if (frame_decoder_push(&link->decoder, byte, out)) {
            return true;
        }
    }
}

bool link_has_room(const struct link *link, size_t size)
{
    return sizeof link->queue - link->queue_length >= size;
}

void link_send(struct link *link, uint8_t id, uint16_t sequence, const uint8_t *payload, size_t length)
{
    link->coded[0] = 0;
    size_t left = 1 + frame_encode(id, sequence, payload, length, link->coded + 1, sizeof link->coded - 1);
    if (!link_has_room(link, left)) {
        return;
    }
    const uint8_t *from = link->coded;
    while (left > 0) {
        const size_t at = (link->queue_first + (size_t)link->queue_length) % sizeof link->queue;
        const size_t run = left < sizeof link->queue - at ? left : sizeof link->queue - at;
        memcpy(link->queue + at, from, run);
        from += run;
        left -= run;
        link->queue_length = (uint16_t)(link->queue_length + run);
    }
}

void link_flush(struct link *link)
{
    while (link->queue_length > 0) {
        const size_t together = sizeof link->queue - link->queue_first;
        const size_t run = link->queue_length < together ? link->queue_length : together;
        const size_t taken = hal_link_write(link->queue + link->queue_first, run);
        link->queue_first = (uint16_t)((link->queue_first + taken) % sizeof link->queue);
        link->queue_length = (uint16_t)(link->queue_length - taken);
        if (taken < run) {
            return;
        }
    }
}
