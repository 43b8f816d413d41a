/* Samples of chosen signals for live display: a ring that the host reads by sample number, so that it can ask
 * again for what the line lost. */
#ifndef TELEMETRY_H
#define TELEMETRY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "refusal.h"

/* Half a second at 200 Hz of all signals, 7 KiB. */
enum { TELEMETRY_WORDS = 1792, TELEMETRY_SIGNALS = PROTO_SIGNAL_BATTERY + 1, TELEMETRY_MAX_HZ = 200 };

struct telemetry {
    uint16_t stream_id; /* 0: none since the start */
    uint32_t signals;   /* bits of enum proto_signal; 0: no samples are taken */
    uint32_t stride;    /* words of a sample: its time and its signals */
    uint32_t capacity;  /* samples */
    uint16_t rate_hz;
    uint32_t credit;       /* rate_hz for each ms: a sample is due at 1000 */
    volatile uint32_t end; /* samples taken so far; written by the tick only */
    uint32_t words[TELEMETRY_WORDS];
};

void telemetry_init(struct telemetry *telemetry);

/* Whether this tick takes a sample. From the tick, once. */
bool telemetry_due(struct telemetry *telemetry);

/* From the tick: `values` has all signals in the order of enum proto_signal. */
void telemetry_take(struct telemetry *telemetry, uint32_t now_ms, const int32_t values[TELEMETRY_SIGNALS]);

/* From the main loop. */
struct refusal telemetry_start(struct telemetry *telemetry, uint32_t signals, uint16_t rate_hz);

/* Copies up to `max_samples` samples from `*first` on, or from the oldest that is left, which *first then is;
 * returns how many bytes. */
size_t telemetry_read(const struct telemetry *telemetry, uint32_t *first, uint32_t max_samples, uint8_t *out,
                      size_t capacity);

#endif
