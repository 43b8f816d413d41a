/* Device time: milliseconds count control ticks, microseconds the time since the last one. */
#ifndef ROBOT_TIME_H
#define ROBOT_TIME_H

#include "robot_state.h"

void robot_time(const struct robot *robot, struct proto_time_reply *out);

/* Advances device time by control ticks that were missed while the CPU was stalled. */
void robot_make_up(struct robot *robot, uint32_t missed_ticks);

#endif
