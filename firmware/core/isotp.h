/* ISO-TP (ISO 15765-2): messages of up to 4095 bytes over CAN frames of 8, one channel with both directions.
 *
 * Classic CAN, normal addressing: the frame's id identifies sender and receiver and is handled by the caller.
 * Time is the control tick's, in milliseconds. No buffer is owned here but the one for reception. */
#ifndef ISOTP_H
#define ISOTP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    ISOTP_FRAME_SIZE = 8,
    ISOTP_MAX_LENGTH = 4095,
    /* N_Bs and N_Cr. The standard allows a second; but each lost flow control or first frame holds the
     * channel up for this long, and a host that is busy answers within tens of milliseconds. */
    ISOTP_TIMEOUT_MS = 100,
    ISOTP_WAITS_ALLOWED = 8, /* N_WFTmax: flow controls in a row that ask to wait */
};

enum isotp_sending { ISOTP_IDLE, ISOTP_STARTING, ISOTP_WAITING, ISOTP_SENDING };

/* What went wrong since the start. */
struct isotp_errors {
    uint32_t sequence;   /* a consecutive frame was missing or doubled: its message is dropped */
    uint32_t timeouts;   /* the peer stopped within a message */
    uint32_t overflows;  /* a message too long for this side, or for the peer */
    uint32_t unexpected; /* an unexpected frame: ignored, or it aborts the transfer */
};

struct isotp {
    struct {
        uint8_t *buffer;
        uint16_t capacity;
        uint16_t length; /* of the message under way; 0: none is */
        uint16_t filled;
        uint8_t next;       /* sequence number of the next consecutive frame */
        uint8_t block_size; /* frames that the peer may send before it must wait; 0: all */
        uint8_t block_left;
        uint8_t answer; /* pending flow control: its first byte, 0 for none */
        uint32_t since_ms;
    } in;
    struct {
        const uint8_t *data;
        uint16_t length;
        uint16_t sent;
        uint8_t state; /* enum isotp_sending */
        uint8_t next;
        uint8_t waits;
        bool limited; /* the peer gave a block size */
        uint8_t block_left;
        uint8_t gap_ms; /* STmin, rounded up, and one: two ticks may lie close together */
        uint32_t since_ms;
    } out;
    struct isotp_errors errors;
};

void isotp_init(struct isotp *channel, uint8_t *buffer, uint16_t capacity, uint8_t block_size);

/* Takes a received frame; true when it completed a message: isotp_message holds it until the next frame. */
bool isotp_receive(struct isotp *channel, const uint8_t *data, size_t length, uint32_t now_ms,
                   size_t *message_length);

/* Begins to send; false while another message is under way, or when its length is not 1 to 4095. The data
 * must stay until isotp_is_idle. */
bool isotp_send(struct isotp *channel, const uint8_t *data, size_t length);
bool isotp_is_idle(const struct isotp *channel);

/* The next frame that may be sent now; returns its length, 0 when there is none. It counts as sent. */
size_t isotp_next_frame(struct isotp *channel, uint8_t out[ISOTP_FRAME_SIZE], uint32_t now_ms);

/* Ends transfers whose peer has timed out. */
void isotp_expire(struct isotp *channel, uint32_t now_ms);

#endif
