/* Requests from the host: each is checked, carried out or refused by name, and answered with one frame. */
#include "requests.h"

#include <string.h>

#include "boot.h"
#include "requests_log.h"
#include "requests_parameters.h"
#include "requests_update.h"
#include "robot.h"
#include "robot_time.h"

#ifndef TRUING_BOARD_NAME
#define TRUING_BOARD_NAME "host"
#endif
#ifndef TRUING_FIRMWARE_VERSION
#define TRUING_FIRMWARE_VERSION "0"
#endif

/* Handlers read a payload and write one; the dispatcher handles the frames. */
typedef struct refusal handler(struct controller *controller, const struct frame *request,
                               struct reply *reply);

struct entry {
    uint8_t id;
    bool bulk; /* the reply may fill a whole frame */
    handler *handle;
};

static struct refusal bad_length(const struct frame *request)
{
    return refused(PROTO_REFUSAL_REASON_BAD_LENGTH, (uint32_t)request->payload_length);
}

static struct refusal expect_empty(const struct frame *request)
{
    return request->payload_length == 0 ? accepted() : bad_length(request);
}

static uint8_t clock_source_of(const struct hal_identity *identity)
{
    enum { RC_OSCILLATOR_HZ = 16000000 };
    if (!identity->clock_fallback) {
        return PROTO_CLOCK_SOURCE_CRYSTAL_PLL;
    }
    return identity->cpu_hz > RC_OSCILLATOR_HZ ? PROTO_CLOCK_SOURCE_INTERNAL_PLL
                                               : PROTO_CLOCK_SOURCE_INTERNAL;
}

/* The first 6 bytes of a hello never change; a later version may send more. */
static struct refusal answer_hello(struct controller *controller, const struct frame *request,
                                   struct reply *reply)
{
    if (request->payload_length < PROTO_HELLO_REQUEST_SIZE) {
        return bad_length(request);
    }
    /* A hello means that the host has restarted: its sequence numbers may repeat earlier ones. */
    controller->cache[controller->port].valid = false;
    controller->update.greeted = true; /* this image can be spoken to: enough to keep it */
    const struct hal_identity *const identity = &controller->identity;
    struct proto_hello_reply out = {
        .protocol_version = PROTO_VERSION,
        .schema_hash = PROTO_SCHEMA_HASH,
        .boot_id = identity->boot_id,
        .firmware_version = TRUING_FIRMWARE_VERSION,
        .board_name = TRUING_BOARD_NAME,
        .tick_hz = CONTROLLER_TICK_HZ,
        .max_payload = PROTO_MAX_PAYLOAD,
        .max_segments = PROTO_MAX_SEGMENTS,
        .parameter_count = PROTO_PARAMETER_COUNT,
        .log_cell_size = PROTO_LOG_CELL_SIZE,
        .log_cell_count = (uint16_t)controller->robot.log.cells,
        .reset_cause = boot_reset_cause(identity),
        .clock_source = clock_source_of(identity),
    };
    memcpy(out.board_id, identity->board_id, sizeof out.board_id);
    reply->length = proto_hello_reply_encode(&out, reply->bytes, reply->capacity);
    return accepted();
}

static struct refusal answer_status(struct controller *controller, const struct frame *request,
                                    struct reply *reply)
{
    struct proto_status_reply out;
    robot_status(&controller->robot, &out);
    out.frames_dropped = controller->link.decoder.dropped + controller->can.dropped;
    reply->length = proto_status_reply_encode(&out, reply->bytes, reply->capacity);
    return expect_empty(request);
}

static struct refusal answer_clear_faults(struct controller *controller, const struct frame *request,
                                          struct reply *reply)
{
    (void)reply;
    const struct refusal verdict = expect_empty(request);
    return verdict.reason != REFUSAL_NONE ? verdict : robot_clear_faults(&controller->robot);
}

