/* Predicts the next value of a series from its last ones, by the predictor of four with the smallest recent
 * error. */
#include "log_predictor.h"

static const int32_t limit = 1 << 23; /* keeps every sum below inside 32 bits */
static const uint32_t worst_error = 1u << 20;

static void all_predictions(const struct log_predictor *predictor, int32_t out[LOG_PREDICTORS])
{
    const int32_t step = predictor->last - predictor->before;
    out[0] = predictor->last;
    out[1] = predictor->last + (step >> 1);
    out[2] = predictor->last + step;
    out[3] = (predictor->smooth + 32) >> 6;
}

int32_t log_predictor_next(const struct log_predictor *predictor)
{
    int32_t predictions[LOG_PREDICTORS];
    uint32_t best = 0;
    all_predictions(predictor, predictions);
    for (uint32_t i = 1; i < (uint32_t)LOG_PREDICTORS; i++) {
        if (predictor->errors[i] < predictor->errors[best]) {
            best = i;
        }
    }
    return predictions[best];
}

uint32_t log_predictor_context(const struct log_predictor *predictor, bool driven)
{
    if (predictor->last == 0 && predictor->before == 0) {
        return driven ? 5u : 4u;
    }
    if (predictor->residual == 0) {
        return 0;
    }
    if (predictor->residual == 1 || predictor->residual == -1) {
        return 1;
    }
    return predictor->residual > -4 && predictor->residual < 4 ? 2u : 3u;
}

static int32_t clamped(int32_t value)
{
    if (value > limit) {
        return limit;
    }
    return value < -limit ? -limit : value;
}

void log_predictor_update(struct log_predictor *predictor, int32_t value, int32_t residual)
{
    const int32_t seen = clamped(value);
    int32_t predictions[LOG_PREDICTORS];
    all_predictions(predictor, predictions);
    for (uint32_t i = 0; i < (uint32_t)LOG_PREDICTORS; i++) {
        const int32_t off = seen - predictions[i];
        const uint32_t size = off >= 0 ? (uint32_t)off : (uint32_t)-off;
        const uint32_t error = size < worst_error ? size : worst_error;
        predictor->errors[i] += 4u * error - (predictor->errors[i] >> 2);
    }
    predictor->smooth += (seen * 64 - predictor->smooth) >> 2;
    predictor->before = predictor->last;
    predictor->last = seen;
    predictor->residual = residual;
}
