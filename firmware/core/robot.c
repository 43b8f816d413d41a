/* The robot as the control tick drives it: senses, odometry, drive, sequence, recorder and supervisor
 * together. */
#include "robot.h"

#include <string.h>

#include "proto.h"
#include "robot_parameters.h"
#include "rounding.h"

/* From one tick's sample to the next, microseconds: more than any interrupt delays a tick by, less than two.
 */
enum { LATE_US = 1500 };

void robot_init(struct robot *robot, uint32_t boot_id, uint32_t boot_faults)
{
    robot->boot_id = boot_id;
    hal_sense(&robot->sample);
    for (int wheel = 0; wheel < HAL_WHEELS; wheel++) {
        robot->counts[wheel] = 0;
        wheel_speed_init(&robot->wheels[wheel], 0);
        wheel_watch_init(&robot->watches[wheel], 0);
        robot->heat[wheel] = (struct motor_heat){0};
        robot->speed[wheel] = (struct wheel_measure){0};
    }
    robot->odometry = (struct odometry){0};
    drive_init(&robot->drive);
    memset(&robot->sequence, 0, sizeof robot->sequence); /* state EMPTY is 0 */
    recorder_init(&robot->recorder);
    supervisor_init(&robot->supervisor, boot_faults);
    robot_start_parameters(robot);
    robot->view = (struct supervisor_view){
        .still = {true, true},
        .battery_mv = robot->sample.battery_mv,
        .battery_valid = robot->sample.battery_valid,
    };
    robot->now_ms = 0;
    robot->stop_heard = false;
    robot->speeds_stale = true; /* the age of this sample is unknown */
    log_feed_init(&robot->feed);
    log_init(&robot->log);
    telemetry_init(&robot->telemetry);
    log_trigger_init(&robot->trigger);
}

/* Counts from `then` to `now`, forward positive. */
static int32_t forward(const struct robot *robot, int wheel, int32_t now, int32_t then)
{
    return robot->tuning.encoder_reversed[wheel] ? wrapped_difference(then, now)
                                                 : wrapped_difference(now, then);
}

/* Of the effort that was applied up to now. */
static void warm(struct robot *robot, int wheel)
{
    const float effort = 1e-4f * (float)robot->drive.applied_e4[wheel];
    const float supply_v = 0.001f * (float)robot->sample.battery_mv;
    motor_heat_step(&robot->heat[wheel], &robot->tuning.thermal, effort, supply_v, robot->speed[wheel].mps);
    robot->view.hot[wheel] = robot->heat[wheel].hot;
}

/* Counts, speeds and pose of this tick. */
static void sense(struct robot *robot)
{
    const struct hal_sample before = robot->sample;
    int32_t moved[HAL_WHEELS];
    bool finite = tuning_is_finite(&robot->tuning) && !robot->drive.not_finite;
    hal_sense(&robot->sample);
    if (!robot->speeds_stale && robot->sample.now_us - before.now_us > LATE_US) {
        robot->supervisor.overrun = true; /* this tick was delayed so long that one was missed */
    }
    for (int wheel = 0; wheel < HAL_WHEELS; wheel++) {
        const int32_t now = robot->sample.counts[wheel];
        const int32_t then = before.counts[wheel];
        moved[wheel] = forward(robot, wheel, now, then);
        robot->counts[wheel] = wrapped_sum(robot->counts[wheel], moved[wheel]);
        if (robot->speeds_stale) {
            wheel_speed_init(&robot->wheels[wheel], robot->counts[wheel]);
            wheel_watch_init(&robot->watches[wheel], robot->counts[wheel]);
        }
        const int32_t since_edge = forward(robot, wheel, now, robot->sample.edge_from[wheel]);
        const struct wheel_motion motion = {
            .counts = robot->counts[wheel],
            .now_us = robot->sample.now_us,
            .edge_dated = robot->sample.edge_dated[wheel],
            .edge_us = robot->sample.edge_us[wheel],
            .edge_from = wrapped_difference(robot->counts[wheel], since_edge),
        };
        wheel_speed_step(&robot->wheels[wheel], &motion);
        const float metres = robot->tuning.metres_per_count;
        robot->speed[wheel] = robot->tuning.speed_from_edges
                                  ? wheel_speed_from_edges(&robot->wheels[wheel], metres)
                                  : wheel_speed_from_counts(&robot->wheels[wheel], metres);
        robot->view.speed_mps[wheel] = wheel_speed_window_mps(&robot->wheels[wheel], metres);
        robot->view.still[wheel] = wheel_speed_is_still(&robot->wheels[wheel]);
        finite = finite && wheel_watch_is_finite(&robot->watches[wheel]); /* before the step mends it */
        wheel_watch_step(&robot->watches[wheel], &robot->tuning, wheel, robot->counts[wheel],
                         robot->drive.applied_e4, robot->speed[wheel].mps);
        robot->view.lost[wheel] = robot->watches[wheel].lost;
        robot->view.reversed[wheel] = robot->watches[wheel].reversed;
        robot->view.stalled[wheel] = robot->watches[wheel].stalled;
        finite = finite && is_finite(robot->view.speed_mps[wheel] + robot->speed[wheel].mps +
                                     robot->heat[wheel].heat_a2);
        warm(robot, wheel);
    }
    robot->supervisor.not_finite = !finite;
    robot->speeds_stale = false;
    odometry_step(&robot->odometry, &robot->tuning.geometry, moved[0], moved[1]);
    robot->view.battery_mv = robot->sample.battery_mv;
    robot->view.battery_valid = robot->sample.battery_valid;
    robot->view.supply_dip = robot->sample.supply_dip;
    robot->view.emergency_stop = robot->sample.emergency_stop;
}

