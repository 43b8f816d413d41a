/* The robot as the control tick drives it: senses, odometry, drive, sequence, recorder and supervisor
 * together.
 *
 * robot_tick runs in the tick interrupt. All other functions are called from the main loop, and hold
 * interrupts off for the few microseconds in which they change what the tick uses. */
#ifndef ROBOT_H
#define ROBOT_H

#include <stdbool.h>
#include <stdint.h>

#include "refusal.h"
#include "robot_state.h"

/* `boot_id`: of this start; `boot_faults`: faults found at start-up, see boot.h. */
void robot_init(struct robot *robot, uint32_t boot_id, uint32_t boot_faults);
void robot_tick(struct robot *robot);

/* From the main loop: codes the records that wait. */
void robot_write_log(struct robot *robot);

/* From the main loop: goes on checking the running sequence against its CRC, one segment a call. */
void robot_audit(struct robot *robot);

/* Brakes both wheels now; ends a sequence or a live drive, and its log. A latched fault stays latched. */
void robot_stop(struct robot *robot);

/* Allows motion until the next start, if this is the start that was meant. After any reset a host that did
 * not notice it, or one that streams set-points, moves nothing. */
struct refusal robot_arm(struct robot *robot, uint32_t boot_id);

/* Drives the wheels by live commands of the host: `kind` effort or velocity. */
struct refusal robot_drive(struct robot *robot, uint8_t kind, float left, float right);

/* `unattended`: it goes on when its host falls silent. */
struct refusal robot_start_sequence(struct robot *robot, uint32_t crc, bool unattended, uint16_t *log_id);

/* Whether the motor drivers may be on: armed, and nothing stops the robot. */
bool robot_may_drive(const struct robot *robot);

/* The host that started the sequence is there. Live drives need commands instead: a program that hangs may
 * still ask for the state. */
void robot_hear_host(struct robot *robot);

/* Arms a log, or disarms it: kind sequence. */
struct refusal robot_arm_log(struct robot *robot, const struct proto_log_arm_request *wanted,
                             uint16_t *log_id);

struct refusal robot_clear_faults(struct robot *robot);

/* A consistent snapshot of the robot's state. */
void robot_status(const struct robot *robot, struct proto_status_reply *out);
void robot_log_trigger(const struct robot *robot, struct proto_log_trigger_reply *out);
void robot_sequence_state(const struct robot *robot, struct proto_seq_state_reply *out);

#endif