static struct refusal answer_fault_record(struct controller *controller, const struct frame *request,
                                          struct reply *reply)
{
    (void)controller;
    struct hal_fault_record record;
    struct proto_fault_record_reply out = {0};
    if (hal_fault_record(&record)) {
        out = (struct proto_fault_record_reply){
            .present = 1,
            .exception = (uint8_t)record.exception,
            .has_frame = record.has_frame != 0,
            .count = record.count,
            .r0 = record.r0,
            .r1 = record.r1,
            .r2 = record.r2,
            .r3 = record.r3,
            .r12 = record.r12,
            .lr = record.lr,
            .pc = record.pc,
            .xpsr = record.xpsr,
            .cfsr = record.cfsr,
            .hfsr = record.hfsr,
            .mmfar = record.mmfar,
            .bfar = record.bfar,
        };
    }
    reply->length = proto_fault_record_reply_encode(&out, reply->bytes, reply->capacity);
    return expect_empty(request);
}

static struct refusal answer_time(struct controller *controller, const struct frame *request,
                                  struct reply *reply)
{
    struct proto_time_request in;
    struct proto_time_reply out;
    if (!proto_time_request_decode(&in, request->payload, request->payload_length)) {
        return bad_length(request);
    }
    robot_time(&controller->robot, &out);
    reply->length = proto_time_reply_encode(&out, reply->bytes, reply->capacity);
    return accepted();
}

static struct refusal answer_param_list(struct controller *controller, const struct frame *request,
                                        struct reply *reply)
{
    return requests_param_list(&controller->robot, request, reply);
}

static struct refusal answer_param_get(struct controller *controller, const struct frame *request,
                                       struct reply *reply)
{
    return requests_param_get(&controller->robot, request, reply);
}

static struct refusal answer_param_set(struct controller *controller, const struct frame *request,
                                       struct reply *reply)
{
    return requests_param_set(&controller->robot, request, reply);
}

static struct refusal answer_param_save(struct controller *controller, const struct frame *request,
                                        struct reply *reply)
{
    return requests_param_save(&controller->robot, request, reply);
}

static struct refusal answer_param_load(struct controller *controller, const struct frame *request,
                                        struct reply *reply)
{
    return requests_param_load(&controller->robot, request, reply);
}

static struct refusal answer_param_defaults(struct controller *controller, const struct frame *request,
                                            struct reply *reply)
{
    (void)reply;
    return requests_param_defaults(&controller->robot, request);
}

static struct refusal answer_param_store(struct controller *controller, const struct frame *request,
                                         struct reply *reply)
{
    return requests_param_store(&controller->robot, request, reply);
}

/* The tick reads the segments while a sequence runs; then they must not change. */
static struct refusal may_upload(const struct controller *controller)
{
    const uint8_t state = controller->robot.supervisor.state;
    return state == PROTO_STATE_SEQUENCE ? refused(PROTO_REFUSAL_REASON_WRONG_STATE, state) : accepted();
}

static struct refusal answer_seq_begin(struct controller *controller, const struct frame *request,
                                       struct reply *reply)
{
    (void)reply;
    struct proto_seq_begin_request in;
    if (!proto_seq_begin_request_decode(&in, request->payload, request->payload_length)) {
        return bad_length(request);
    }
    const struct refusal verdict = may_upload(controller);
    return verdict.reason != REFUSAL_NONE
               ? verdict
               : sequence_begin(&controller->robot.sequence, in.segment_count, in.log_rate_hz);
}

static struct refusal answer_seq_segments(struct controller *controller, const struct frame *request,
                                          struct reply *reply)
{
    (void)reply;
    struct proto_seq_segments_request in;
    if (!proto_seq_segments_request_decode(&in, request->payload, request->payload_length) ||
        in.segments_count == 0) {
        return bad_length(request);
    }
    const struct refusal verdict = may_upload(controller);
    return verdict.reason != REFUSAL_NONE
               ? verdict
               : sequence_append(&controller->robot.sequence, &controller->robot.tuning, in.first,
                                 in.segments, in.segments_count);
}

