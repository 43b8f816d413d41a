/* What disturbs the lines of an encoder, in numbers. */
#ifndef ENCODER_NOISE_H
#define ENCODER_NOISE_H

#include <stdint.h>

/* What the wires of an encoder pick up, and what its transistors and their pull-ups make of an edge. All
 * zero: nothing. */
struct rig_encoder_noise {
    uint32_t
        period_us; /* bursts of pulses come this often, the first at `first_us` of virtual time; 0: never */
    uint32_t first_us;
    uint32_t burst_us;  /* and last this long, */
    uint32_t pulse_ns;  /* pulses of this width and as much between them, in turn on phase A and phase B */
    uint32_t rise_ns;   /* a line takes this long to rise through the threshold of its input, */
    uint32_t bounce_ns; /* and wavers there with pulses of this width; 0: it rises once, at the end */
};

#endif
