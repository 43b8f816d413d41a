/* What an encoder's wires add to its levels: bursts of pulses, and edges that rise slowly and waver. */
#ifndef LINE_NOISE_H
#define LINE_NOISE_H

#include <stdbool.h>
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

enum { LINE_NOISE_PHASES = 2 };

/* Of one encoder. */
struct line_noise {
    struct rig_encoder_noise of;
    int64_t seen;                        /* position at the last asking */
    uint64_t rose_ps[LINE_NOISE_PHASES]; /* when the line of phase A, of phase B began to rise */
};

bool line_noise_is_on(const struct line_noise *line);

/* Which lines the noise turns round at this time, bit 0 phase A; times never decrease. */
uint8_t line_noise_bits(struct line_noise *line, int64_t position, uint64_t time_ps);

/* Until when those stay the same while the position does. */
uint64_t line_noise_quiet_until(const struct line_noise *line, uint64_t time_ps);

#endif