/* Mode and command of a record: those in force up to now. */
static void view_command(const struct robot *robot, struct recorder_view *view)
{
    view->record.mode = robot->drive.mode;
    view->record.segment =
        robot->supervisor.state == PROTO_STATE_SEQUENCE ? robot->sequence.current : (uint16_t)0;
    view->record.cmd_left = drive_logged_command(&robot->drive, 0);
    view->record.cmd_right = drive_logged_command(&robot->drive, 1);
}

static int16_t speed_mmps(const struct robot *robot, int wheel)
{
    return (int16_t)round_to_i32(clampf(robot->view.speed_mps[wheel] * 1000.0f, -32768.0f, 32767.0f));
}

static void view_sensors(const struct robot *robot, struct recorder_view *view)
{
    view->now_ms = robot->now_ms;
    view->geometry = (struct log_geometry){
        .metres_per_count = robot->tuning.metres_per_count,
        .turns_per_count = robot->tuning.geometry.turns_per_count,
    };
    for (int wheel = 0; wheel < HAL_WHEELS; wheel++) {
        view->counts[wheel] = robot->counts[wheel];
    }
    view->record.faults = robot->supervisor.active | robot->supervisor.latched;
    view->record.x_mm = odometry_x_mm(&robot->odometry);
    view->record.y_mm = odometry_y_mm(&robot->odometry);
    view->record.theta_e4 = odometry_theta_e4(&robot->odometry);
    view->record.battery_10mv =
        (uint16_t)(robot->sample.battery_valid ? (robot->sample.battery_mv + 5u) / 10u : 0u);
}

static void command_segment(struct robot *robot)
{
    const struct wheel_command command = sequence_command(&robot->sequence, &robot->tuning);
    drive_command(&robot->drive, command.mode, command.left, command.right);
}

static void step_sequence(struct robot *robot)
{
    switch (sequence_step(&robot->sequence)) {
    case SEQUENCE_NEXT_SEGMENT:
        command_segment(robot);
        break;
    case SEQUENCE_FINISHED:
        drive_command(&robot->drive, PROTO_MODE_IDLE, 0.0f, 0.0f);
        robot->supervisor.state = PROTO_STATE_IDLE;
        recorder_finish(&robot->recorder, PROTO_LOG_END_FINISHED);
        break;
    case SEQUENCE_GOES_ON:
    default:
        break;
    }
}

