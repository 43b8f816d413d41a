/* The controller compiled for this machine, wired to the plant: the flashed image's sources without its chip.
 */
#ifndef CORE_ROBOT_H
#define CORE_ROBOT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "hidden.h"
#include "plant.h"
#include "record.h"

#pragma GCC visibility push(default)

struct core_robot;

/* A robot whose controller has just been switched on. NULL: bad parameters or no memory. */
struct core_robot *core_robot_create(const struct plant_params *params, uint64_t seed,
                                     const uint8_t board_id[12]);
void core_robot_destroy(struct core_robot *robot);

/* Before any time passes: when the first tick comes (not before 1000 us), and how long after a tick its
 * efforts reach the bridges (50 us more or less, by where the PWM period lies). */
void core_robot_set_phases(struct core_robot *robot, double first_tick_us, double drive_lag_us);

/* Lets virtual time pass. */
void core_robot_run_us(struct core_robot *robot, uint64_t span_us);
uint64_t core_robot_time_us(const struct core_robot *robot);

/* The link, without a line's baud rate: what is written is there at once. */
void core_robot_link_write(struct core_robot *robot, const uint8_t *data, size_t length);
size_t core_robot_link_read(struct core_robot *robot, uint8_t *out, size_t capacity);

/* The plant, for its own functions; time is only to pass by core_robot_run_us. */
struct plant *core_robot_plant(struct core_robot *robot);

#pragma GCC visibility pop

#endif
