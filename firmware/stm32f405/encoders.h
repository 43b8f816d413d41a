/* Quadrature encoders of both wheels on TIM3 (left) and TIM4 (right), and when their edges came. */
#ifndef ENCODERS_H
#define ENCODERS_H

#include <stdint.h>

#include "hal.h"

void encoders_start(uint32_t timer_apb1_hz);

/* Once a tick, before encoders_update: from now on the next edge of each wheel is dated. */
void encoders_watch(void);

/* Extends the 16-bit counters; call at least once in 32767 counts, which the control tick does a hundredfold.
 */
void encoders_update(void);

/* Counts since start of the last update, and the first edge before it. */
void encoders_read(struct hal_sample *out);

void EXTI4_Handler(void);
void EXTI9_5_Handler(void);

#endif