/* Instantaneous values, where a record has means. */
static void signal_values(const struct robot *robot, int32_t values[TELEMETRY_SIGNALS])
{
    struct recorder_view view = {0};
    view_command(robot, &view);
    view_sensors(robot, &view);
    values[PROTO_SIGNAL_MODE] = view.record.mode;
    values[PROTO_SIGNAL_FAULTS] = (int32_t)view.record.faults;
    values[PROTO_SIGNAL_CMD_LEFT] = view.record.cmd_left;
    values[PROTO_SIGNAL_CMD_RIGHT] = view.record.cmd_right;
    for (int wheel = 0; wheel < HAL_WHEELS; wheel++) {
        values[PROTO_SIGNAL_EFFORT_LEFT + wheel] = robot->drive.applied_e4[wheel];
        values[PROTO_SIGNAL_COUNTS_LEFT + wheel] = robot->counts[wheel];
        values[PROTO_SIGNAL_SPEED_LEFT + wheel] = speed_mmps(robot, wheel);
    }
    values[PROTO_SIGNAL_X] = view.record.x_mm;
    values[PROTO_SIGNAL_Y] = view.record.y_mm;
    values[PROTO_SIGNAL_THETA] = view.record.theta_e4;
    values[PROTO_SIGNAL_BATTERY] = view.record.battery_10mv;
}

static void stream_sample(struct robot *robot)
{
    int32_t values[TELEMETRY_SIGNALS];
    signal_values(robot, values);
    telemetry_take(&robot->telemetry, robot->now_ms, values);
}

/* `stopped`: a fault has latched at this tick. */
static void step_trigger(struct robot *robot, bool stopped)
{
    struct log_trigger_moment moment = {
        .now_ms = robot->now_ms,
        .t_ms = robot->recorder.elapsed_ms,
        .latched_faults = stopped ? robot->supervisor.latched : 0u,
    };
    if (log_trigger_watches(&robot->trigger)) {
        int32_t values[TELEMETRY_SIGNALS];
        signal_values(robot, values);
        moment.value = values[robot->trigger.report.signal];
    }
    switch (log_trigger_step(&robot->trigger, &moment)) {
    case LOG_TRIGGER_FIRES:
        log_feed_fire(&robot->feed, moment.t_ms);
        break;
    case LOG_TRIGGER_ENDS:
        recorder_finish_armed(&robot->recorder, PROTO_LOG_END_TRIGGERED);
        break;
    case LOG_TRIGGER_WAITS:
    default:
        break;
    }
}

static void end_drive(struct robot *robot)
{
    drive_brake(&robot->drive);
    sequence_abort(&robot->sequence);
    recorder_finish(&robot->recorder, PROTO_LOG_END_STOPPED);
    if (supervisor_is_moving(&robot->supervisor)) {
        robot->supervisor.state = PROTO_STATE_IDLE;
    }
}

void robot_tick(struct robot *robot)
{
    struct recorder_view view = {0};
    robot->now_ms = robot->now_ms + 1u;
    sense(robot);
    recorder_pass(&robot->recorder, robot->drive.applied_e4);
    const bool start = robot->recorder.opening; /* this tick is time zero of a drive */
    view_command(robot, &view);                 /* before the sequence goes on to its next segment */

    const bool stopped = supervisor_step(&robot->supervisor, &robot->tuning, &robot->view);
    if (stopped) {
        drive_brake(&robot->drive);
        sequence_abort(&robot->sequence);
        recorder_finish(&robot->recorder, PROTO_LOG_END_FAULT);
    } else if (robot->stop_heard && supervisor_is_moving(&robot->supervisor)) {
        end_drive(robot);
    } else if (robot->supervisor.state == PROTO_STATE_SEQUENCE && !start) {
        step_sequence(robot);
    }

    if (!start) { /* a trigger needs an open log */
        step_trigger(robot, stopped);
    }
    if (recorder_due(&robot->recorder)) {
        view_sensors(robot, &view);
        recorder_write(&robot->recorder, &robot->feed, &view);
    }
    if (start) {
        robot->odometry = (struct odometry){0};
        view_sensors(robot, &view);
        recorder_open(&robot->recorder, &robot->feed, &view);
    }
    drive_step(&robot->drive, &robot->tuning, robot->speed, robot->view.still);
    if (telemetry_due(&robot->telemetry)) {
        stream_sample(robot);
    }
}

void robot_stop(struct robot *robot)
{
    const uint32_t state = hal_critical_enter();
    end_drive(robot);
    hal_critical_exit(state);
}

