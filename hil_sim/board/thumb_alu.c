/* Operations on registers: arithmetic, logic, shifts, fields, multiplication, special registers. */
#include "thumb.h"

/* x and y are the first and the second operand. */
static inline uint32_t sum_with_flags(struct board *b, uint32_t x, uint32_t y)
{
    const uint32_t result = x + y;
    set_nz(b, result);
    b->core.carry = result < x;
    b->core.overflow = (x ^ result) & ~(x ^ y);
    return result;
}

static inline uint32_t sum_with_carry(struct board *b, uint32_t x, uint32_t y)
{
    const uint64_t wide = (uint64_t)x + y + b->core.carry;
    const uint32_t result = (uint32_t)wide;
    set_nz(b, result);
    b->core.carry = (uint32_t)(wide >> 32);
    b->core.overflow = (x ^ result) & ~(x ^ y);
    return result;
}

static inline uint32_t logical_with_flags(struct board *b, uint32_t result)
{
    set_nz(b, result);
    return result;
}

#define OPERATION(name, second, statement)                                                                   \
    void op_##name(struct board *b, struct op *op)                                                           \
    {                                                                                                        \
        const uint32_t x = R(op->b);                                                                         \
        const uint32_t y = (second);                                                                         \
        (void)x;                                                                                             \
        statement;                                                                                           \
        NEXT;                                                                                                \
    }

