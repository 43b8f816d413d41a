/* Samples of chosen signals for live display. */
#include "telemetry.h"

#include "hal.h"

/* Places that are not read: the tick may write them while the main loop copies. */
enum { WRITING = 2, WORD = 4, ALL_SIGNALS = (1 << TELEMETRY_SIGNALS) - 1, MS_PER_S = 1000 };

void telemetry_init(struct telemetry *telemetry)
{
    telemetry->stream_id = 0;
    telemetry->signals = 0;
    telemetry->stride = 1;
    telemetry->capacity = TELEMETRY_WORDS;
    telemetry->end = 0;
}

bool telemetry_due(struct telemetry *telemetry)
{
    if (telemetry->signals == 0) {
        return false;
    }
    telemetry->credit += telemetry->rate_hz;
    if (telemetry->credit < (uint32_t)MS_PER_S) {
        return false;
    }
    telemetry->credit -= (uint32_t)MS_PER_S;
    return true;
}

void telemetry_take(struct telemetry *telemetry, uint32_t now_ms, const int32_t values[TELEMETRY_SIGNALS])
{
    const uint32_t place = (telemetry->end % telemetry->capacity) * telemetry->stride;
    uint32_t *sample = &telemetry->words[place];
    *sample = now_ms;
    for (uint32_t i = 0; i < (uint32_t)TELEMETRY_SIGNALS; i++) {
        if (((telemetry->signals >> i) & 1u) != 0) {
            sample++;
            *sample = (uint32_t)values[i];
        }
    }
    telemetry->end = telemetry->end + 1u;
}

static uint32_t bits_set(uint32_t word)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < (uint32_t)TELEMETRY_SIGNALS; i++) {
        count += (word >> i) & 1u;
    }
    return count;
}

struct refusal telemetry_start(struct telemetry *telemetry, uint32_t signals, uint16_t rate_hz)
{
    if ((signals & ~(uint32_t)ALL_SIGNALS) != 0) {
        return refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0);
    }
    if (signals != 0 && (rate_hz == 0 || rate_hz > TELEMETRY_MAX_HZ)) {
        return refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    }
    const uint32_t stride = 1u + bits_set(signals);
    const uint32_t state = hal_critical_enter();
    telemetry->stream_id =
        telemetry->stream_id == UINT16_MAX ? (uint16_t)1 : (uint16_t)(telemetry->stream_id + 1u);
    telemetry->signals = signals;
    telemetry->stride = stride;
    telemetry->capacity = (uint32_t)TELEMETRY_WORDS / stride;
    telemetry->rate_hz = rate_hz;
    telemetry->credit = 0;
    telemetry->end = 0;
    hal_critical_exit(state);
    return accepted();
}

size_t telemetry_read(const struct telemetry *telemetry, uint32_t *first, uint32_t max_samples, uint8_t *out,
                      size_t capacity)
{
    const uint32_t end = telemetry->end;
    const uint32_t kept =
        telemetry->capacity > (uint32_t)WRITING ? telemetry->capacity - (uint32_t)WRITING : 0;
    const uint32_t oldest = end > kept ? end - kept : 0;
    const size_t size = (size_t)telemetry->stride * (size_t)WORD;
    size_t length = 0;
    if (*first < oldest) {
        *first = oldest;
    } else if (*first > end) {
        *first = end;
    }
    const uint32_t until = end - *first > max_samples ? *first + max_samples : end;
    for (uint32_t number = *first; number < until && length + size <= capacity; number++) {
        const uint32_t place = (number % telemetry->capacity) * telemetry->stride;
        const uint32_t *const sample = &telemetry->words[place];
        for (uint32_t i = 0; i < telemetry->stride; i++) {
            for (uint32_t shift = 0; shift < 32u; shift += 8u) {
                out[length] = (uint8_t)((sample[i] >> shift) & 0xFFu);
                length++;
            }
        }
    }
    return length;
}
