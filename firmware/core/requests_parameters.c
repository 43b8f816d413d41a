/* The requests that read, change and store parameters. */
#include "requests_parameters.h"

#include <string.h>

#include "robot_parameters.h"

static struct refusal bad_length(const struct frame *request)
{
    return refused(PROTO_REFUSAL_REASON_BAD_LENGTH, (uint32_t)request->payload_length);
}

struct refusal requests_param_list(const struct robot *robot, const struct frame *request,
                                   struct reply *reply)
{
    struct proto_param_list_request in;
    if (!proto_param_list_request_decode(&in, request->payload, request->payload_length)) {
        return bad_length(request);
    }
    if (in.index >= PROTO_PARAMETER_COUNT) {
        return refused(PROTO_REFUSAL_REASON_UNKNOWN_PARAMETER, in.index);
    }
    const struct proto_parameter_info *const info = &proto_parameters[in.index];
    struct proto_param_list_reply out = {
        .index = in.index,
        .kind = info->kind,
        .minimum = info->minimum,
        .maximum = info->maximum,
        .default_value = info->default_value,
        .value = robot->parameters.values[in.index],
        .stored_value = info->default_value,
    };
    out.stored = parameter_store_find(&robot->store, info, &out.stored_value);
    strncpy(out.name, info->name, sizeof out.name - 1);
    strncpy(out.unit, info->unit, sizeof out.unit - 1);
    reply->length = proto_param_list_reply_encode(&out, reply->bytes, reply->capacity);
    return accepted();
}

struct refusal requests_param_get(const struct robot *robot, const struct frame *request, struct reply *reply)
{
    struct proto_param_get_request in;
    if (!proto_param_get_request_decode(&in, request->payload, request->payload_length)) {
        return bad_length(request);
    }
    if (in.index >= PROTO_PARAMETER_COUNT) {
        return refused(PROTO_REFUSAL_REASON_UNKNOWN_PARAMETER, in.index);
    }
    const struct proto_param_get_reply out = {
        .index = in.index,
        .value = robot->parameters.values[in.index],
    };
    reply->length = proto_param_get_reply_encode(&out, reply->bytes, reply->capacity);
    return accepted();
}

struct refusal requests_param_set(struct robot *robot, const struct frame *request, struct reply *reply)
{
    struct proto_param_set_request in;
    if (!proto_param_set_request_decode(&in, request->payload, request->payload_length)) {
        return bad_length(request);
    }
    const struct refusal verdict = robot_set_parameter(robot, in.index, in.value);
    if (verdict.reason == REFUSAL_NONE) {
        const struct proto_param_set_reply out = {
            .index = in.index,
            .value = robot->parameters.values[in.index],
        };
        reply->length = proto_param_set_reply_encode(&out, reply->bytes, reply->capacity);
    }
    return verdict;
}

struct refusal requests_param_save(struct robot *robot, const struct frame *request, struct reply *reply)
{
    if (request->payload_length != 0) {
        return bad_length(request);
    }
    struct proto_param_save_reply out;
    const struct refusal verdict = robot_save_parameters(robot, &out);
    if (verdict.reason == REFUSAL_NONE) {
        reply->length = proto_param_save_reply_encode(&out, reply->bytes, reply->capacity);
    }
    return verdict;
}

struct refusal requests_param_load(struct robot *robot, const struct frame *request, struct reply *reply)
{
    if (request->payload_length != 0) {
        return bad_length(request);
    }
    struct proto_param_load_reply out;
    const struct refusal verdict = robot_load_parameters(robot, &out.stored);
    if (verdict.reason == REFUSAL_NONE) {
        reply->length = proto_param_load_reply_encode(&out, reply->bytes, reply->capacity);
    }
    return verdict;
}

struct refusal requests_param_defaults(struct robot *robot, const struct frame *request)
{
    return request->payload_length == 0 ? robot_default_parameters(robot) : bad_length(request);
}

struct refusal requests_param_store(struct robot *robot, const struct frame *request, struct reply *reply)
{
    if (request->payload_length != 0) {
        return bad_length(request);
    }
    struct proto_param_store_reply out;
    robot_parameter_store(robot, &out);
    reply->length = proto_param_store_reply_encode(&out, reply->bytes, reply->capacity);
    return accepted();
}
