/* The whole controller, for the target's main: one static struct, init once, tick every millisecond, poll for
 * ever. */
#include "controller.h"

#include <string.h>

#include "boot.h"
#include "requests.h"

void controller_init(struct controller *controller)
{
    static const int16_t none[HAL_WHEELS] = {0, 0};
    hal_drive(none);
    hal_identity(&controller->identity);
    memset(&controller->link, 0, sizeof controller->link);
    memset(&controller->cache, 0, sizeof controller->cache);
    controller->fed_at_ms = 0;
    robot_init(&controller->robot, boot_faults(&controller->identity));
}

void controller_tick(struct controller *controller)
{
    robot_tick(&controller->robot);
}

void controller_note_overrun(struct controller *controller)
{
    controller->robot.supervisor.overrun = true;
}

void controller_poll(struct controller *controller)
{
    struct frame request;
    link_flush(&controller->link);
    /* Bytes are read however full the line is, so that a stop never waits behind other requests. */
    while (link_receive(&controller->link, &request)) {
        requests_answer(controller, &request);
        link_flush(&controller->link);
    }

    robot_audit(&controller->robot);

    /* A main loop that runs while the tick is dead must not keep the watchdog quiet. */
    const uint32_t now_ms = controller->robot.now_ms;
    if (now_ms != controller->fed_at_ms) {
        controller->fed_at_ms = now_ms;
        hal_watchdog_feed();
    }
}
