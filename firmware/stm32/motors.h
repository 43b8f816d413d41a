/* Two H-bridges with IN/IN inputs on TIM1; see hal_drive for the sign convention. */
#ifndef MOTORS_H
#define MOTORS_H

#include <stdbool.h>
#include <stdint.h>

#define MOTOR_PWM_HZ 20000u

/* Takes the pins over with both bridges braking; again, with the other frequency, when the clock has changed.
 */
void motors_start(uint32_t timer_hz);

/* Waits for the next PWM period of the left bridge to begin, 50 us at most. */
void motors_await_period(void);

/* Brakes both bridges at once, by one write that needs no other state; for fault handlers. */
void motors_stop(void);

/* After motors_stop: the bridges follow hal_drive again, unless the emergency stop holds them. */
void motors_go(void);

/* The wired stop is open, or was open since hal_release_emergency_stop. */
bool motors_emergency_stop(void);

#endif