static struct refusal answer_seq_commit(struct controller *controller, const struct frame *request,
                                        struct reply *reply)
{
    struct proto_seq_commit_request in;
    if (!proto_seq_commit_request_decode(&in, request->payload, request->payload_length)) {
        return bad_length(request);
    }
    struct refusal verdict = may_upload(controller);
    if (verdict.reason == REFUSAL_NONE) {
        verdict = sequence_commit(&controller->robot.sequence, in.crc32);
    }
    if (verdict.reason == REFUSAL_NONE) {
        const struct proto_seq_commit_reply out = {.duration_ms = controller->robot.sequence.duration_ms};
        reply->length = proto_seq_commit_reply_encode(&out, reply->bytes, reply->capacity);
    }
    return verdict;
}

static struct refusal answer_seq_start(struct controller *controller, const struct frame *request,
                                       struct reply *reply)
{
    struct proto_seq_start_request in;
    struct proto_seq_start_reply out = {0};
    if (!proto_seq_start_request_decode(&in, request->payload, request->payload_length)) {
        return bad_length(request);
    }
    if (in.unattended > 1) {
        return refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    }
    const struct refusal verdict =
        robot_start_sequence(&controller->robot, in.crc32, in.unattended != 0, &out.log_id);
    if (verdict.reason == REFUSAL_NONE) {
        controller->sequence_port = controller->port;
        reply->length = proto_seq_start_reply_encode(&out, reply->bytes, reply->capacity);
    }
    return verdict;
}

static struct refusal answer_seq_abort(struct controller *controller, const struct frame *request,
                                       struct reply *reply)
{
    (void)reply;
    const struct refusal verdict = expect_empty(request);
    if (verdict.reason == REFUSAL_NONE) {
        robot_stop(&controller->robot);
        sequence_forget_upload(&controller->robot.sequence);
    }
    return verdict;
}

static struct refusal answer_seq_state(struct controller *controller, const struct frame *request,
                                       struct reply *reply)
{
    struct proto_seq_state_reply out;
    robot_sequence_state(&controller->robot, &out);
    reply->length = proto_seq_state_reply_encode(&out, reply->bytes, reply->capacity);
    return expect_empty(request);
}

static struct refusal answer_log_list(struct controller *controller, const struct frame *request,
                                      struct reply *reply)
{
    return requests_log_list(&controller->robot.log, request, reply);
}

static struct refusal answer_log_read(struct controller *controller, const struct frame *request,
                                      struct reply *reply)
{
    return requests_log_read(&controller->robot.log, request, reply);
}

static struct refusal answer_log_digest(struct controller *controller, const struct frame *request,
                                        struct reply *reply)
{
    return requests_log_digest(&controller->robot.log, request, reply);
}

static struct refusal answer_log_erase(struct controller *controller, const struct frame *request,
                                       struct reply *reply)
{
    (void)reply;
    const struct refusal verdict = expect_empty(request);
    if (verdict.reason != REFUSAL_NONE) {
        return verdict;
    }
    /* A log that was asked for but waits for its first tick counts as being written. */
    const bool free = !controller->robot.recorder.opening && log_erase(&controller->robot.log);
    return free ? accepted() : refused(PROTO_REFUSAL_REASON_LOG_BUSY, 0);
}

static struct refusal answer_log_arm(struct controller *controller, const struct frame *request,
                                     struct reply *reply)
{
    struct proto_log_arm_request in;
    struct proto_log_arm_reply out = {0};
    if (!proto_log_arm_request_decode(&in, request->payload, request->payload_length)) {
        return bad_length(request);
    }
    const struct refusal verdict = robot_arm_log(&controller->robot, &in, &out.log_id);
    reply->length = proto_log_arm_reply_encode(&out, reply->bytes, reply->capacity);
    return verdict;
}

static struct refusal answer_log_trigger(struct controller *controller, const struct frame *request,
                                         struct reply *reply)
{
    struct proto_log_trigger_reply out;
    robot_log_trigger(&controller->robot, &out);
    reply->length = proto_log_trigger_reply_encode(&out, reply->bytes, reply->capacity);
    return expect_empty(request);
}

static struct refusal answer_set_effort(struct controller *controller, const struct frame *request,
                                        struct reply *reply)
{
    (void)reply;
    struct proto_set_effort_request in;
    if (!proto_set_effort_request_decode(&in, request->payload, request->payload_length)) {
        return bad_length(request);
    }
    return robot_drive(&controller->robot, PROTO_SEGMENT_KIND_EFFORT, in.left, in.right);
}

