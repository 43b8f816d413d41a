/* The next value of a series from its last ones: whichever of four simple guesses did best lately. */
#include "log_guess.h"

static const int32_t limit = 1 << 23; /* keeps every sum below inside 32 bits */
static const uint32_t worst_error = 1u << 20;

static void all_guesses(const struct log_guess *guess, int32_t out[LOG_GUESSES])
{
    const int32_t step = guess->last - guess->before;
    out[0] = guess->last;
    out[1] = guess->last + (step >> 1);
    out[2] = guess->last + step;
    out[3] = (guess->smooth + 32) >> 6;
}

int32_t log_guess_next(const struct log_guess *guess)
{
    int32_t guesses[LOG_GUESSES];
    uint32_t best = 0;
    all_guesses(guess, guesses);
    for (uint32_t i = 1; i < (uint32_t)LOG_GUESSES; i++) {
        if (guess->errors[i] < guess->errors[best]) {
            best = i;
        }
    }
    return guesses[best];
}

uint32_t log_guess_context(const struct log_guess *guess, bool driven)
{
    if (guess->last == 0 && guess->before == 0) {
        return driven ? 5u : 4u;
    }
    if (guess->miss == 0) {
        return 0;
    }
    if (guess->miss == 1 || guess->miss == -1) {
        return 1;
    }
    return guess->miss > -4 && guess->miss < 4 ? 2u : 3u;
}

static int32_t clamped(int32_t value)
{
    if (value > limit) {
        return limit;
    }
    return value < -limit ? -limit : value;
}

void log_guess_learn(struct log_guess *guess, int32_t value, int32_t miss)
{
    const int32_t seen = clamped(value);
    int32_t guesses[LOG_GUESSES];
    all_guesses(guess, guesses);
    for (uint32_t i = 0; i < (uint32_t)LOG_GUESSES; i++) {
        const int32_t off = seen - guesses[i];
        const uint32_t size = off >= 0 ? (uint32_t)off : (uint32_t)-off;
        const uint32_t error = size < worst_error ? size : worst_error;
        guess->errors[i] += 4u * error - (guess->errors[i] >> 2);
    }
    guess->smooth += (seen * 64 - guess->smooth) >> 2;
    guess->before = guess->last;
    guess->last = seen;
    guess->miss = miss;
}
