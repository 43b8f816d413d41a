/* Peripherals of a few registers: random numbers, SYSCFG, power control, debug identity. */
#include "machine.h"

/* One step of xorshift64*; the board's seed decides the sequence. */
static uint32_t random_word(uint64_t *state)
{
    *state ^= *state >> 12;
    *state ^= *state << 25;
    *state ^= *state >> 27;
    return (uint32_t)((*state * 0x2545F4914F6CDD1DULL) >> 32);
}

/* RM0090 section 24. The 48 MHz clock comes from the PLL's Q output; without it no number gets ready. */
bool rng_access(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    if ((b->rcc.enr[1] & 1u << 6) == 0) {
        note_oddity(b, 0xF00000C0u, "RNG accessed while its clock is off");
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

bool syscfg_access(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    uint32_t *const store[] = {&b->syscfg_memrmp,    &b->syscfg_pmc,       &b->syscfg_exticr[0],
                               &b->syscfg_exticr[1], &b->syscfg_exticr[2], &b->syscfg_exticr[3]};
    if (offset == 0x20) { /* CMPCR: the compensation cell is ready at once */
        *value = 0x100u;
        return true;
    }
    if (offset > 0x14) {
        return false;
    }
    if (write) {
        exti_sync(b); /* EXTICR chooses the pins whose edges count */
        *store[offset / 4] = *value;
        exti_schedule(b);
    }
    *value = *store[offset / 4];
    return true;
}

bool pwr_access(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    if (offset == 0x0) {
        b->pwr_cr = write ? *value & 0x43F3u : b->pwr_cr;
        *value = b->pwr_cr;
        return true;
    }
    if (offset == 0x4) { /* CSR: VOSRDY, the regulator follows at once */
        *value = 1u << 14;
        return true;
    }
    return false;
}

bool dbgmcu_access(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    if (offset == 0) { /* IDCODE of an STM32F405, revision Z (RM0090 38.6.1) */
        *value = 0x10076413u;
        return true;
    }
    uint32_t *store = &b->dbgmcu[offset / 4 - 1];
    *store = write ? *value : *store;
    *value = *store;
    return true;
}
