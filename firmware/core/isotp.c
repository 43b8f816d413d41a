/* ISO-TP (ISO 15765-2): messages of up to 4095 bytes over CAN frames of 8, one channel with both directions.
 */
#include "isotp.h"

#include <string.h>

/* Upper half of a frame's first byte, ISO 15765-2 table 9. */
enum { SINGLE = 0x0, FIRST = 0x1, CONSECUTIVE = 0x2, FLOW = 0x3 };
/* Flow status: the lower half of a flow control's first byte. */
enum { GO_ON = 0x0, WAIT = 0x1, OVERFLOW = 0x2 };
enum { SINGLE_MAX = 7, FIRST_DATA = 6, CONSECUTIVE_DATA = 7, FLOW_SIZE = 3 };

static size_t min_size(size_t a, size_t b)
{
    return a < b ? a : b;
}

void isotp_init(struct isotp *channel, uint8_t *buffer, uint16_t capacity, uint8_t block_size)
{
    memset(channel, 0, sizeof *channel);
    channel->in.buffer = buffer;
    channel->in.capacity = capacity;
    channel->in.block_size = block_size;
}

static void owe_flow(struct isotp *channel, uint8_t status)
{
    channel->in.answer = (uint8_t)(FLOW << 4 | status);
    channel->in.block_left = channel->in.block_size;
}

/* A new message ends one that is under way (ISO 15765-2 section 9.8.3). */
static void drop_unfinished(struct isotp *channel)
{
    if (channel->in.length != 0) {
        channel->errors.unexpected++;
        channel->in.length = 0;
    }
    channel->in.answer = 0;
}

static bool take_single(struct isotp *channel, const uint8_t *data, size_t length, size_t *message_length)
{
    const size_t size = data[0] & 0x0Fu;
    if (size == 0 || size > SINGLE_MAX || size > length - 1 || size > channel->in.capacity) {
        channel->errors.unexpected++;
        return false;
    }
    drop_unfinished(channel);
    memcpy(channel->in.buffer, data + 1, size);
    *message_length = size;
    return true;
}

static void take_first(struct isotp *channel, const uint8_t *data, size_t length, uint32_t now_ms)
{
    const uint16_t size = length < 2 ? (uint16_t)0 : (uint16_t)((data[0] & 0x0Fu) << 8 | data[1]);
    /* Zero announces an extended length (2016 edition), which is not supported. */
    const bool escaped = size == 0 && length == ISOTP_FRAME_SIZE;
    if (length < ISOTP_FRAME_SIZE || (size <= SINGLE_MAX && !escaped)) {
        channel->errors.unexpected++;
        return;
    }
    drop_unfinished(channel);
    if (escaped || size > channel->in.capacity) {
        channel->errors.overflows++;
        owe_flow(channel, OVERFLOW);
        return;
    }
    memcpy(channel->in.buffer, data + 2, FIRST_DATA);
    channel->in.length = size;
    channel->in.filled = FIRST_DATA;
    channel->in.next = 1;
    channel->in.since_ms = now_ms;
    owe_flow(channel, GO_ON);
}

static bool take_consecutive(struct isotp *channel, const uint8_t *data, size_t length, uint32_t now_ms,
                             size_t *message_length)
{
    if (channel->in.length == 0) {
        channel->errors.unexpected++;
        return false;
    }
    const size_t size = min_size((size_t)channel->in.length - channel->in.filled, CONSECUTIVE_DATA);
    if ((data[0] & 0x0Fu) != channel->in.next || length - 1 < size) {
        channel->errors.sequence++;
        channel->in.length = 0;
        channel->in.answer = 0;
        return false;
    }
    memcpy(channel->in.buffer + channel->in.filled, data + 1, size);
    channel->in.filled = (uint16_t)(channel->in.filled + size);
    channel->in.next = (channel->in.next + 1u) & 0x0Fu;
    channel->in.since_ms = now_ms;
    if (channel->in.filled == channel->in.length) {
        *message_length = channel->in.length;
        channel->in.length = 0;
        return true;
    }
    if (channel->in.block_size != 0 && --channel->in.block_left == 0) {
        owe_flow(channel, GO_ON);
    }
    return false;
}

/* STmin, ISO 15765-2 table 20: 0 to 127 ms, or 100 to 900 us; reserved values mean the longest. */
static uint8_t gap_of(uint8_t st_min)
{
    if (st_min == 0) {
        return 0;
    }
    if (st_min >= 0xF1u && st_min <= 0xF9u) {
        return 2;
    }
    return (uint8_t)((st_min < 0x7Fu ? st_min : 0x7Fu) + 1u);
}

