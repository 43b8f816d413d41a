/* The robot as the control tick drives it: senses, odometry, drive, sequence, recorder and supervisor
 * together.
 *
 * robot_tick runs in the tick interrupt. All other functions are called from the main loop, and hold
 * interrupts off for the few microseconds in which they change what the tick uses. */
#ifndef ROBOT_H
#define ROBOT_H

#include <stdbool.h>
#include <stdint.h>

#include "drive.h"
#include "hal.h"
#include "log.h"
#include "log_feed.h"
#include "log_trigger.h"
#include "odometry.h"
#include "parameter_store.h"
#include "parameters.h"
#include "recorder.h"
#include "refusal.h"
#include "sequence.h"
#include "supervisor.h"
#include "telemetry.h"
#include "tuning.h"
#include "wheel_speed.h"
#include "wheel_watch.h"

struct robot {
    struct parameters parameters;
    struct parameter_store store;
    struct tuning tuning;
    struct hal_sample sample;   /* of this tick */
    int32_t counts[HAL_WHEELS]; /* forward positive, since start-up, wrapping */
    struct wheel_speed wheels[HAL_WHEELS];
    struct wheel_watch watches[HAL_WHEELS];
    struct wheel_measure speed[HAL_WHEELS]; /* what velocity mode holds */
    struct odometry odometry;
    struct drive drive;
    struct sequence sequence;
    struct recorder recorder;
    struct supervisor supervisor;
    struct supervisor_view view; /* of this tick */
    volatile uint32_t now_ms;
    bool speeds_stale;    /* ticks were missed: the counts since the last one say nothing of a speed */
    struct log_feed feed; /* from the tick to the log */
    struct log log;
    struct log_trigger trigger;
    struct telemetry telemetry;
};

/* `boot_faults`: what the start brings along, see boot.h. */
void robot_init(struct robot *robot, uint32_t boot_faults);
void robot_tick(struct robot *robot);

/* From the main loop: codes the records that wait. */
void robot_write_log(struct robot *robot);

/* From the main loop: goes on checking the running sequence against its CRC, one segment a call. */
void robot_audit(struct robot *robot);

/* Brakes both wheels now; ends a sequence or a live drive, and its log. A latched fault stays latched. */
void robot_stop(struct robot *robot);

/* Drives the wheels under the host's hand: `kind` effort or velocity. */
struct refusal robot_drive(struct robot *robot, uint8_t kind, float left, float right);

struct refusal robot_start_sequence(struct robot *robot, uint32_t crc, uint16_t *log_id);

/* Arms a log, or disarms it: kind sequence. */
struct refusal robot_arm_log(struct robot *robot, const struct proto_log_arm_request *wanted,
                             uint16_t *log_id);

struct refusal robot_clear_faults(struct robot *robot);

/* Moves device time on by control ticks that did not come while the core stood still. */
void robot_make_up(struct robot *robot, uint32_t missed_ticks);

/* A state of the robot that belongs to one moment. */
void robot_status(const struct robot *robot, struct proto_status_reply *out);
void robot_time(const struct robot *robot, struct proto_time_reply *out);
void robot_log_trigger(const struct robot *robot, struct proto_log_trigger_reply *out);
void robot_sequence_state(const struct robot *robot, struct proto_seq_state_reply *out);

#endif
