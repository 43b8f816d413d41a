/* The interpreter of Thumb code: blocks of code in flash, decoded once into operations that call each other.
 * What it does not know it leaves to the engine. Only files of this folder include this. */
#ifndef BOARD_THUMB_H
#define BOARD_THUMB_H

#include <string.h>

#include "machine.h"

struct op;
typedef void op_function(struct board *b, struct op *op);

/* One operation. `at` is its instruction's place in the block, in half-words. */
struct op {
    op_function *run;
    union {
        struct {
            uint32_t imm;
            uint8_t a, b, c, at;
        };
        struct code_block *link; /* of a jump that knows its block */
    };
};

/* A block as the engine would translate it: it ends where the engine's ends, so that time passes alike in
 * both. */
struct code_block {
    uint32_t pc;
    struct block measure;
    uint8_t itstate; /* at its beginning */
    struct op ops[];
};

/* Goes on with the next operation, n further. A call in this place costs no stack where the compiler
 * optimises, and at most a block's length of it where not. */
#define NEXT_AFTER(n) op[n].run(b, op + (n))
#define NEXT          NEXT_AFTER(1)
#define R(index)      (b->core.r[index])

/* thumb_blocks.c */
struct code_block *thumb_find(struct board *b, uint32_t pc, uint8_t itstate);
bool thumb_has_run(const struct board *b, uint32_t first, uint32_t length);
void thumb_forget(struct board *b);
uint8_t thumb_itstate(const struct board *b, uint32_t begin, uint8_t itstate, uint32_t pc);

/* thumb_run.c */
void thumb_run(struct board *b, struct code_block *block);
void thumb_escape(struct board *b, struct op *op);
void thumb_continue_at(struct board *b, uint32_t pc);

/* What one operation after another is added to. */
enum { BLOCK_OPS = 800, BLOCK_HALF_WORDS = 250, BLOCK_INSTRUCTIONS = 100 };
struct decoder {
    struct board *board;
    const uint8_t *code; /* at the block's beginning */
    uint32_t first, pc;  /* addresses of the block and of the instruction under way */
    uint32_t size;       /* of that instruction */
    uint32_t count;
    uint8_t itstate; /* that the instruction under way executes with */
    bool fp_begun;   /* an instruction before this one has used the FP registers */
    bool after_it;   /* the instruction before may have been skipped */
    bool ended;      /* the instruction under way is the block's last */
    struct op ops[BLOCK_OPS];
};

struct op *decode_emit(struct decoder *d, op_function *run, unsigned a, unsigned b, unsigned c, uint32_t imm);
void decode_jump(struct decoder *d, uint32_t target);
void decode_branch_if(struct decoder *d, unsigned condition, uint32_t target);
uint32_t decode_pc(const struct decoder *d);
op_function *decode_unless(unsigned condition);
bool decode_literal(struct decoder *d, uint32_t address, unsigned size, uint32_t *value);
static inline bool decode_in_it(const struct decoder *d)
{
    return (d->itstate & 0xFu) != 0;
}
/* False: not an instruction that is interpreted. */
bool decode_16(struct decoder *d, uint32_t op);
bool decode_32(struct decoder *d, uint32_t high, uint32_t low);
bool decode_fp(struct decoder *d, uint32_t high, uint32_t low);
bool decode_block_transfer(struct decoder *d, unsigned base, uint32_t list, bool load, bool down,
                           bool writeback);
bool decode_load_pc(struct decoder *d, unsigned base, uint32_t offset, uint32_t writeback);

/* The operations. _i: the second operand is a constant; _s: sets the flags. */
#define OPS_WITH_TWO_OPERANDS(X)                                                                             \
    X(add) X(adc) X(sub) X(sbc) X(rsb) X(and) X(orr) X(eor) X(bic) X(orn) X(mov) X(mvn)
