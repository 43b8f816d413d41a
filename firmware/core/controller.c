/* The whole controller, for the target's main: one static struct, init once, tick every millisecond, poll for
 * ever. */
#include "controller.h"

#include <string.h>

#include "requests.h"

void controller_init(struct controller *controller)
{
    static const int16_t none[HAL_WHEELS] = {0, 0};
    hal_drive(none);
    hal_identity(&controller->identity);
    memset(&controller->link, 0, sizeof controller->link);
    memset(&controller->cache, 0, sizeof controller->cache);
    controller->is_pending = false;
    controller->fed_at_ms = 0;
    robot_init(&controller->robot, controller->identity.clock_fallback);
}

void controller_tick(struct controller *controller)
{
    robot_tick(&controller->robot);
}

void controller_note_overrun(struct controller *controller)
{
    controller->robot.supervisor.overrun = true;
}

/* Takes the next frame. The effect of a stop does not wait for room for its reply, nor for replies before it.
 */
static bool take_frame(struct controller *controller)
{
    if (!controller->is_pending) {
        controller->is_pending = link_receive(&controller->link, &controller->pending);
        if (controller->is_pending && controller->pending.id == PROTO_ID_STOP) {
            robot_stop(&controller->robot);
        }
    }
    return controller->is_pending;
}

void controller_poll(struct controller *controller)
{
    link_flush(&controller->link);
    while (take_frame(controller)) {
        if (!link_has_room(&controller->link, requests_reply_size(controller->pending.id))) {
            break; /* the line is busy; the frame keeps until the next poll */
        }
        requests_answer(controller, &controller->pending);
        controller->is_pending = false;
        link_flush(&controller->link);
    }

    /* A main loop that runs while the tick is dead must not keep the watchdog quiet. */
    const uint32_t now_ms = controller->robot.now_ms;
    if (now_ms != controller->fed_at_ms) {
        controller->fed_at_ms = now_ms;
        hal_watchdog_feed();
    }
}
