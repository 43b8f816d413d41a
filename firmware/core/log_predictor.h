/* Predicts the next value of a series from its last ones, by the predictor of four with the smallest recent
 * error. */
#ifndef LOG_PREDICTOR_H
#define LOG_PREDICTOR_H

#include <stdbool.h>
#include <stdint.h>

enum { LOG_PREDICTORS = 4 };

/* All zero at the start of a block. */
struct log_predictor {
    int32_t last;
    int32_t before;
    int32_t smooth;   /* 1/64 */
    int32_t residual; /* last value less its prediction */
    uint32_t errors[LOG_PREDICTORS];
};

/* The prediction of the next value. */
int32_t log_predictor_next(const struct log_predictor *predictor);

/* Coding context of the next value, 0 to 5, from how large the last residual was. `driven`: the series is at
 * rest but its wheel has a command. */
uint32_t log_predictor_context(const struct log_predictor *predictor, bool driven);

/* Takes in the value; `residual` is its difference from the prediction. */
void log_predictor_update(struct log_predictor *predictor, int32_t value, int32_t residual);

#endif
