/* The CPU's registers as the interpreter keeps them, and their way into the engine and back. */
#ifndef BOARD_CPU_REGISTERS_H
#define BOARD_CPU_REGISTERS_H

#include <stdbool.h>
#include <stdint.h>

struct board;

enum {
    REG_SP = 13,
    REG_LR = 14,
    REG_PC = 15,
    REG_TEMP = 16, /* the interpreter's own: an operand on its way */
    CORE_REGISTERS,
    FP_SINGLES = 32
};
#define CONTROL_NPRIV  1u
#define CONTROL_SPSEL  2u
#define CONTROL_FPCA   4u
#define XPSR_T         (1u << 24)
#define XPSR_EXCEPTION 0x1FFu

/* The condition flags lie apart: negative where bit 31 of `negative` is set, zero where `zero` is 0, carry as
 * 0 or 1, overflow where bit 31 of `overflow` is set. */
struct core {
    uint32_t r[CORE_REGISTERS];
    uint32_t negative, zero, carry, overflow;
    uint32_t xpsr;     /* all but the condition flags */
    uint32_t other_sp; /* of the two stack pointers, the one that is not in use */
    uint32_t primask, basepri, faultmask, control;
    uint32_t fpscr;
    uint32_t s[FP_SINGLES];
    bool in_engine; /* the engine has them */
};

void core_to_engine(struct board *b);
void core_from_engine(struct board *b);
uint32_t core_xpsr(const struct core *core);
void core_set_itstate(struct core *core, uint32_t itstate);

#endif
