/* The trigger of an armed log: a signal that crosses a level, or a fault that latches. */
#include "log_trigger.h"

/* Positions of the request's fields, as refusals report them. */
enum { FIELD_KIND, FIELD_SIGNAL, FIELD_EDGE, FIELD_BEFORE = 4, FIELD_AFTER };

enum { MS_PER_S = 1000 };

void log_trigger_init(struct log_trigger *trigger)
{
    *trigger = (struct log_trigger){.report = {.state = PROTO_LOG_TRIGGER_STATE_IDLE}};
}

/* A set of bits crosses no level, and a command's unit changes with the mode. */
static bool has_level(uint8_t signal)
{
    return signal <= (uint8_t)PROTO_SIGNAL_BATTERY && signal != (uint8_t)PROTO_SIGNAL_FAULTS &&
           signal != (uint8_t)PROTO_SIGNAL_CMD_LEFT && signal != (uint8_t)PROTO_SIGNAL_CMD_RIGHT;
}

struct refusal log_trigger_check(const struct proto_log_arm_request *wanted, uint16_t rate_hz,
                                 uint32_t memory_size)
{
    const uint32_t max_records = memory_size / (uint32_t)LOG_TRIGGER_RECORD_BYTES;
    const uint32_t max_ms = max_records * (uint32_t)MS_PER_S / rate_hz;
    struct refusal verdict = accepted();
    if (wanted->kind != (uint8_t)PROTO_LOG_TRIGGER_KIND_THRESHOLD &&
        wanted->kind != (uint8_t)PROTO_LOG_TRIGGER_KIND_FAULT) {
        verdict = refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, FIELD_KIND);
    } else if (wanted->kind == (uint8_t)PROTO_LOG_TRIGGER_KIND_THRESHOLD && !has_level(wanted->signal)) {
        verdict = refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, FIELD_SIGNAL);
    } else if (wanted->edge > (uint8_t)PROTO_LOG_EDGE_BELOW) {
        verdict = refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, FIELD_EDGE);
    } else if (wanted->before_ms > max_ms) {
        verdict = refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, FIELD_BEFORE);
    } else if (wanted->after_ms > max_ms - wanted->before_ms) {
        verdict = refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, FIELD_AFTER);
    } else {
        /* It does. */
    }
    return verdict;
}

void log_trigger_arm(struct log_trigger *trigger, const struct proto_log_arm_request *wanted, uint16_t log_id)
{
    *trigger = (struct log_trigger){
        .report =
            {
                .state = PROTO_LOG_TRIGGER_STATE_ARMED,
                .kind = wanted->kind,
                .signal = wanted->signal,
                .edge = wanted->edge,
                .level = wanted->level,
                .before_ms = wanted->before_ms,
                .after_ms = wanted->after_ms,
                .log_id = log_id,
            },
    };
}

void log_trigger_disarm(struct log_trigger *trigger)
{
    if (trigger->report.state == (uint8_t)PROTO_LOG_TRIGGER_STATE_FIRED) {
        trigger->report.state = PROTO_LOG_TRIGGER_STATE_DONE;
    } else {
        log_trigger_init(trigger);
    }
}

bool log_trigger_is_on(const struct log_trigger *trigger)
{
    return trigger->report.state == (uint8_t)PROTO_LOG_TRIGGER_STATE_ARMED ||
           trigger->report.state == (uint8_t)PROTO_LOG_TRIGGER_STATE_FIRED;
}

bool log_trigger_watches(const struct log_trigger *trigger)
{
    return trigger->report.state == (uint8_t)PROTO_LOG_TRIGGER_STATE_ARMED &&
           trigger->report.kind == (uint8_t)PROTO_LOG_TRIGGER_KIND_THRESHOLD;
}

/* Whether the signal has crossed the level since it was last seen on the near side of it. */
static bool crosses(struct log_trigger *trigger, int32_t value)
{
    const int32_t level = trigger->report.level;
    const bool beyond = trigger->report.edge == (uint8_t)PROTO_LOG_EDGE_ABOVE ? value > level : value < level;
    const bool crossed = beyond && trigger->ready;
    trigger->ready = trigger->ready || !beyond;
    return crossed;
}

enum log_trigger_event log_trigger_step(struct log_trigger *trigger, const struct log_trigger_moment *moment)
{
    enum log_trigger_event event = LOG_TRIGGER_WAITS;
    struct proto_log_trigger_reply *const report = &trigger->report;
    if (report->state == (uint8_t)PROTO_LOG_TRIGGER_STATE_FIRED) {
        trigger->after_ms++;
        if (trigger->after_ms >= report->after_ms) {
            report->state = PROTO_LOG_TRIGGER_STATE_DONE;
            event = LOG_TRIGGER_ENDS;
        }
    } else if (report->state == (uint8_t)PROTO_LOG_TRIGGER_STATE_ARMED) {
        const bool is_fault = report->kind == (uint8_t)PROTO_LOG_TRIGGER_KIND_FAULT;
        const bool fires = is_fault ? moment->latched_faults != 0u : crosses(trigger, moment->value);
        if (fires) {
            report->state = PROTO_LOG_TRIGGER_STATE_FIRED;
            report->fired_ms = moment->now_ms;
            report->fired_t_ms = moment->t_ms;
            report->value = is_fault ? 0 : moment->value;
            report->faults = is_fault ? moment->latched_faults : 0u;
            event = LOG_TRIGGER_FIRES;
        }
    } else {
        /* Logs belong to drives. */
    }
    return event;
}
