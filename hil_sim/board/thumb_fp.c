/* Single-precision arithmetic: decoded and executed with the host's own, wherever its result and its flags
 * are the same for sure. NaNs, infinities, results too small to be normal, other rounding modes: the engine
 * has them. */
#include <float.h>
#include <math.h>

#include "thumb.h"

#define FPSCR_INEXACT  (1u << 4)
#define FPSCR_MODES    0x07C00000u /* AHP, DN, FZ, RMode: all clear is IEEE 754, to nearest */
#define FPSCR_NEGATIVE 0x80000000u
#define FPSCR_EQUAL    0x60000000u
#define FPSCR_GREATER  0x20000000u
#define FPSCR_FLAGS    0xF0000000u
#define TWO_TO_31      2147483648.0f
#define TWO_TO_32      4294967296.0f
#define SIGN           0x80000000u
#define S(index)       (b->core.s[index])

/* ---- decoding */

static struct op *emit_fp(struct decoder *d, op_function *run, unsigned a, unsigned b, unsigned c,
                          uint32_t imm)
{
    if (!d->fp_begun) {
        d->fp_begun = true;
        decode_emit(d, op_fp_begin, 0, 0, 0, 0);
    }
    return decode_emit(d, run, a, b, c, imm);
}

/* VFPExpandImm for single precision (A6.4.1). */
static uint32_t expand(uint32_t byte)
{
    const uint32_t exponent = (byte & 0x40u) != 0 ? 0x7Cu : 0x80u;
    return (byte & 0x80u) << 24 | (exponent | (byte >> 4 & 3u)) << 23 | (byte & 0xFu) << 19;
}

static bool one_operand(struct decoder *d, uint32_t high, uint32_t low, unsigned sd, unsigned sm)
{
    const unsigned code = (high & 15u) << 1 | (low >> 7 & 1u);
    switch (code) {
    case 0:
        emit_fp(d, op_fmov, sd, 0, sm, 0);
        return true;
    case 1:
        emit_fp(d, op_fabs, sd, 0, sm, 0);
        return true;
    case 2:
        emit_fp(d, op_fneg, sd, 0, sm, 0);
        return true;
    case 8:
    case 9:
        emit_fp(d, op_fcmp, sd, 0, sm, 0);
        return true;
    case 10:
    case 11:
        emit_fp(d, op_fcmp_zero, sd, 0, 0, 0);
        return (low & 0x2Fu) == 0;
    case 16:
    case 17:
        emit_fp(d, code == 17 ? op_f_from_s : op_f_from_u, sd, 0, sm, 0);
        return true;
    case 25:
    case 27:
        emit_fp(d, code == 27 ? op_f_to_s : op_f_to_u, sd, 0, sm, 0);
        return true;
    default:
        return false;
    }
}

static bool arithmetic(struct decoder *d, uint32_t high, uint32_t low)
{
    const unsigned sd = (low >> 12) << 1 | (high >> 6 & 1u);
    const unsigned sn = (high & 15u) << 1 | (low >> 7 & 1u);
    const unsigned sm = (low & 15u) << 1 | (low >> 5 & 1u);
    const bool second = (low & 0x40u) != 0;
    switch (high & 0xB0u) {
    case 0x20:
        emit_fp(d, second ? op_fnmul : op_fmul, sd, sn, sm, 0);
        return true;
    case 0x30:
        emit_fp(d, second ? op_fsub : op_fadd, sd, sn, sm, 0);
        return true;
    case 0x80:
        emit_fp(d, op_fdiv, sd, sn, sm, 0);
        return !second;
    case 0xB0:
        if (second) {
            return one_operand(d, high, low, sd, sm);
        }
        emit_fp(d, op_fmov_i, sd, 0, 0, expand((high & 15u) << 4 | (low & 15u)));
        return (low & 0xA0u) == 0;
    default:
        return false;
    }
}

static bool move(struct decoder *d, uint32_t high, uint32_t low)
{
    const unsigned rt = low >> 12;
    if (high == 0xEEF1u && (low & 0xFFFu) == 0xA10u) {
        struct op *last = d->count != 0 ? &d->ops[d->count - 1] : NULL;
        const bool apart = last == NULL || d->after_it || decode_in_it(d) || rt != REG_PC;
        if (!apart && (last->run == op_fcmp || last->run == op_fcmp_zero)) {
            last->run = last->run == op_fcmp ? op_fcmp_to_flags : op_fcmp_zero_to_flags;
            return true;
        }
        emit_fp(d, rt == REG_PC ? op_vmrs_flags : op_vmrs, rt, 0, 0, 0);
        return rt != REG_SP;
    }
    if ((high & 0xFFE0u) != 0xEE00u || (low & 0xF7Fu) != 0xA10u || rt == REG_SP || rt == REG_PC) {
        return false;
    }
    emit_fp(d, (high & 0x10u) != 0 ? op_f_to_core : op_f_from_core, rt, (high & 15u) << 1 | (low >> 7 & 1u),
            0, 0);
    return true;
}

