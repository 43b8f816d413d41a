/* Sine and cosine of a binary angle, the same to the last bit on every target. */
#ifndef TRIG_H
#define TRIG_H

#include <stdint.h>

/* `phase`: the angle, 2^32 to a turn. */
void trig_sine_cosine(uint32_t phase, float *sine, float *cosine);

#endif
