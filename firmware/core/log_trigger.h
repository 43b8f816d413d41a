/* The trigger of an armed log: a signal that crosses a level, or a fault that latches.
 *
 * Armed, the recorder writes a log all the while, of which log.h keeps the last `before_ms`. The trigger
 * keeps that, and ends the log `after_ms` later. Everything here but the check is called with the tick held
 * off, or from it. */
#ifndef LOG_TRIGGER_H
#define LOG_TRIGGER_H

#include <stdbool.h>
#include <stdint.h>

#include "proto.h"
#include "refusal.h"

/* Memory budget of a record: over twice what the records of a noisy drive need. A drive that needs more loses
 * the beginning of its own log. */
enum { LOG_TRIGGER_RECORD_BYTES = 16 };

struct log_trigger {
    struct proto_log_trigger_reply report; /* as the host reads it: state, what is armed, the outcome */
    bool ready;                            /* the signal has been seen on the near side of the level */
    uint32_t after_ms;                     /* since it fired */
};

/* Inputs of the trigger at a tick. */
struct log_trigger_moment {
    uint32_t now_ms;         /* device time */
    uint32_t t_ms;           /* of the log */
    int32_t value;           /* of the signal that is watched */
    uint32_t latched_faults; /* 0 unless one has latched at this tick */
};

enum log_trigger_event { LOG_TRIGGER_WAITS, LOG_TRIGGER_FIRES, LOG_TRIGGER_ENDS };

void log_trigger_init(struct log_trigger *trigger);

/* Checks a trigger for a log at this rate in so much memory. */
struct refusal log_trigger_check(const struct proto_log_arm_request *wanted, uint16_t rate_hz,
                                 uint32_t memory_size);

void log_trigger_arm(struct log_trigger *trigger, const struct proto_log_arm_request *wanted,
                     uint16_t log_id);

/* Ends what is under way. The log that a trigger was for stays known until the next call. */
void log_trigger_disarm(struct log_trigger *trigger);

/* A log is being written for this trigger. */
bool log_trigger_is_on(const struct log_trigger *trigger);

/* The tick has to work out the value of the signal. */
bool log_trigger_watches(const struct log_trigger *trigger);

/* One tick of an open log. */
enum log_trigger_event log_trigger_step(struct log_trigger *trigger, const struct log_trigger_moment *moment);

#endif
