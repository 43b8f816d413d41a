/* Quadrature encoders of both wheels on TIM3 (left) and TIM4 (right). */
#ifndef ENCODERS_H
#define ENCODERS_H

#include <stdint.h>

#include "hal.h"

void encoders_start(void);

/* Extends the 16-bit counters; call at least once in 32767 counts, which the control tick does a hundredfold.
 */
void encoders_update(void);

/* Counts since start, of the last update. */
void encoders_read(int32_t counts[HAL_WHEELS]);

#endif