static bool transfer(struct decoder *d, uint32_t high, uint32_t low)
{
    const bool load = (high & 0x10u) != 0;
    const bool writeback = (high & 0x20u) != 0;
    const bool up = (high & 0x80u) != 0;
    const bool before = (high & 0x100u) != 0;
    const bool doubles = (low & 0x100u) != 0;
    unsigned base = high & 15u;
    const unsigned first =
        doubles ? 2 * ((high >> 2 & 0x10u) | low >> 12) : (low >> 12) << 1 | (high >> 6 & 1u);
    const uint32_t words = low & 0xFFu;
    if (before && !writeback) {
        uint32_t offset = up ? 4 * words : 0u - 4 * words;
        const unsigned count = doubles ? 2 : 1;
        if (first + count > FP_SINGLES || (base == REG_PC && !load)) {
            return false;
        }
        if (base == REG_PC) {
            uint32_t value;
            if (doubles || !decode_literal(d, (decode_pc(d) & ~3u) + offset, 4, &value)) {
                return false;
            }
            emit_fp(d, op_fmov_i, first, 0, 0, value);
            return true;
        }
        if (doubles) {
            emit_fp(d, load ? op_vldm : op_vstm, first, base, 2, offset);
        } else {
            emit_fp(d, load ? op_vldr : op_vstr, first, base, 0, offset);
        }
        return true;
    }
    const bool legal = up != before && (up || writeback); /* increment after, or decrement before */
    if (!legal || base == REG_PC || words == 0 || first + words > FP_SINGLES ||
        (doubles && (words & 1u) != 0)) {
        return false;
    }
    emit_fp(d, load ? op_vldm : op_vstm, first, base, words, up ? 0 : 0u - 4 * words);
    if (writeback) {
        decode_emit(d, op_add_i, base, base, 0, up ? 4 * words : 0u - 4 * words);
    }
    return true;
}

bool decode_fp(struct decoder *d, uint32_t high, uint32_t low)
{
    const bool single = (low & 0xF00u) == 0xA00u;
    if ((high & 0xFE00u) == 0xEC00u && (single || (low & 0xF00u) == 0xB00u)) {
        const bool between_registers = (high & 0x1A0u) == 0;
        return !between_registers && transfer(d, high, low);
    }
    if ((high & 0xFF00u) != 0xEE00u || !single) {
        return false;
    }
    return (low & 0x10u) != 0 ? move(d, high, low) : arithmetic(d, high, low);
}

/* ---- execution */

static float number(uint32_t word)
{
    float value;
    memcpy(&value, &word, sizeof value);
    return value;
}

static uint32_t word_of(float value)
{
    uint32_t word;
    memcpy(&word, &value, sizeof word);
    return word;
}

/* The first use since the last exception began a new FP context: FPDSCR, which the engine holds at zero,
 * becomes FPSCR. */
void op_fp_begin(struct board *b, struct op *op)
{
    if ((b->core.control & CONTROL_FPCA) == 0) {
        b->core.control |= CONTROL_FPCA;
        b->core.fpscr = 0;
    }
    NEXT;
}

enum { ADD, SUBTRACT, MULTIPLY, DIVIDE };

static inline float combine(int kind, float x, float y)
{
    return kind == ADD ? x + y : kind == SUBTRACT ? x - y : kind == MULTIPLY ? x * y : x / y;
}

/* Exact whatever the flags say: a sum that is not normal always is, a product or quotient where it is zero
 * for a zero's sake. */
static inline bool is_sure(int kind, float x, float y, float result)
{
    if (!isfinite(result)) {
        return false;
    }
    if (kind == ADD || kind == SUBTRACT || fabsf(result) > FLT_MIN) {
        return true;
    }
    return x == 0.0f || (kind == MULTIPLY && y == 0.0f);
}

/* Whether nothing was rounded off. What a sum lost is a number itself (Knuth's two-sum); a product of two
 * single numbers fits a double. */
static bool is_exact(int kind, float x, float y, float result)
{
    if (kind == MULTIPLY) {
        return (double)x * y == (double)result;
    }
    if (kind == DIVIDE) { /* zero by infinity too */
        return x == 0.0f || (double)result * y == (double)x;
    }
    const float second = kind == ADD ? y : -y;
    const float gained = result - x;
    return (x - (result - gained)) + (second - gained) == 0.0f;
}

static inline void calculate(struct board *b, struct op *op, int kind, uint32_t sign)
{
    const float x = number(S(op->b));
    const float y = number(S(op->c));
    const float result = combine(kind, x, y);
    if ((b->core.fpscr & FPSCR_MODES) != 0 || !is_sure(kind, x, y, result)) {
        thumb_escape(b, op);
        return;
    }
    if ((b->core.fpscr & FPSCR_INEXACT) == 0 && !is_exact(kind, x, y, result)) {
        b->core.fpscr |= FPSCR_INEXACT;
    }
    S(op->a) = word_of(result) ^ sign;
    NEXT;
}

