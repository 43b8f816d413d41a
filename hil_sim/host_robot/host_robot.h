/* The controller compiled for this machine, wired to the plant: the flashed image's sources without its chip.
 */
#ifndef HOST_ROBOT_H
#define HOST_ROBOT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "../plant/plant.h"

#pragma GCC visibility push(default)

struct host_robot;

/* A robot whose controller has just been switched on. NULL: bad parameters or no memory. */
struct host_robot *host_robot_create(const struct plant_params *params, uint64_t seed,
                                     const uint8_t board_id[12]);
void host_robot_destroy(struct host_robot *robot);

/* Before any time passes: when the first tick comes (not before 1000 us), and how long after a tick its
 * efforts reach the bridges (50 us more or less, by where the PWM period lies). */
void host_robot_set_phases(struct host_robot *robot, double first_tick_us, double drive_lag_us);

/* Lets virtual time pass. */
void host_robot_run_us(struct host_robot *robot, uint64_t span_us);
uint64_t host_robot_time_us(const struct host_robot *robot);

/* The link, without a line's baud rate: what is written is there at once. */
void host_robot_link_write(struct host_robot *robot, const uint8_t *data, size_t length);
size_t host_robot_link_read(struct host_robot *robot, uint8_t *out, size_t capacity);

/* The plant, for its own functions; time is only to pass by host_robot_run_us. */
struct plant *host_robot_plant(struct host_robot *robot);

#pragma GCC visibility pop

#endif
