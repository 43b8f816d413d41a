/* The whole controller, for the target's main: one static struct, init once, tick every millisecond, poll for
 * ever. */
#include "controller.h"

#include <string.h>

#include "boot.h"
#include "requests.h"
#include "robot.h"

void controller_init(struct controller *controller)
{
    static const int16_t none[HAL_WHEELS] = {0, 0};
    hal_drive(none);
    hal_identity(&controller->identity);
    memset(&controller->link, 0, sizeof controller->link);
    can_link_init(&controller->can, controller->identity.board_id, sizeof controller->identity.board_id);
    controller->listener = (struct stop_listener){0};
    memset(controller->cache, 0, sizeof controller->cache);
    controller->since_poll_ms = 0;
    controller->polled_at_ms = 0;
    controller->sequence_port = PORT_SERIAL;
    controller->bus_off = false;
    update_init(&controller->update);
    robot_init(&controller->robot, controller->identity.boot_id, boot_faults(&controller->identity));
}

/* For the tick, or with the tick held off. */
static bool hears_stop(struct controller *controller)
{
    const uint8_t *bytes;
    struct hal_can_frame frame;
    bool heard = false;
    size_t count = hal_link_peek(&bytes);
    while (count > 0) {
        heard = stop_listener_hear(&controller->listener, bytes, count) || heard;
        count = hal_link_peek(&bytes);
    }
    while (hal_can_peek(&frame)) {
        heard = stop_listener_is_stop(&frame) || heard;
    }
    return heard;
}

/* The tick watches the main loop, which alone obeys a stop, and the watchdog watches the tick: either one
 * that hangs takes the effort off the wheels. */
void controller_tick(struct controller *controller)
{
    const bool hung = controller->since_poll_ms >= CONTROLLER_POLL_MS;
    controller->robot.supervisor.main_loop_hung = hung;
    if (hears_stop(controller)) {
        controller->robot.stop_heard = true;
    }
    robot_tick(&controller->robot);
    hal_note_moving(supervisor_is_moving(&controller->robot.supervisor));
    hal_enable_driver(robot_may_drive(&controller->robot));
    if (!hung) {
        controller->since_poll_ms = controller->since_poll_ms + 1u;
        hal_watchdog_feed();
    }
}

void controller_note_overrun(struct controller *controller)
{
    controller->robot.supervisor.overrun = true;
}

static uint32_t parameter(const struct controller *controller, uint16_t index)
{
    return (uint32_t)controller->robot.parameters.values[index];
}

static void poll_can(struct controller *controller)
{
    struct can_link *const can = &controller->can;
    struct frame request;
    can_link_configure(can, (uint8_t)parameter(controller, PROTO_PARAMETER_CAN_NODE),
                       1000u * parameter(controller, PROTO_PARAMETER_CAN_BITRATE_KBPS));
    can_link_flush(can, controller->robot.now_ms);
    enum can_link_event event = can_link_receive(can, controller->robot.now_ms, &request);
    while (event != CAN_LINK_NOTHING) {
        if (event == CAN_LINK_STOP) {
            robot_stop(&controller->robot);
        } else {
            robot_write_log(&controller->robot);
            requests_answer(controller, PORT_CAN, &request);
        }
        can_link_flush(can, controller->robot.now_ms);
        event = controller->since_poll_ms < 2 * CONTROLLER_ROUND_MS
                    ? can_link_receive(can, controller->robot.now_ms, &request)
                    : CAN_LINK_NOTHING;
    }
    if (can_link_status_due(can, controller->robot.now_ms,
                            parameter(controller, PROTO_PARAMETER_CAN_STATUS_HZ))) {
        struct proto_status_reply status;
        robot_status(&controller->robot, &status);
        can_link_broadcast(can, &status);
    }
}

/* A bus that has never carried a frame is not in use: no fault. The fault is reported for at least one
 * second, since the controller is off the bus for a tenth of a second only. */
static void watch_bus(struct controller *controller, uint32_t now_ms)
{
    enum { SHOWN_MS = 1000 };
    struct hal_can_report report;
    hal_can_report(&report);
    if (report.state == HAL_CAN_BUS_OFF && report.sent + report.received > 0) {
        controller->bus_off = true;
        controller->bus_off_ms = now_ms;
    } else if (now_ms - controller->bus_off_ms >= SHOWN_MS) {
        controller->bus_off = false;
    }
    controller->robot.supervisor.can_bus_off = controller->bus_off;
}

/* Before the main loop reads: a stop that it executes and the tick hears only afterwards would end the drive
 * that the host began in between. It brakes here, since the end of the round forgets that it was heard. */
static void listen(struct controller *controller)
{
    if (!hal_has_unheard()) {
        return;
    }
    const uint32_t state = hal_critical_enter();
    if (hears_stop(controller)) {
        controller->robot.stop_heard = true;
        robot_stop(&controller->robot);
    }
    hal_critical_exit(state);
}

void controller_poll(struct controller *controller)
{
    struct frame request;
    controller->since_poll_ms = 0;
    listen(controller);
    link_flush(&controller->link);
    robot_write_log(&controller->robot);
    /* Bytes are read even when the send queue is full, so that a stop never waits behind other requests. */
    while (controller->since_poll_ms < CONTROLLER_ROUND_MS && link_receive(&controller->link, &request)) {
        robot_write_log(&controller->robot); /* replies report the log as of now */
        requests_answer(controller, PORT_SERIAL, &request);
        link_flush(&controller->link);
    }

    poll_can(controller);
    if (controller->since_poll_ms < CONTROLLER_ROUND_MS) { /* nothing was left for the next round */
        controller->robot.stop_heard = false;
    }
    robot_audit(&controller->robot);

    const uint32_t now_ms = controller->robot.now_ms;
    if (now_ms != controller->polled_at_ms) {
        controller->polled_at_ms = now_ms;
        watch_bus(controller, now_ms);
        update_step(&controller->update, now_ms);
    }
}
