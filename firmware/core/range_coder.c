/* Binary arithmetic coding with models that learn, as SPEC.md's "Coded bits" describes it. */
#include "range_coder.h"

static const uint32_t top_byte = 0x1000000u;
static const uint32_t half = 0x8000u;
static const uint32_t min_probability = 64; /* of 65536: the probability of a bit never reaches 0 or 1 */
static const uint32_t max_seen = 30;        /* bits after which older ones are discounted */

void range_coder_start(struct range_coder *coder, uint8_t *out, size_t capacity)
{
    *coder = (struct range_coder){.capacity = capacity, .range = UINT32_MAX};
    coder->out = out;
}

/* Adds to the code; a carry runs back through the bytes that are written already. */
static void add(struct range_coder *coder, uint32_t amount)
{
    const uint32_t before = coder->low;
    coder->low += amount;
    if (coder->low < before) {
        size_t at = coder->size;
        bool carry = true;
        while (carry && at > 0) {
            at--;
            coder->out[at]++;
            carry = coder->out[at] == 0;
        }
    }
}

static void put_top_byte(struct range_coder *coder)
{
    if (coder->size < coder->capacity) {
        coder->out[coder->size] = (uint8_t)(coder->low >> 24);
        coder->size++;
    }
}

static void narrow(struct range_coder *coder, uint32_t bound, bool bit)
{
    if (bit) {
        coder->range = bound;
    } else {
        add(coder, bound);
        coder->range -= bound;
    }
    while (coder->range < top_byte) {
        put_top_byte(coder);
        coder->low <<= 8;
        coder->range <<= 8;
    }
}

void range_coder_bit(struct range_coder *coder, struct bit_model *model, bool bit)
{
    uint32_t one = model->one != 0 ? model->one : half;
    const uint32_t seen = model->seen;
    narrow(coder, (coder->range >> 16) * one, bit);

    const uint32_t rate = 655360u / (10u * seen + 16u);
    if (bit) {
        one += ((65536u - one) * rate) >> 16;
        one = one > 65536u - min_probability ? 65536u - min_probability : one;
    } else {
        one -= (one * rate) >> 16;
        one = one < min_probability ? min_probability : one;
    }
    model->one = (uint16_t)one;
    model->seen = (uint16_t)(seen < max_seen ? seen + 1u : seen);
}

void range_coder_plain(struct range_coder *coder, uint32_t value, uint32_t bits)
{
    for (uint32_t i = bits; i > 0; i--) {
        narrow(coder, coder->range >> 1, ((value >> (i - 1u)) & 1u) != 0);
    }
}

size_t range_coder_finish(struct range_coder *coder)
{
    add(coder, top_byte - 1u);
    put_top_byte(coder);
    while (coder->size > 0 && coder->out[coder->size - 1u] == 0) {
        coder->size--;
    }
    return coder->size;
}
