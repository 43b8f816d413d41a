/* Device time: milliseconds count control ticks, microseconds the time since the last one. */
#include "robot_time.h"

/* A tick that is late, or that never came while the flash was busy, leaves the microseconds at their end: the
 * millisecond counts ticks, and time must not run ahead of them. */
void robot_time(const struct robot *robot, struct proto_time_reply *out)
{
    enum { LAST_US = 999 };
    const uint32_t state = hal_critical_enter();
    const uint32_t since_us = hal_now_us() - robot->sample.now_us;
    out->uptime_ms = robot->now_ms;
    hal_critical_exit(state);
    out->after_us = since_us < (uint32_t)LAST_US ? (uint16_t)since_us : (uint16_t)LAST_US;
}

void robot_make_up(struct robot *robot, uint32_t missed_ticks)
{
    const uint32_t state = hal_critical_enter();
    robot->now_ms = robot->now_ms + missed_ticks;
    robot->speeds_stale = missed_ticks != 0;
    hal_critical_exit(state);
}