static struct refusal answer_set_velocity(struct controller *controller, const struct frame *request,
                                          struct reply *reply)
{
    (void)reply;
    struct proto_set_velocity_request in;
    if (!proto_set_velocity_request_decode(&in, request->payload, request->payload_length)) {
        return bad_length(request);
    }
    return robot_drive(&controller->robot, PROTO_SEGMENT_KIND_VELOCITY, in.left, in.right);
}

static struct refusal answer_arm(struct controller *controller, const struct frame *request,
                                 struct reply *reply)
{
    (void)reply;
    struct proto_arm_request in;
    if (!proto_arm_request_decode(&in, request->payload, request->payload_length)) {
        return bad_length(request);
    }
    return update_is_under_way(&controller->update)
               ? refused(PROTO_REFUSAL_REASON_UPDATE_UNDER_WAY, controller->update.next)
               : robot_arm(&controller->robot, in.boot_id);
}

_Static_assert((int)HAL_CAN_OFF == (int)PROTO_CAN_BUS_STATE_OFF &&
                   (int)HAL_CAN_JOINING == (int)PROTO_CAN_BUS_STATE_JOINING &&
                   (int)HAL_CAN_ACTIVE == (int)PROTO_CAN_BUS_STATE_ACTIVE &&
                   (int)HAL_CAN_WARNING == (int)PROTO_CAN_BUS_STATE_WARNING &&
                   (int)HAL_CAN_PASSIVE == (int)PROTO_CAN_BUS_STATE_PASSIVE &&
                   (int)HAL_CAN_BUS_OFF == (int)PROTO_CAN_BUS_STATE_BUS_OFF &&
                   (int)HAL_CAN_NO_CRYSTAL == (int)PROTO_CAN_BUS_STATE_NO_CRYSTAL,
               "a report's state goes onto the wire as it is");

static struct refusal answer_can_state(struct controller *controller, const struct frame *request,
                                       struct reply *reply)
{
    const struct can_link *const can = &controller->can;
    struct hal_can_report report;
    hal_can_report(&report);
    const struct proto_can_state_reply out = {
        .node = can->node,
        .bus_state = report.state,
        .bitrate_kbps = (uint16_t)(can->bits_per_s / 1000u),
        .transmit_errors = report.transmit_errors,
        .receive_errors = report.receive_errors,
        .last_error = report.last_error,
        .bus_offs = report.bus_offs,
        .frames_sent = report.sent,
        .frames_received = report.received,
        .overruns = report.overruns,
        .discarded = report.discarded,
        .messages_dropped = can->dropped,
        .sequence_errors = can->channel.errors.sequence,
        .timeouts = can->channel.errors.timeouts,
    };
    reply->length = proto_can_state_reply_encode(&out, reply->bytes, reply->capacity);
    return expect_empty(request);
}

static struct refusal answer_stream_start(struct controller *controller, const struct frame *request,
                                          struct reply *reply)
{
    struct telemetry *const telemetry = &controller->robot.telemetry;
    struct proto_stream_start_request in;
    if (!proto_stream_start_request_decode(&in, request->payload, request->payload_length)) {
        return bad_length(request);
    }
    const struct refusal verdict = telemetry_start(telemetry, in.signals, in.rate_hz);
    const struct proto_stream_start_reply out = {
        .stream_id = telemetry->stream_id,
        .capacity = (uint16_t)telemetry->capacity,
    };
    reply->length = proto_stream_start_reply_encode(&out, reply->bytes, reply->capacity);
    return verdict;
}

static struct refusal answer_stream_read(struct controller *controller, const struct frame *request,
                                         struct reply *reply)
{
    const struct telemetry *const telemetry = &controller->robot.telemetry;
    struct proto_stream_read_request in;
    if (!proto_stream_read_request_decode(&in, request->payload, request->payload_length)) {
        return bad_length(request);
    }
    struct proto_stream_read_reply out = {.stream_id = telemetry->stream_id, .first = in.first};
    /* Samples are written straight into the reply, behind the place of its fixed part. */
    const size_t length =
        telemetry_read(telemetry, &out.first, in.most, reply->bytes + PROTO_STREAM_READ_REPLY_SIZE,
                       reply->capacity - PROTO_STREAM_READ_REPLY_SIZE);
    out.end = telemetry->end;
    reply->length = proto_stream_read_reply_encode(&out, reply->bytes, reply->capacity) + length;
    return accepted();
}

