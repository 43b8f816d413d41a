/* Quadrature encoders of both wheels on TIM3 and TIM4, and when their edges came. */
#ifndef ENCODERS_H
#define ENCODERS_H

#include <stdint.h>

#include "hal.h"

void encoders_start(uint32_t timer_apb1_hz);

/* At the beginning of a tick: extends the 16-bit counters (call at least once in 32767 counts, which the
 * control tick does with a wide margin), takes the edge that was dated since the last tick, and watches for
 * the next one. */
void encoders_update(void);

/* Counts since start of the last update, and the edge dated before it. */
void encoders_read(struct hal_sample *out);

/* Microseconds since start-up, of the clock that dates edges. */
uint32_t encoders_now_us(void);

void TIM3_Handler(void);
void TIM4_Handler(void);

#endif