/* An operation in its four forms: from its value and from its value with flags. */
#define TWO_OPERANDS(name, value, value_with_flags)                                                          \
    OPERATION(name, R(op->c), R(op->a) = (value))                                                            \
    OPERATION(name##_i, op->imm, R(op->a) = (value))                                                         \
    OPERATION(name##_s, R(op->c), R(op->a) = (value_with_flags))                                             \
    OPERATION(name##_s_i, op->imm, R(op->a) = (value_with_flags))
TWO_OPERANDS(add, x + y, sum_with_flags(b, x, y))
TWO_OPERANDS(adc, x + y + b->core.carry, sum_with_carry(b, x, y))
TWO_OPERANDS(sub, x - y, difference_with_flags(b, x, y))
TWO_OPERANDS(sbc, x + ~y + b->core.carry, sum_with_carry(b, x, ~y))
TWO_OPERANDS(rsb, y - x, difference_with_flags(b, y, x))
TWO_OPERANDS(and, x &y, logical_with_flags(b, x &y))
TWO_OPERANDS(orr, x | y, logical_with_flags(b, x | y))
TWO_OPERANDS(eor, x ^ y, logical_with_flags(b, x ^ y))
TWO_OPERANDS(bic, x & ~y, logical_with_flags(b, x & ~y))
TWO_OPERANDS(orn, x | ~y, logical_with_flags(b, x | ~y))
TWO_OPERANDS(mov, y, logical_with_flags(b, y))
TWO_OPERANDS(mvn, ~y, logical_with_flags(b, ~y))

#define COMPARISON(name, flags)                                                                              \
    OPERATION(name, R(op->c), flags)                                                                         \
    OPERATION(name##_i, op->imm, flags)
COMPARISON(cmp, difference_with_flags(b, x, y))
COMPARISON(cmn, sum_with_flags(b, x, y))
COMPARISON(tst, set_nz(b, x &y))
COMPARISON(teq, set_nz(b, x ^ y))

/* ---- shifts, by 0 to 255 (A2.2.1); by 0 the carry stays */

static inline uint32_t lsl(uint32_t x, uint32_t n)
{
    return n < 32 ? x << n : 0;
}

static inline uint32_t lsr(uint32_t x, uint32_t n)
{
    return n < 32 ? x >> n : 0;
}

static inline uint32_t asr(uint32_t x, uint32_t n)
{
    return (uint32_t)((int64_t)(int32_t)x >> (n < 32 ? n : 31));
}

static inline uint32_t ror(uint32_t x, uint32_t n)
{
    return x >> (n & 31u) | x << (-n & 31u);
}

static inline uint32_t carry_of_lsl(uint32_t x, uint32_t n)
{
    return n <= 32 ? x >> (32 - n) & 1u : 0;
}

static inline uint32_t carry_of_lsr(uint32_t x, uint32_t n)
{
    return n <= 32 ? x >> (n - 1) & 1u : 0;
}

static inline uint32_t carry_of_asr(uint32_t x, uint32_t n)
{
    return x >> (n <= 32 ? n - 1 : 31) & 1u;
}

static inline uint32_t carry_of_ror(uint32_t x, uint32_t n)
{
    return x >> ((n - 1) & 31u) & 1u;
}

#define SHIFT(name)                                                                                          \
    void op_##name(struct board *b, struct op *op)                                                           \
    {                                                                                                        \
        R(op->a) = name(R(op->b), R(op->c) & 0xFFu);                                                         \
        NEXT;                                                                                                \
    }                                                                                                        \
    void op_##name##_i(struct board *b, struct op *op)                                                       \
    {                                                                                                        \
        R(op->a) = name(R(op->b), op->imm);                                                                  \
        NEXT;                                                                                                \
    }                                                                                                        \
    void op_##name##_s(struct board *b, struct op *op)                                                       \
    {                                                                                                        \
        const uint32_t x = R(op->b);                                                                         \
        const uint32_t n = R(op->c) & 0xFFu;                                                                 \
        b->core.carry = n != 0 ? carry_of_##name(x, n) : b->core.carry;                                      \
        R(op->a) = logical_with_flags(b, name(x, n));                                                        \
        NEXT;                                                                                                \
    }                                                                                                        \
    void op_##name##_s_i(struct board *b, struct op *op)                                                     \
    {                                                                                                        \
        const uint32_t x = R(op->b);                                                                         \
        b->core.carry = carry_of_##name(x, op->imm);                                                         \
        R(op->a) = logical_with_flags(b, name(x, op->imm));                                                  \
        NEXT;                                                                                                \
    }                                                                                                        \
    void op_##name##_c_i(struct board *b, struct op *op)                                                     \
    {                                                                                                        \
        const uint32_t x = R(op->b);                                                                         \
        b->core.carry = carry_of_##name(x, op->imm);                                                         \
        R(op->a) = name(x, op->imm);                                                                         \
        NEXT;                                                                                                \
    }
SHIFT(lsl)
SHIFT(lsr)
SHIFT(asr)
SHIFT(ror)

/* ---- operations of one form: `value` becomes register a */

#define VALUE(name, value)                                                                                   \
    void op_##name(struct board *b, struct op *op)                                                           \
    {                                                                                                        \
        R(op->a) = (value);                                                                                  \
        NEXT;                                                                                                \
    }
VALUE(address, R(op->b) + (R(op->c) << op->imm))
VALUE(mul, R(op->b) * R(op->c))
VALUE(muls, logical_with_flags(b, R(op->b) * R(op->c)))
VALUE(mla, R(op->imm) + R(op->b) * R(op->c))
VALUE(mls, R(op->imm) - R(op->b) * R(op->c))
VALUE(clz, R(op->c) == 0 ? 32u : (uint32_t)__builtin_clz(R(op->c)))
VALUE(rev, __builtin_bswap32(R(op->c)))
VALUE(rev16, (R(op->c) & 0x00FF00FFu) << 8 | (R(op->c) >> 8 & 0x00FF00FFu))
VALUE(revsh, (uint32_t)(int32_t)(int16_t)__builtin_bswap16((uint16_t)R(op->c)))
VALUE(sxth, (uint32_t)(int32_t)(int16_t)ror(R(op->c), op->imm))
VALUE(uxth, ror(R(op->c), op->imm) & 0xFFFFu)
VALUE(sxtb, (uint32_t)(int32_t)(int8_t)ror(R(op->c), op->imm))
VALUE(uxtb, ror(R(op->c), op->imm) & 0xFFu)
VALUE(movt, (R(op->a) & 0xFFFFu) | op->imm << 16)
VALUE(bfi, (R(op->a) & ~op->imm) | (R(op->b) << op->c & op->imm))
/* A field of imm bits from bit c on. */
VALUE(ubfx, R(op->b) << (32 - op->imm - op->c) >> (32 - op->imm))
VALUE(sbfx, (uint32_t)((int32_t)(R(op->b) << (32 - op->imm - op->c)) >> (32 - op->imm)))
/* Division by zero gives zero while CCR.DIV_0_TRP is clear (PM0214 4.3.7). */
VALUE(udiv, R(op->c) == 0 ? 0 : R(op->b) / R(op->c))

static uint32_t divide(int64_t dividend, int64_t divisor)
{
    return divisor == 0 ? 0 : (uint32_t)(dividend / divisor);
}
VALUE(sdiv, divide((int32_t)R(op->b), (int32_t)R(op->c)))

static uint32_t reversed(uint32_t value)
{
    value = (value & 0x55555555u) << 1 | (value >> 1 & 0x55555555u);
    value = (value & 0x33333333u) << 2 | (value >> 2 & 0x33333333u);
    value = (value & 0x0F0F0F0Fu) << 4 | (value >> 4 & 0x0F0F0F0Fu);
    return __builtin_bswap32(value);
}
VALUE(rbit, reversed(R(op->c)))

void op_set_carry(struct board *b, struct op *op)
{
    b->core.carry = op->imm;
    NEXT;
}

void op_nop(struct board *b, struct op *op)
{
    NEXT;
}

/* ---- 64-bit products: a is the high word, imm names the low one */

static inline void set_wide(struct board *b, const struct op *op, uint64_t value)
{
    R(op->imm) = (uint32_t)value;
    R(op->a) = (uint32_t)(value >> 32);
}

static inline uint64_t wide(const struct board *b, const struct op *op)
{
    return (uint64_t)R(op->a) << 32 | R(op->imm);
}

static inline uint64_t signed_product(const struct board *b, const struct op *op)
{
    return (uint64_t)((int64_t)(int32_t)R(op->b) * (int32_t)R(op->c));
}

void op_umull(struct board *b, struct op *op)
{
    set_wide(b, op, (uint64_t)R(op->b) * R(op->c));
    NEXT;
}

void op_smull(struct board *b, struct op *op)
{
    set_wide(b, op, signed_product(b, op));
    NEXT;
}

void op_umlal(struct board *b, struct op *op)
{
    set_wide(b, op, wide(b, op) + (uint64_t)R(op->b) * R(op->c));
    NEXT;
}

void op_smlal(struct board *b, struct op *op)
{
    set_wide(b, op, wide(b, op) + signed_product(b, op));
    NEXT;
}

/* ---- products of half-words: bits 5 and 4 of imm choose the upper ones */

static inline int32_t half(uint32_t value, bool upper)
{
    return (int16_t)(upper ? value >> 16 : value);
}

static inline int32_t half_product(const struct board *b, const struct op *op)
{
    return half(R(op->b), (op->imm & 0x20u) != 0) * half(R(op->c), (op->imm & 0x10u) != 0);
}

void op_smul_half(struct board *b, struct op *op)
{
    R(op->a) = (uint32_t)half_product(b, op);
    NEXT;
}

void op_smla_half(struct board *b, struct op *op)
{
    const int64_t sum = (int64_t)half_product(b, op) + (int32_t)R(op->imm & 15u);
    if (sum != (int32_t)sum) {
        b->core.xpsr |= 1u << 27; /* Q */
    }
    R(op->a) = (uint32_t)sum;
    NEXT;
}

/* ---- special registers, in privileged code; unprivileged, the engine has them (PM0214 2.1.3) */

static uint32_t special(struct board *b, uint32_t number)
{
    switch (number) {
    case 5:
        return cpu_get(b, UC_ARM_REG_IPSR);
    case 8:
        return cpu_get(b, UC_ARM_REG_MSP);
    case 9:
        return cpu_get(b, UC_ARM_REG_PSP);
    case 16:
        return b->core.primask;
    case 17:
        return b->core.basepri;
    case 19:
        return b->core.faultmask;
    default:
        return b->core.control;
    }
}

void op_mrs(struct board *b, struct op *op)
{
    if ((b->core.control & CONTROL_NPRIV) != 0) {
        thumb_escape(b, op);
        return;
    }
    R(op->a) = special(b, op->imm);
    NEXT;
}

void op_msr_primask(struct board *b, struct op *op)
{
    if ((b->core.control & CONTROL_NPRIV) != 0) {
        thumb_escape(b, op);
        return;
    }
    b->core.primask = R(op->a) & 1u;
    NEXT;
}

void op_msr_basepri(struct board *b, struct op *op)
{
    if ((b->core.control & CONTROL_NPRIV) != 0) {
        thumb_escape(b, op);
        return;
    }
    b->core.basepri = R(op->a) & 0xFFu;
    NEXT;
}

/* CPSIE and CPSID: b changes PRIMASK, c FAULTMASK. */
void op_cps(struct board *b, struct op *op)
{
    if ((b->core.control & CONTROL_NPRIV) != 0) {
        thumb_escape(b, op);
        return;
    }
    b->core.primask = op->b != 0 ? op->a : b->core.primask;
    b->core.faultmask = op->c != 0 ? op->a : b->core.faultmask;
    NEXT;
}