static struct refusal answer_update_state(struct controller *controller, const struct frame *request,
                                          struct reply *reply)
{
    return requests_update_state(&controller->update, &controller->robot, request, reply);
}

static struct refusal answer_update_begin(struct controller *controller, const struct frame *request,
                                          struct reply *reply)
{
    return requests_update_begin(&controller->update, &controller->robot, request, reply);
}

static struct refusal answer_update_data(struct controller *controller, const struct frame *request,
                                         struct reply *reply)
{
    return requests_update_data(&controller->update, controller->robot.now_ms, request, reply);
}

static struct refusal answer_update_finish(struct controller *controller, const struct frame *request,
                                           struct reply *reply)
{
    return requests_update_finish(&controller->update, request, reply);
}

static struct refusal answer_restart(struct controller *controller, const struct frame *request,
                                     struct reply *reply)
{
    (void)reply;
    return requests_restart(&controller->update, &controller->robot, request);
}

/* The dispatcher has already executed the stop, whatever its payload and however often it is repeated. */
static struct refusal answer_stop(struct controller *controller, const struct frame *request,
                                  struct reply *reply)
{
    (void)controller;
    (void)request;
    (void)reply;
    return accepted();
}

static const struct entry entries[] = {
    {PROTO_ID_HELLO, false, answer_hello},
    {PROTO_ID_STATUS, false, answer_status},
    {PROTO_ID_CLEAR_FAULTS, false, answer_clear_faults},
    {PROTO_ID_FAULT_RECORD, false, answer_fault_record},
    {PROTO_ID_TIME, false, answer_time},
    {PROTO_ID_PARAM_LIST, false, answer_param_list},
    {PROTO_ID_PARAM_GET, false, answer_param_get},
    {PROTO_ID_PARAM_SET, false, answer_param_set},
    {PROTO_ID_PARAM_SAVE, false, answer_param_save},
    {PROTO_ID_PARAM_LOAD, false, answer_param_load},
    {PROTO_ID_PARAM_DEFAULTS, false, answer_param_defaults},
    {PROTO_ID_PARAM_STORE, false, answer_param_store},
    {PROTO_ID_SEQ_BEGIN, false, answer_seq_begin},
    {PROTO_ID_SEQ_SEGMENTS, false, answer_seq_segments},
    {PROTO_ID_SEQ_COMMIT, false, answer_seq_commit},
    {PROTO_ID_SEQ_START, false, answer_seq_start},
    {PROTO_ID_SEQ_ABORT, false, answer_seq_abort},
    {PROTO_ID_SEQ_STATE, false, answer_seq_state},
    {PROTO_ID_LOG_LIST, true, answer_log_list},
    {PROTO_ID_LOG_READ, true, answer_log_read},
    {PROTO_ID_LOG_DIGEST, false, answer_log_digest},
    {PROTO_ID_LOG_ERASE, false, answer_log_erase},
    {PROTO_ID_LOG_ARM, false, answer_log_arm},
    {PROTO_ID_LOG_TRIGGER, false, answer_log_trigger},
    {PROTO_ID_SET_EFFORT, false, answer_set_effort},
    {PROTO_ID_SET_VELOCITY, false, answer_set_velocity},
    {PROTO_ID_STOP, false, answer_stop},
    {PROTO_ID_ARM, false, answer_arm},
    {PROTO_ID_CAN_STATE, false, answer_can_state},
    {PROTO_ID_STREAM_START, false, answer_stream_start},
    {PROTO_ID_STREAM_READ, true, answer_stream_read},
    {PROTO_ID_UPDATE_STATE, true, answer_update_state},
    {PROTO_ID_UPDATE_BEGIN, false, answer_update_begin},
    {PROTO_ID_UPDATE_DATA, false, answer_update_data},
    {PROTO_ID_UPDATE_FINISH, false, answer_update_finish},
    {PROTO_ID_RESTART, false, answer_restart},
};