static void take_flow(struct isotp *channel, const uint8_t *data, size_t length, uint32_t now_ms)
{
    if (channel->out.state != ISOTP_WAITING || length < FLOW_SIZE) {
        channel->errors.unexpected++;
        return;
    }
    const uint8_t status = data[0] & 0x0Fu;
    if (status == GO_ON) {
        channel->out.waits = 0;
        channel->out.limited = data[1] != 0;
        channel->out.block_left = data[1];
        channel->out.gap_ms = gap_of(data[2]);
        channel->out.since_ms = now_ms - channel->out.gap_ms; /* the first frame of a block may go at once */
        channel->out.state = ISOTP_SENDING;
    } else if (status == WAIT && channel->out.waits < ISOTP_WAITS_ALLOWED) {
        channel->out.waits++;
        channel->out.since_ms = now_ms;
    } else {
        if (status == OVERFLOW) {
            channel->errors.overflows++;
        } else {
            channel->errors.unexpected++;
        }
        channel->out.state = ISOTP_IDLE;
    }
}

bool isotp_receive(struct isotp *channel, const uint8_t *data, size_t length, uint32_t now_ms,
                   size_t *message_length)
{
    if (length == 0 || length > ISOTP_FRAME_SIZE) {
        return false;
    }
    switch (data[0] >> 4) {
    case SINGLE:
        return take_single(channel, data, length, message_length);
    case FIRST:
        take_first(channel, data, length, now_ms);
        return false;
    case CONSECUTIVE:
        return take_consecutive(channel, data, length, now_ms, message_length);
    case FLOW:
        take_flow(channel, data, length, now_ms);
        return false;
    default:
        channel->errors.unexpected++;
        return false;
    }
}

bool isotp_send(struct isotp *channel, const uint8_t *data, size_t length)
{
    if (channel->out.state != ISOTP_IDLE || length == 0 || length > ISOTP_MAX_LENGTH) {
        return false;
    }
    channel->out.data = data;
    channel->out.length = (uint16_t)length;
    channel->out.sent = 0;
    channel->out.waits = 0;
    channel->out.state = ISOTP_STARTING;
    return true;
}

bool isotp_is_idle(const struct isotp *channel)
{
    return channel->out.state == ISOTP_IDLE;
}

static size_t start_message(struct isotp *channel, uint8_t *out, uint32_t now_ms)
{
    const uint16_t length = channel->out.length;
    if (length <= SINGLE_MAX) {
        out[0] = (uint8_t)length;
        memcpy(out + 1, channel->out.data, length);
        channel->out.state = ISOTP_IDLE;
        return (size_t)length + 1;
    }
    out[0] = (uint8_t)(FIRST << 4 | length >> 8);
    out[1] = (uint8_t)(length & 0xFFu);
    memcpy(out + 2, channel->out.data, FIRST_DATA);
    channel->out.sent = FIRST_DATA;
    channel->out.next = 1;
    channel->out.since_ms = now_ms;
    channel->out.state = ISOTP_WAITING;
    return ISOTP_FRAME_SIZE;
}

static size_t continue_message(struct isotp *channel, uint8_t *out, uint32_t now_ms)
{
    if (now_ms - channel->out.since_ms < channel->out.gap_ms) {
        return 0;
    }
    const size_t size = min_size((size_t)channel->out.length - channel->out.sent, CONSECUTIVE_DATA);
    out[0] = (uint8_t)(CONSECUTIVE << 4 | channel->out.next);
    memcpy(out + 1, channel->out.data + channel->out.sent, size);
    channel->out.sent = (uint16_t)(channel->out.sent + size);
    channel->out.next = (channel->out.next + 1u) & 0x0Fu;
    channel->out.since_ms = now_ms;
    if (channel->out.sent == channel->out.length) {
        channel->out.state = ISOTP_IDLE;
    } else if (channel->out.limited && --channel->out.block_left == 0) {
        channel->out.state = ISOTP_WAITING;
    }
    return size + 1;
}

size_t isotp_next_frame(struct isotp *channel, uint8_t out[ISOTP_FRAME_SIZE], uint32_t now_ms)
{
    /* Flow control first: the peer waits for it. */
    if (channel->in.answer != 0) {
        out[0] = channel->in.answer;
        out[1] = channel->in.block_size;
        out[2] = 0; /* STmin: the driver's queue takes a whole block as fast as the bus can bring it */
        channel->in.answer = 0;
        return FLOW_SIZE;
    }
    if (channel->out.state == ISOTP_STARTING) {
        return start_message(channel, out, now_ms);
    }
    return channel->out.state == ISOTP_SENDING ? continue_message(channel, out, now_ms) : 0;
}

void isotp_expire(struct isotp *channel, uint32_t now_ms)
{
    if (channel->in.length != 0 && now_ms - channel->in.since_ms >= ISOTP_TIMEOUT_MS) {
        channel->errors.timeouts++;
        channel->in.length = 0;
    }
    if (channel->out.state == ISOTP_WAITING && now_ms - channel->out.since_ms >= ISOTP_TIMEOUT_MS) {
        channel->errors.timeouts++;
        channel->out.state = ISOTP_IDLE;
    }
}
