/* The next value of a series from its last ones: whichever of four simple guesses did best lately. */
#ifndef LOG_GUESS_H
#define LOG_GUESS_H

#include <stdbool.h>
#include <stdint.h>

enum { LOG_GUESSES = 4 };

/* All zero at the start of a block. */
struct log_guess {
    int32_t last;
    int32_t before;
    int32_t smooth; /* 1/64 */
    int32_t miss;   /* how far the value was from the guess */
    uint32_t errors[LOG_GUESSES];
};

int32_t log_guess_next(const struct log_guess *guess);

/* How good the next guess may be expected to be, 0 to 5. `driven`: something acts on what is at rest. */
uint32_t log_guess_context(const struct log_guess *guess, bool driven);

/* The value has come; it lay `miss` from the guess. */
void log_guess_learn(struct log_guess *guess, int32_t value, int32_t miss);

#endif