/* Whether a motion may begin, from idle. */
static struct refusal may_begin(const struct robot *robot, bool from_rest)
{
    if (robot->supervisor.state == PROTO_STATE_STOPPED) {
        return refused(PROTO_REFUSAL_REASON_FAULT_LATCHED, robot->supervisor.latched);
    }
    if (robot->supervisor.state != PROTO_STATE_IDLE || robot->stop_heard) {
        return refused(PROTO_REFUSAL_REASON_WRONG_STATE, robot->supervisor.state);
    }
    if (!robot->supervisor.armed) {
        return refused(PROTO_REFUSAL_REASON_NOT_ARMED, robot->boot_id);
    }
    const uint32_t unfit = supervisor_self_check(&robot->supervisor, &robot->tuning, &robot->view, from_rest);
    return unfit == 0 ? accepted() : refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, unfit);
}

struct refusal robot_drive(struct robot *robot, uint8_t kind, float left, float right)
{
    struct wheel_command command;
    struct refusal verdict = command_check(&robot->tuning, kind, left, right, &command);
    if (verdict.reason != REFUSAL_NONE) {
        return verdict;
    }
    const uint32_t state = hal_critical_enter();
    if (robot->supervisor.state != PROTO_STATE_LIVE) {
        verdict = may_begin(robot, false);
        if (verdict.reason == REFUSAL_NONE) {
            robot->supervisor.state = PROTO_STATE_LIVE;
            if (!log_trigger_is_on(&robot->trigger)) { /* the armed log records this drive too */
                (void)recorder_request(&robot->recorder, robot->tuning.log_rate_hz, 0);
            }
        }
    }
    if (verdict.reason == REFUSAL_NONE) {
        robot->supervisor.silence_ms = 0;
        drive_command(&robot->drive, command.mode, command.left, command.right);
    }
    hal_critical_exit(state);
    return verdict;
}

struct refusal robot_arm(struct robot *robot, uint32_t boot_id)
{
    if (boot_id != robot->boot_id) {
        return refused(PROTO_REFUSAL_REASON_WRONG_BOOT, robot->boot_id);
    }
    robot->supervisor.armed = true;
    return accepted();
}

bool robot_may_drive(const struct robot *robot)
{
    const struct supervisor *const supervisor = &robot->supervisor;
    return supervisor->armed && supervisor->latched == 0 && !robot->view.emergency_stop &&
           !robot->view.supply_dip;
}

void robot_hear_host(struct robot *robot)
{
    if (robot->supervisor.state == PROTO_STATE_SEQUENCE) {
        robot->supervisor.silence_ms = 0;
    }
}

struct refusal robot_start_sequence(struct robot *robot, uint32_t crc, bool unattended, uint16_t *log_id)
{
    struct refusal verdict = may_begin(robot, true);
    if (verdict.reason != REFUSAL_NONE) {
        return verdict;
    }
    if (log_trigger_is_on(
            &robot->trigger)) { /* a sequence has a log of its own, and there is one at a time */
        return refused(PROTO_REFUSAL_REASON_LOG_BUSY, 0);
    }
    /* The tick leaves a sequence alone that does not run, so its check needs no lock. */
    verdict = sequence_check(&robot->sequence, &robot->tuning, crc);
    if (verdict.reason != REFUSAL_NONE) {
        return verdict;
    }
    if (!sequence_is_intact(&robot->sequence)) {
        supervisor_stop(&robot->supervisor, PROTO_FAULT_SEQUENCE_DAMAGED);
        return refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, PROTO_FAULT_SEQUENCE_DAMAGED);
    }
    const uint32_t state = hal_critical_enter();
    if (robot->stop_heard) { /* while the sequence was checked */
        hal_critical_exit(state);
        return refused(PROTO_REFUSAL_REASON_WRONG_STATE, robot->supervisor.state);
    }
    const uint16_t rate = robot->sequence.log_rate_hz;
    *log_id =
        recorder_request(&robot->recorder, rate != 0 ? rate : robot->tuning.log_rate_hz, robot->sequence.crc);
    robot->supervisor.state = PROTO_STATE_SEQUENCE;
    robot->supervisor.silence_ms = 0;
    robot->supervisor.unattended = unattended;
    sequence_start(&robot->sequence, *log_id);
    command_segment(robot);
    hal_critical_exit(state);
    return accepted();
}

static void disarm_log(struct robot *robot)
{
    const uint32_t state = hal_critical_enter();
    const bool fired = robot->trigger.report.state == (uint8_t)PROTO_LOG_TRIGGER_STATE_FIRED;
    if (log_trigger_is_on(&robot->trigger)) {
        recorder_finish_armed(&robot->recorder,
                              fired ? (uint8_t)PROTO_LOG_END_TRIGGERED : (uint8_t)LOG_END_DISCARDED);
    }
    log_trigger_disarm(&robot->trigger);
    hal_critical_exit(state);
}

