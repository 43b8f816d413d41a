/* Cycle model: the cycles of a stretch of Thumb code, from its instructions alone.
 *
 * The model, after the Cortex-M4 TRM table 3-1: one cycle each; loads and stores two; multiple transfers one
 * more per word; a refill of two for a branch (one on average for a conditional one); divides seven, FP
 * divide and root fourteen, FP multiply-add three. What reads of flash take beyond one cycle is counted in
 * flash_waits.c, on request. */
#include "thumb.h"

#include <string.h>

enum { REFILL = 2, DIVIDE = 7, FP_DIVIDE = 14 };

static uint32_t bits_set(uint32_t value)
{
    return (uint32_t)__builtin_popcount(value);
}

static uint32_t cost16(uint32_t op)
{
    if ((op & 0xF000u) == 0x5000u || (op & 0xE000u) == 0x6000u || (op & 0xE000u) == 0x8000u ||
        (op & 0xF800u) == 0x4800u) {
        return 2; /* LDR, STR in all forms */
    }
    if ((op & 0xFE00u) == 0xB400u) {
        return 1 + bits_set(op & 0x1FFu); /* PUSH */
    }
    if ((op & 0xFE00u) == 0xBC00u) {
        return 1 + bits_set(op & 0x1FFu) + ((op & 0x100u) != 0 ? REFILL : 0); /* POP */
    }
    if ((op & 0xF000u) == 0xC000u) {
        return 1 + bits_set(op & 0xFFu); /* LDM, STM */
    }
    if ((op & 0xF000u) == 0xD000u && (op & 0x0F00u) < 0x0E00u) {
        return 1 + REFILL / 2; /* B<cond> */
    }
    if ((op & 0xF500u) == 0xB100u) {
        return 1 + REFILL / 2; /* CBZ, CBNZ */
    }
    if ((op & 0xF800u) == 0xE000u || (op & 0xFF00u) == 0x4700u || (op & 0xFF87u) == 0x4687u) {
        return 1 + REFILL; /* B, BX, BLX, MOV pc */
    }
    return 1;
}

static uint32_t cost_fp(uint32_t hi, uint32_t lo)
{
    if ((hi & 0xFE00u) == 0xEC00u) {
        if ((hi & 0x0F20u) == 0x0D00u) {
            return 2; /* VLDR, VSTR */
        }
        return 1 + (lo & 0xFFu); /* VLDM, VSTM, VPUSH, VPOP */
    }
    if ((hi & 0xFFB0u) == 0xEE80u && (lo & 0x0010u) == 0) {
        return FP_DIVIDE; /* VDIV */
    }
    if ((hi & 0xFFBFu) == 0xEEB1u && (lo & 0x00D0u) == 0x00C0u) {
        return FP_DIVIDE; /* VSQRT */
    }
    uint32_t kind = hi & 0xFFB0u;
    bool multiply_add = kind == 0xEE00u || kind == 0xEE10u || kind == 0xEE90u || kind == 0xEEA0u;
    return multiply_add && (lo & 0x0010u) == 0 ? 3 : 1;
}

static uint32_t cost32(uint32_t hi, uint32_t lo)
{
    if ((hi & 0xEC00u) == 0xEC00u) {
        return cost_fp(hi, lo);
    }
    if ((hi & 0xFE40u) == 0xE800u) {
        return 1 + bits_set(lo) + ((hi & 0x10u) != 0 && (lo & 0x8000u) != 0 ? REFILL : 0); /* LDM, STM */
    }
    if ((hi & 0xFFF0u) == 0xE8D0u && (lo & 0xFFE0u) == 0xF000u) {
        return 2 + REFILL; /* TBB, TBH */
    }
    if ((hi & 0xFE40u) == 0xE840u) {
        return (hi & 0xFF00u) == 0xE800u && (hi & 0x0020u) == 0 ? 2 : 3; /* exclusives; LDRD, STRD */
    }
    if ((hi & 0xF800u) == 0xF800u && (hi & 0xFE00u) == 0xF800u) {
        return 2 + ((hi & 0x10u) != 0 && (lo & 0xF000u) == 0xF000u && (hi & 0x60u) == 0x40u ? REFILL : 0);
    }
    if ((hi & 0xF800u) == 0xF000u && (lo & 0x8000u) != 0) {
        if ((lo & 0x5000u) != 0) {
            return 1 + REFILL; /* B.W, BL */
        }
        return (hi & 0x0380u) != 0x0380u ? 1 + REFILL / 2 : 1; /* B<cond>.W; MSR, MRS, barriers */
    }
    if ((hi & 0xFFD0u) == 0xFB90u) {
        return DIVIDE; /* SDIV, UDIV */
    }
    return 1;
}

uint32_t instruction_cycles(uint16_t op, uint16_t second)
{
    return op >= 0xE800u ? cost32(op, second) : cost16(op);
}

void block_measure(const uint8_t *code, uint32_t size, uint32_t it_left, struct block *out)
{
    uint32_t cycles = 0;
    uint32_t instructions = 0;
    uint8_t flags = BLOCK_KNOWN;
    for (uint32_t at = 0; at < size; instructions++) {
        uint16_t op;
        uint16_t second = 0;
        memcpy(&op, code + at, sizeof op);
        bool wide = op >= 0xE800u;
        it_left -= it_left != 0 ? 1 : 0;
        if (wide) {
            memcpy(&second, code + at + 2, sizeof second);
            cycles += cost32(op, second);
            if ((op & 0xEC00u) == 0xEC00u && (second & 0x0E00u) == 0x0A00u) {
                flags |= BLOCK_FP;
            }
        } else {
            cycles += cost16(op);
            if ((op & 0xFF00u) == 0xBF00u && (op & 0xFu) != 0) {
                /* IT: the lowest set bit of its mask ends the block, one to four instructions (PM0214 3.9.3).
                 */
                it_left = 4u - (uint32_t)__builtin_ctz(op & 0xFu);
            }
            if (op == 0xBF10u || op == 0xBF20u || op == 0xBF30u) {
                flags |= BLOCK_WAITS;
            }
        }
        at += wide ? 4 : 2;
    }
    *out = (struct block){.cycles = (uint16_t)cycles,
                          .instructions = (uint16_t)instructions,
                          .size = (uint16_t)size,
                          .flags = flags,
                          .it_left = (uint8_t)it_left};
}

/* The code in this part of flash changed. */
void blocks_forget(struct board *b, uint32_t first, uint32_t length)
{
    uint32_t before = first < 4096 ? first : 4096; /* blocks that began earlier and reach into it */
    memset(b->flash_blocks + (first - before) / 2, 0, sizeof(struct block) * ((length + before) / 2));
    b->code.stale = b->code.stale || thumb_has_run(b, first, length);
}
