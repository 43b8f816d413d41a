/* The robot's parameters as the host changes, saves and brings them back: only while nothing moves. */
#ifndef ROBOT_PARAMETERS_H
#define ROBOT_PARAMETERS_H

#include <stdint.h>

#include "refusal.h"
#include "robot_state.h"

/* Stored values, or defaults; from robot_init. */
void robot_start_parameters(struct robot *robot);

struct refusal robot_set_parameter(struct robot *robot, uint16_t index, float value);

/* Brakes for what stalls the CPU; refused while anything moves or a log is written. */
struct refusal robot_prepare_stall(struct robot *robot);

/* The CPU is stalled for up to a second; afterwards device time has moved on by as much. */
struct refusal robot_save_parameters(struct robot *robot, struct proto_param_save_reply *out);

/* As the next start would; `stored` values came from the store. */
struct refusal robot_load_parameters(struct robot *robot, uint16_t *stored);
struct refusal robot_default_parameters(struct robot *robot);

void robot_parameter_store(struct robot *robot, struct proto_param_store_reply *out);

#endif