struct refusal robot_arm_log(struct robot *robot, const struct proto_log_arm_request *wanted,
                             uint16_t *log_id)
{
    *log_id = 0;
    if (wanted->kind == (uint8_t)PROTO_LOG_TRIGGER_KIND_SEQUENCE) {
        disarm_log(robot);
        return accepted();
    }
    const uint16_t rate_hz = robot->tuning.log_rate_hz;
    struct refusal verdict =
        log_trigger_check(wanted, rate_hz, robot->log.cells * (uint32_t)PROTO_LOG_CELL_SIZE);
    const uint32_t state = hal_critical_enter();
    if (verdict.reason == (uint8_t)REFUSAL_NONE && recorder_is_busy(&robot->recorder)) {
        verdict = refused(PROTO_REFUSAL_REASON_LOG_BUSY, 0);
    }
    if (verdict.reason == (uint8_t)REFUSAL_NONE) {
        *log_id = recorder_arm(&robot->recorder, rate_hz, wanted->before_ms);
        log_trigger_arm(&robot->trigger, wanted, *log_id);
    }
    hal_critical_exit(state);
    return verdict;
}

void robot_write_log(struct robot *robot)
{
    log_feed_drain(&robot->feed, &robot->log);
}

void robot_audit(struct robot *robot)
{
    if (robot->supervisor.state == PROTO_STATE_SEQUENCE && !sequence_audit(&robot->sequence)) {
        robot->supervisor.sequence_damaged = true;
    }
}

struct refusal robot_clear_faults(struct robot *robot)
{
    const uint32_t state = hal_critical_enter();
    uint32_t present = supervisor_clear(&robot->supervisor);
    if (present == 0 && !hal_release_emergency_stop()) {
        present = PROTO_FAULT_EMERGENCY_STOP;
        supervisor_stop(&robot->supervisor, present);
    }
    hal_critical_exit(state);
    return present == 0 ? accepted() : refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, present);
}

void robot_status(const struct robot *robot, struct proto_status_reply *out)
{
    const uint32_t state = hal_critical_enter();
    *out = (struct proto_status_reply){
        .uptime_ms = robot->now_ms,
        .state = robot->supervisor.state,
        .mode = robot->drive.mode,
        .sequence_state = robot->sequence.state,
        .log_open = robot->recorder.active || robot->recorder.opening,
        .faults_active = robot->supervisor.active,
        .faults_latched = robot->supervisor.latched,
        .battery_mv = robot->sample.battery_valid ? robot->sample.battery_mv : (uint16_t)0,
    };
    const struct odometry odometry = robot->odometry;
    for (int wheel = 0; wheel < HAL_WHEELS; wheel++) {
        out->effort_e4[wheel] = robot->drive.applied_e4[wheel];
        out->counts[wheel] = robot->counts[wheel];
        out->speed_mmps[wheel] = speed_mmps(robot, wheel);
        out->stray_edges[wheel] = robot->sample.stray_edges[wheel];
    }
    hal_critical_exit(state);
    out->x_mm = odometry_x_mm(&odometry);
    out->y_mm = odometry_y_mm(&odometry);
    out->theta_e4 = odometry_theta_e4(&odometry);
}

void robot_log_trigger(const struct robot *robot, struct proto_log_trigger_reply *out)
{
    const uint32_t state = hal_critical_enter();
    *out = robot->trigger.report;
    hal_critical_exit(state);
}

void robot_sequence_state(const struct robot *robot, struct proto_seq_state_reply *out)
{
    const struct sequence *const sequence = &robot->sequence;
    const uint32_t state = hal_critical_enter();
    const bool uploaded =
        sequence->state != PROTO_SEQUENCE_STATE_EMPTY && sequence->state != PROTO_SEQUENCE_STATE_RECEIVING;
    *out = (struct proto_seq_state_reply){
        .sequence_state = sequence->state,
        .segment_count = sequence->segment_count,
        .segments_received = sequence->received,
        .current_segment = sequence->current,
        .elapsed_ms = sequence->elapsed_ms,
        .duration_ms = sequence->duration_ms,
        .crc32 = uploaded ? sequence->crc : 0,
        .log_id = sequence->log_id,
    };
    hal_critical_exit(state);
}
