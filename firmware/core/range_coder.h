/* Binary arithmetic coding with models that learn, as SPEC.md's "Coded bits" describes it. */
#ifndef RANGE_CODER_H
#define RANGE_CODER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Probability of a one, and the number of bits it was estimated from. */
struct bit_model {
    uint16_t one;  /* 1/65536; 0 stands for a half, so that an all-zero model is uninformed */
    uint16_t seen; /* bits, up to a limit */
};

struct range_coder {
    uint8_t *out;
    size_t size;
    size_t capacity;
    uint32_t low;
    uint32_t range;
};

/* A coded bit takes at most this many of the output's. */
enum { RANGE_CODER_MAX_BITS = 11 };

/* Codes into `out`; what does not fit is dropped, so the caller leaves room. */
void range_coder_start(struct range_coder *coder, uint8_t *out, size_t capacity);

/* One bit; updates the model with it. */
void range_coder_bit(struct range_coder *coder, struct bit_model *model, bool bit);

/* The lowest `bits` bits of `value`, most significant first, each as likely as not. */
void range_coder_plain(struct range_coder *coder, uint32_t value, uint32_t bits);

/* Ends the code with as many bytes as make it unique; returns its size. Trailing zeros are left out. */
size_t range_coder_finish(struct range_coder *coder);

#endif
