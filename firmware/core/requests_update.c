/* The requests that bring a new image of the firmware, and that start the board anew. */
#include "requests_update.h"

static struct refusal bad_length(const struct frame *request)
{
    return refused(PROTO_REFUSAL_REASON_BAD_LENGTH, (uint32_t)request->payload_length);
}

struct refusal requests_update_state(const struct update *update, const struct robot *robot,
                                     const struct frame *request, struct reply *reply)
{
    struct proto_update_state_reply out;
    if (request->payload_length != 0) {
        return bad_length(request);
    }
    update_report(update, robot, &out);
    reply->length = proto_update_state_reply_encode(&out, reply->bytes, reply->capacity);
    return accepted();
}

struct refusal requests_update_begin(struct update *update, struct robot *robot, const struct frame *request,
                                     struct reply *reply)
{
    struct proto_update_begin_request in;
    struct proto_update_begin_reply out = {0};
    if (!proto_update_begin_request_decode(&in, request->payload, request->payload_length)) {
        return bad_length(request);
    }
    const struct refusal verdict = update_begin(update, robot, &in, &out);
    reply->length = proto_update_begin_reply_encode(&out, reply->bytes, reply->capacity);
    return verdict;
}

struct refusal requests_update_data(struct update *update, uint32_t now_ms, const struct frame *request,
                                    struct reply *reply)
{
    struct proto_update_data_request in;
    if (!proto_update_data_request_decode(&in, request->payload, request->payload_length)) {
        return bad_length(request);
    }
    const struct refusal verdict = update_data(update, now_ms, &in);
    const struct proto_update_data_reply out = {.next = update->next};
    reply->length = proto_update_data_reply_encode(&out, reply->bytes, reply->capacity);
    return verdict;
}

struct refusal requests_update_finish(struct update *update, const struct frame *request, struct reply *reply)
{
    struct proto_update_finish_reply out = {0};
    if (request->payload_length != 0) {
        return bad_length(request);
    }
    const struct refusal verdict = update_finish(update, &out.sequence);
    reply->length = proto_update_finish_reply_encode(&out, reply->bytes, reply->capacity);
    return verdict;
}

struct refusal requests_restart(struct update *update, struct robot *robot, const struct frame *request)
{
    struct proto_restart_request in;
    if (!proto_restart_request_decode(&in, request->payload, request->payload_length)) {
        return bad_length(request);
    }
    return update_restart(update, robot, in.boot_id);
}