_Static_assert(PROTO_PARAM_LIST_REPLY_SIZE <= PROTO_HELLO_REPLY_SIZE, "a hello is the longest short reply");
_Static_assert(PROTO_HELLO_REPLY_SIZE + FRAME_MAX_CODED - PROTO_MAX_PAYLOAD + 1 <= LINK_SMALL_FRAME,
               "the longest short reply fits the room that is asked for");

static const struct entry *find(uint8_t id)
{
    for (size_t i = 0; i < sizeof entries / sizeof entries[0]; i++) {
        if (entries[i].id == id) {
            return &entries[i];
        }
    }
    return NULL;
}

/* Room is always left for one more short reply: a stop is executed and answered on a busy line. */
static bool has_room(const struct controller *controller, const struct entry *entry)
{
    const size_t size = entry != NULL && entry->bulk ? LINK_LARGEST_FRAME : LINK_SMALL_FRAME;
    const bool stop = entry != NULL && entry->id == PROTO_ID_STOP;
    const size_t room = stop ? size : size + LINK_SMALL_FRAME;
    return controller->port == PORT_CAN ? can_link_has_room(&controller->can, room)
                                        : link_has_room(&controller->link, room);
}

static void send(struct controller *controller, uint8_t id, uint16_t sequence, const uint8_t *payload,
                 size_t length)
{
    if (controller->port == PORT_CAN) {
        can_link_send(&controller->can, id, sequence, payload, length);
    } else {
        link_send(&controller->link, id, sequence, payload, length);
    }
}

static bool is_repeated(const struct reply_cache *cache, const struct frame *request)
{
    return cache->valid && cache->request_id == request->id && cache->sequence == request->sequence &&
           cache->crc == request->crc;
}

static void remember(struct reply_cache *cache, const struct frame *request, uint8_t reply_id,
                     const struct reply *reply)
{
    cache->valid = reply->length <= sizeof cache->reply;
    if (cache->valid) {
        cache->request_id = request->id;
        cache->sequence = request->sequence;
        cache->crc = request->crc;
        cache->reply_id = reply_id;
        cache->length = (uint8_t)reply->length;
        memcpy(cache->reply, reply->bytes, reply->length);
    }
}

void requests_answer(struct controller *controller, enum controller_port port, const struct frame *request)
{
    struct reply_cache *const cache = &controller->cache[port];
    controller->port = (uint8_t)port;
    /* Replies of another board, or echoes of our own: answering them would loop for ever. */
    if ((request->id & PROTO_REPLY_BIT) != 0) {
        return;
    }
    const struct entry *const entry = find(request->id);
    if (request->id == PROTO_ID_STOP) {
        robot_stop(&controller->robot);
    }
    if (port == controller->sequence_port) { /* another host's questions do not replace the one that drives */
        robot_hear_host(&controller->robot);
    }
    if (!has_room(controller, entry)) {
        return;
    }
    if (is_repeated(cache, request)) {
        send(controller, cache->reply_id, request->sequence, cache->reply, cache->length);
        return;
    }

    struct reply reply = {.bytes = controller->reply, .capacity = sizeof controller->reply, .length = 0};
    const struct refusal verdict = entry != NULL ? entry->handle(controller, request, &reply)
                                                 : refused(PROTO_REFUSAL_REASON_UNKNOWN_REQUEST, request->id);
    uint8_t reply_id = (uint8_t)(request->id | PROTO_REPLY_BIT);
    if (verdict.reason != REFUSAL_NONE) {
        const struct proto_refusal out = {
            .request_id = request->id,
            .reason = verdict.reason,
            .detail = verdict.detail,
        };
        reply_id = PROTO_ID_REFUSAL;
        reply.length = proto_refusal_encode(&out, reply.bytes, reply.capacity);
    }
    if (proto_id_changes(request->id)) {
        remember(cache, request, reply_id, &reply);
    }
    send(controller, reply_id, request->sequence, reply.bytes, reply.length);
}
