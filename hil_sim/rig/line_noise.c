/* What an encoder's wires add to its levels: bursts of pulses, and edges that rise slowly and waver. */
#include "line_noise.h"

#define PS_PER_US 1000000ULL
#define PS_PER_NS 1000ULL

enum { PHASES = LINE_NOISE_PHASES };

bool line_noise_is_on(const struct line_noise *line)
{
    return line->of.period_us != 0 || line->of.rise_ns != 0;
}

static bool is_high(int64_t position, int phase)
{
    const uint64_t state = (uint64_t)position & 3u;
    return phase == 0 ? state == 1 || state == 2 : state >= 2;
}

/* A time within pulses of a width that alternate with pauses of the same; both begin at a multiple of it. */
static bool in_pulse(uint64_t since_ps, uint64_t width_ns)
{
    return since_ps / (width_ns * PS_PER_NS) % 2 == 1;
}

static uint8_t burst_bits(const struct rig_encoder_noise *noise, uint64_t time_ps)
{
    const uint64_t first_ps = noise->first_us * PS_PER_US;
    if (noise->period_us == 0 || time_ps < first_ps) {
        return 0;
    }
    const uint64_t within_ps = (time_ps - first_ps) % (noise->period_us * PS_PER_US);
    if (within_ps >= noise->burst_us * PS_PER_US || !in_pulse(within_ps, noise->pulse_ns)) {
        return 0;
    }
    return within_ps / (noise->pulse_ns * PS_PER_NS) / 2 % 2 == 0 ? 1 : 2;
}

uint8_t line_noise_bits(struct line_noise *line, int64_t position, uint64_t time_ps)
{
    const struct rig_encoder_noise *noise = &line->of;
    uint8_t bits = burst_bits(noise, time_ps);
    for (int phase = 0; phase < PHASES; phase++) {
        if (is_high(position, phase) && !is_high(line->seen, phase)) {
            line->rose_ps[phase] = time_ps;
        }
        const uint64_t since_ps = time_ps - line->rose_ps[phase];
        const bool rising = is_high(position, phase) && since_ps < noise->rise_ns * PS_PER_NS;
        if (rising && (noise->bounce_ns == 0 || !in_pulse(since_ps, noise->bounce_ns))) {
            bits ^= (uint8_t)(1u << phase);
        }
    }
    line->seen = position;
    return bits;
}

static uint64_t earlier(uint64_t one, uint64_t other)
{
    return one < other ? one : other;
}

/* The next multiple of a width after a time since the beginning of pulses. */
static uint64_t next_multiple(uint64_t since_ps, uint64_t width_ns)
{
    return (since_ps / (width_ns * PS_PER_NS) + 1) * width_ns * PS_PER_NS;
}

uint64_t line_noise_quiet_until(const struct line_noise *line, uint64_t time_ps)
{
    const struct rig_encoder_noise *noise = &line->of;
    uint64_t until_ps = UINT64_MAX;
    if (noise->period_us != 0) {
        const uint64_t first_ps = noise->first_us * PS_PER_US;
        const uint64_t period_ps = noise->period_us * PS_PER_US;
        const uint64_t within_ps = time_ps < first_ps ? 0 : (time_ps - first_ps) % period_ps;
        const uint64_t next_ps = next_multiple(within_ps, noise->pulse_ns);
        const bool over = next_ps >= noise->burst_us * PS_PER_US && within_ps >= noise->burst_us * PS_PER_US;
        until_ps = time_ps < first_ps ? first_ps : time_ps - within_ps + (over ? period_ps : next_ps);
    }
    for (int phase = 0; phase < PHASES && noise->rise_ns != 0; phase++) {
        const uint64_t since_ps = time_ps - line->rose_ps[phase];
        if (is_high(line->seen, phase) && since_ps < noise->rise_ns * PS_PER_NS) {
            const uint64_t width_ns = noise->bounce_ns != 0 ? noise->bounce_ns : noise->rise_ns;
            until_ps = earlier(until_ps, line->rose_ps[phase] + earlier(next_multiple(since_ps, width_ns),
                                                                        noise->rise_ns * PS_PER_NS));
        }
    }
    return until_ps;
}
