/* The requests that read the log. */
#include "requests_log.h"

static struct refusal bad_length(const struct frame *request)
{
    return refused(PROTO_REFUSAL_REASON_BAD_LENGTH, (uint32_t)request->payload_length);
}

struct refusal requests_log_list(const struct log *log, const struct frame *request, struct reply *reply)
{
    struct proto_log_list_request in;
    if (!proto_log_list_request_decode(&in, request->payload, request->payload_length)) {
        return bad_length(request);
    }
    /* Entries are written straight into the reply, behind the place of its fixed part. */
    uint8_t *const entries = reply->bytes + PROTO_LOG_LIST_REPLY_SIZE;
    const size_t room = (reply->capacity - PROTO_LOG_LIST_REPLY_SIZE) / PROTO_LOG_ENTRY_SIZE;
    size_t count = 0;
    uint32_t total = 0;
    struct log_walk walk = log_walk_start(log);
    struct proto_log_entry entry;
    while (log_walk_next(log, &walk, &entry)) {
        if (total >= in.first && count < room) {
            (void)proto_log_entry_encode(&entry, entries + count * PROTO_LOG_ENTRY_SIZE,
                                         PROTO_LOG_ENTRY_SIZE);
            count++;
        }
        total++;
    }
    const struct proto_log_list_reply out = {
        .oldest_offset = log_oldest_offset(log),
        .end_offset = log_end_offset(log),
        .total = (uint16_t)total,
    };
    reply->length =
        proto_log_list_reply_encode(&out, reply->bytes, reply->capacity) + count * PROTO_LOG_ENTRY_SIZE;
    return accepted();
}

/* Whether `length` bytes from `offset` on are sealed and still there; offsets count modulo 2^32. */
static struct refusal check_range(const struct log *log, uint32_t offset, uint32_t length)
{
    const uint32_t end = log_end_offset(log);
    const uint32_t oldest = log_oldest_offset(log);
    const uint32_t held = end - oldest;
    const uint32_t from_oldest = offset - oldest;
    if (from_oldest < held) {
        return length <= held - from_oldest ? accepted() : refused(PROTO_REFUSAL_REASON_LOG_BEYOND_END, end);
    }
    /* Outside: the nearer side decides. */
    return from_oldest > UINT32_MAX / 2 ? refused(PROTO_REFUSAL_REASON_LOG_GONE, oldest)
                                        : refused(PROTO_REFUSAL_REASON_LOG_BEYOND_END, end);
}

struct refusal requests_log_read(const struct log *log, const struct frame *request, struct reply *reply)
{
    struct proto_log_read_request in;
    if (!proto_log_read_request_decode(&in, request->payload, request->payload_length)) {
        return bad_length(request);
    }
    if (in.length == 0 || in.length > PROTO_MAX_PAYLOAD - PROTO_LOG_READ_REPLY_SIZE) {
        return refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    }
    const struct refusal verdict = check_range(log, in.offset, 1);
    if (verdict.reason != REFUSAL_NONE) {
        return verdict;
    }
    const uint32_t left = log_end_offset(log) - in.offset;
    const size_t length = in.length < left ? in.length : left;
    log_copy(log, in.offset, reply->bytes + PROTO_LOG_READ_REPLY_SIZE, length);
    const struct proto_log_read_reply out = {.offset = in.offset};
    reply->length = proto_log_read_reply_encode(&out, reply->bytes, reply->capacity) + length;
    return accepted();
}

struct refusal requests_log_digest(const struct log *log, const struct frame *request, struct reply *reply)
{
    struct proto_log_digest_request in;
    if (!proto_log_digest_request_decode(&in, request->payload, request->payload_length)) {
        return bad_length(request);
    }
    if (in.length == 0) {
        return refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    }
    const struct refusal verdict = check_range(log, in.offset, in.length);
    if (verdict.reason != REFUSAL_NONE) {
        return verdict;
    }
    const struct proto_log_digest_reply out = {
        .offset = in.offset,
        .length = in.length,
        .crc32 = log_digest(log, in.offset, in.length),
    };
    reply->length = proto_log_digest_reply_encode(&out, reply->bytes, reply->capacity);
    return accepted();
}
