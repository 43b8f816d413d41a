/* The random number generator, RM0090 section 24. */
#include "machine.h"

/* One step of xorshift64*; the board's seed decides the sequence. */
static uint32_t random_word(uint64_t *state)
{
    *state ^= *state >> 12;
    *state ^= *state << 25;
    *state ^= *state >> 27;
    return (uint32_t)((*state * 0x2545F4914F6CDD1DULL) >> 32);
}

/* The 48 MHz clock comes from the PLL's Q output; without it no number becomes ready. */
bool rng_access(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    if ((b->rcc.enr[1] & 1u << 6) == 0) {
        warn_once(b, 0xF00000C0u, "RNG accessed while its clock is off");
        return true;
    }
    bool ready = (b->rng_cr & 4u) != 0 && (b->rcc.cr & 1u << 25) != 0;
    switch (offset) {
    case 0x0:
        b->rng_cr = write ? *value & 0xCu : b->rng_cr;
        *value = b->rng_cr;
        return true;
    case 0x4:
        *value = ready ? 1u : (b->rng_cr & 4u) != 0 ? 2u : 0; /* DRDY, or CECS */
        return true;
    case 0x8:
        *value = ready ? random_word(&b->rng_state) : 0;
        return true;
    default:
        return false;
    }
}