void op_fadd(struct board *b, struct op *op)
{
    calculate(b, op, ADD, 0);
}

void op_fsub(struct board *b, struct op *op)
{
    calculate(b, op, SUBTRACT, 0);
}

void op_fmul(struct board *b, struct op *op)
{
    calculate(b, op, MULTIPLY, 0);
}

void op_fnmul(struct board *b, struct op *op)
{
    calculate(b, op, MULTIPLY, SIGN);
}

void op_fdiv(struct board *b, struct op *op)
{
    calculate(b, op, DIVIDE, 0);
}

void op_fneg(struct board *b, struct op *op)
{
    S(op->a) = S(op->c) ^ SIGN;
    NEXT;
}

void op_fabs(struct board *b, struct op *op)
{
    S(op->a) = S(op->c) & ~SIGN;
    NEXT;
}

void op_fmov(struct board *b, struct op *op)
{
    S(op->a) = S(op->c);
    NEXT;
}

void op_fmov_i(struct board *b, struct op *op)
{
    S(op->a) = op->imm;
    NEXT;
}

/* False: the engine has to compare. */
static inline bool compare(struct board *b, struct op *op, float x, float y)
{
    if (isnan(x) || isnan(y) || (b->core.fpscr & FPSCR_MODES) != 0) {
        thumb_escape(b, op);
        return false;
    }
    const uint32_t flags = x < y ? FPSCR_NEGATIVE : x == y ? FPSCR_EQUAL : FPSCR_GREATER;
    b->core.fpscr = (b->core.fpscr & ~FPSCR_FLAGS) | flags;
    return true;
}

static inline void copy_flags(struct board *b)
{
    const uint32_t fpscr = b->core.fpscr;
    b->core.negative = fpscr;
    b->core.zero = (fpscr >> 30 & 1u) ^ 1u;
    b->core.carry = fpscr >> 29 & 1u;
    b->core.overflow = fpscr << 3;
}

void op_fcmp(struct board *b, struct op *op)
{
    if (compare(b, op, number(S(op->a)), number(S(op->c)))) {
        NEXT;
    }
}

void op_fcmp_zero(struct board *b, struct op *op)
{
    if (compare(b, op, number(S(op->a)), 0.0f)) {
        NEXT;
    }
}

/* With the VMRS that follows nearly always. */
void op_fcmp_to_flags(struct board *b, struct op *op)
{
    if (compare(b, op, number(S(op->a)), number(S(op->c)))) {
        copy_flags(b);
        NEXT;
    }
}

void op_fcmp_zero_to_flags(struct board *b, struct op *op)
{
    if (compare(b, op, number(S(op->a)), 0.0f)) {
        copy_flags(b);
        NEXT;
    }
}

static inline void from_integer(struct board *b, struct op *op, double integer)
{
    const float result = (float)integer;
    if ((b->core.fpscr & FPSCR_MODES) != 0) {
        thumb_escape(b, op);
        return;
    }
    b->core.fpscr |= (double)result != integer ? FPSCR_INEXACT : 0;
    S(op->a) = word_of(result);
    NEXT;
}

void op_f_from_s(struct board *b, struct op *op)
{
    from_integer(b, op, (double)(int32_t)S(op->c));
}

void op_f_from_u(struct board *b, struct op *op)
{
    from_integer(b, op, (double)S(op->c));
}

static inline void to_integer(struct board *b, struct op *op, float lowest, float beyond, bool has_sign)
{
    const float value = number(S(op->c));
    const bool fits = value >= lowest && value < beyond; /* and is no NaN */
    if (!fits || (b->core.fpscr & FPSCR_MODES) != 0) {
        thumb_escape(b, op);
        return;
    }
    const int64_t whole = (int64_t)value;
    b->core.fpscr |= (float)whole != value ? FPSCR_INEXACT : 0;
    S(op->a) = has_sign ? (uint32_t)(int32_t)whole : (uint32_t)whole;
    NEXT;
}

void op_f_to_s(struct board *b, struct op *op)
{
    to_integer(b, op, -TWO_TO_31, TWO_TO_31, true);
}

void op_f_to_u(struct board *b, struct op *op)
{
    to_integer(b, op, 0.0f, TWO_TO_32, false);
}

void op_f_from_core(struct board *b, struct op *op)
{
    S(op->b) = R(op->a);
    NEXT;
}

void op_f_to_core(struct board *b, struct op *op)
{
    R(op->a) = S(op->b);
    NEXT;
}

void op_vmrs(struct board *b, struct op *op)
{
    R(op->a) = b->core.fpscr;
    NEXT;
}

void op_vmrs_flags(struct board *b, struct op *op)
{
    copy_flags(b);
    NEXT;
}
