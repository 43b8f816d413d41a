/* What an encoder's wires add to its levels: bursts of pulses, and edges that rise slowly and waver. */
#ifndef LINE_NOISE_H
#define LINE_NOISE_H

#include <stdbool.h>
#include <stdint.h>

#include "encoder_noise.h"

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