#define OPS_THAT_COMPARE(X) X(cmp) X(cmn) X(tst) X(teq)
#define OPS_THAT_SHIFT(X)   X(lsl) X(lsr) X(asr) X(ror)
#define CONDITIONS(X)                                                                                        \
    X(eq, b->core.zero == 0)                                                                                 \
    X(ne, b->core.zero != 0)                                                                                 \
    X(cs, b->core.carry != 0)                                                                                \
    X(cc, b->core.carry == 0)                                                                                \
    X(mi, (int32_t)b->core.negative < 0)                                                                     \
    X(pl, (int32_t)b->core.negative >= 0)                                                                    \
    X(vs, (int32_t)b->core.overflow < 0)                                                                     \
    X(vc, (int32_t)b->core.overflow >= 0)                                                                    \
    X(hi, b->core.carry != 0 && b->core.zero != 0)                                                           \
    X(ls, b->core.carry == 0 || b->core.zero == 0)                                                           \
    X(ge, (int32_t)(b->core.negative ^ b->core.overflow) >= 0)                                               \
    X(lt, (int32_t)(b->core.negative ^ b->core.overflow) < 0)                                                \
    X(gt, b->core.zero != 0 && (int32_t)(b->core.negative ^ b->core.overflow) >= 0)                          \
    X(le, b->core.zero == 0 || (int32_t)(b->core.negative ^ b->core.overflow) < 0)

#define DECLARE_TWO(name)     op_function op_##name, op_##name##_i, op_##name##_s, op_##name##_s_i;
#define DECLARE_COMPARE(name) op_function op_##name, op_##name##_i;
/* A shift whose carry alone goes to the flags is named _c. */
#define DECLARE_SHIFT(name)                                                                                  \
    op_function op_##name, op_##name##_i, op_##name##_s, op_##name##_s_i, op_##name##_c_i;
/* A comparison and the branch behind it are one operation. */
#define DECLARE_CONDITION(name, holds)                                                                       \
    op_function op_b_##name, op_skip_unless_##name, op_cmp_b_##name, op_cmp_i_b_##name;
OPS_WITH_TWO_OPERANDS(DECLARE_TWO)
OPS_THAT_COMPARE(DECLARE_COMPARE)
OPS_THAT_SHIFT(DECLARE_SHIFT)
op_function op_set_carry, op_address, op_nop, op_mul, op_muls, op_mla, op_mls, op_umull, op_smull, op_umlal,
    op_smlal, op_udiv, op_sdiv, op_smla_half, op_smul_half, op_clz, op_rbit, op_rev, op_rev16, op_revsh,
    op_sxth, op_uxth, op_sxtb, op_uxtb, op_ubfx, op_sbfx, op_bfi, op_movt, op_mrs, op_msr_primask,
    op_msr_basepri, op_cps, op_ldr, op_ldrh, op_ldrb, op_ldrsh, op_ldrsb, op_str, op_strh, op_strb, op_ldr_pc,
    op_ldrd, op_strd, op_ldm, op_stm, op_jump, op_branch_temp, op_bx, op_blx, op_tbb, op_tbh, op_cbz, op_cbnz,
    op_wfi, op_fp_begin, op_fadd, op_fsub, op_fmul, op_fnmul, op_fdiv, op_fneg, op_fabs, op_fmov, op_fmov_i,
    op_fcmp, op_fcmp_zero, op_fcmp_to_flags, op_fcmp_zero_to_flags, op_f_from_s, op_f_from_u, op_f_to_s,
    op_f_to_u, op_f_from_core, op_f_to_core, op_vmrs, op_vmrs_flags, op_vldr, op_vstr, op_vldm, op_vstm;
CONDITIONS(DECLARE_CONDITION)

static inline void set_nz(struct board *b, uint32_t result)
{
    b->core.negative = result;
    b->core.zero = result;
}

static inline uint32_t difference_with_flags(struct board *b, uint32_t x, uint32_t y)
{
    const uint32_t result = x - y;
    set_nz(b, result);
    b->core.carry = x >= y;
    b->core.overflow = (x ^ y) & (x ^ result);
    return result;
}

#endif
