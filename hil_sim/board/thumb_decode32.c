/* Decodes the 32-bit instructions (ARMv7-M Architecture Reference Manual, A5.3); those of the FPU are
 * elsewhere. */
#include "thumb.h"

enum { LSL, LSR, ASR, ROR };

static bool is_special(unsigned reg)
{
    return reg == REG_SP || reg == REG_PC;
}

static uint32_t bits(uint32_t value, unsigned low, unsigned count)
{
    return value >> low & ((1u << count) - 1u);
}

/* ---- loads and stores of several registers */

bool decode_block_transfer(struct decoder *d, unsigned base, uint32_t list, bool load, bool down,
                           bool writeback)
{
    if ((list & 0xFFFFu) == 0 || (list & 1u << REG_SP) != 0) {
        return false;
    }
    const uint32_t size = 4 * (uint32_t)__builtin_popcount(list);
    decode_emit(d, load ? op_ldm : op_stm, base, writeback, down, list | size << 16);
    if (load && (list & 1u << REG_PC) != 0) {
        decode_emit(d, op_branch_temp, 0, 0, 0, 0);
        d->ended = true;
    }
    return true;
}

static bool several(struct decoder *d, uint32_t high, uint32_t low)
{
    const unsigned base = high & 15u;
    const bool load = (high & 0x10u) != 0;
    const bool writeback = (high & 0x20u) != 0;
    const unsigned order = bits(high, 7, 2);
    const bool legal = order == 1 || order == 2;
    const bool two_ways_on = (low & 0xC000u) == 0xC000u || (!load && (low & 0x8000u) != 0);
    if (!legal || base == REG_PC || two_ways_on || __builtin_popcount(low) < 2 ||
        (writeback && (low >> base & 1u) != 0)) {
        return false;
    }
    return decode_block_transfer(d, base, low, load, order == 2, writeback);
}

static bool table_branch(struct decoder *d, uint32_t high, uint32_t low)
{
    unsigned base = high & 15u;
    if ((high & 0xFFF0u) != 0xE8D0u || (low & 0xFFE0u) != 0xF000u || is_special(low & 15u) ||
        base == REG_SP) {
        return false;
    }
    if (base == REG_PC) {
        decode_emit(d, op_mov_i, REG_TEMP, 0, 0, decode_pc(d));
        base = REG_TEMP;
    }
    decode_emit(d, (low & 0x10u) != 0 ? op_tbh : op_tbb, base, low & 15u, 0, decode_pc(d));
    d->ended = true;
    return true;
}

static bool pair(struct decoder *d, uint32_t high, uint32_t low)
{
    const unsigned base = high & 15u;
    const unsigned first = low >> 12;
    const unsigned second = bits(low, 8, 4);
    const bool before = (high & 0x100u) != 0;
    const bool writeback = (high & 0x20u) != 0;
    const bool load = (high & 0x10u) != 0;
    if (!before && !writeback) {
        return table_branch(d, high, low);
    }
    if (base == REG_PC || is_special(first) || is_special(second) || (load && first == second) ||
        (writeback && (base == first || base == second))) {
        return false;
    }
    uint32_t offset = 4 * (low & 0xFFu);
    offset = (high & 0x80u) != 0 ? offset : 0u - offset;
    decode_emit(d, load ? op_ldrd : op_strd, first, base, second, before ? offset : 0);
    if (writeback) {
        decode_emit(d, op_add_i, base, base, 0, offset);
    }
    return true;
}

/* ---- data processing */

struct family {
    op_function *reg, *imm, *reg_s, *imm_s;
    op_function *compare, *compare_imm; /* where the result goes nowhere */
    bool logical;                       /* takes the shifter's carry */
};
#define FAMILY(name)  .reg = op_##name, .imm = op_##name##_i, .reg_s = op_##name##_s, .imm_s = op_##name##_s_i
#define COMPARE(name) .compare = op_##name, .compare_imm = op_##name##_i
static const struct family families[16] = {
    [0] = {FAMILY(and), COMPARE(tst), .logical = true},
    [1] = {FAMILY(bic), .logical = true},
    [2] = {FAMILY(orr), .logical = true},
    [3] = {FAMILY(orn), .logical = true},
    [4] = {FAMILY(eor), COMPARE(teq), .logical = true},
    [8] = {FAMILY(add), COMPARE(cmn)},
    [10] = {FAMILY(adc)},
    [11] = {FAMILY(sbc)},
    [13] = {FAMILY(sub), COMPARE(cmp)},
    [14] = {FAMILY(rsb)},
};
static const struct family moves = {FAMILY(mov), .logical = true};
static const struct family inverted_moves = {FAMILY(mvn), .logical = true};

/* NULL: not interpreted. */
static const struct family *family_of(unsigned code, unsigned rn, unsigned rd, bool flags)
{
    const struct family *family = &families[code];
    if (rn == REG_PC && code == 2) {
        family = &moves;
    } else if (rn == REG_PC && code == 3) {
        family = &inverted_moves;
    } else if (rn == REG_PC) {
        return NULL;
    }
    if (family->reg == NULL || (rd == REG_PC && (!flags || family->compare == NULL))) {
        return NULL;
    }
    return family;
}

static op_function *shift_by_constant(unsigned type, bool flags, bool carry_alone)
{
    static op_function *const shifts[][3] = {{op_lsl_i, op_lsl_s_i, op_lsl_c_i},
                                             {op_lsr_i, op_lsr_s_i, op_lsr_c_i},
                                             {op_asr_i, op_asr_s_i, op_asr_c_i},
                                             {op_ror_i, op_ror_s_i, op_ror_c_i}};
    return shifts[type][carry_alone ? 2 : flags ? 1 : 0];
}

static bool shifted_register(struct decoder *d, uint32_t high, uint32_t low)
{
    const bool flags = (high & 0x10u) != 0;
    const unsigned rn = high & 15u;
    const unsigned rd = bits(low, 8, 4);
    unsigned rm = low & 15u;
    const unsigned type = bits(low, 4, 2);
    uint32_t amount = bits(low, 12, 3) << 2 | bits(low, 6, 2);
    const struct family *family = family_of(bits(high, 5, 4), rn, rd, flags);
    if (family == NULL || rm == REG_PC || (low & 0x8000u) != 0 || (type == ROR && amount == 0)) {
        return false;
    }
    amount = amount == 0 && type != LSL ? 32 : amount;
    if (amount != 0 && family == &moves) {
        decode_emit(d, shift_by_constant(type, flags, false), rd, rm, 0, amount);
        return true;
    }
    if (amount != 0) {
        decode_emit(d, shift_by_constant(type, false, flags && family->logical), REG_TEMP, rm, 0, amount);
        rm = REG_TEMP;
    }
    if (rd == REG_PC) {
        decode_emit(d, family->compare, 0, rn, rm, 0);
    } else {
        decode_emit(d, flags ? family->reg_s : family->reg, rd, rn, rm, 0);
    }
    return true;
}

/* ThumbExpandImm: a byte in one of three patterns, or rotated (A5.3.2). */
static uint32_t expand(uint32_t high, uint32_t low, bool *rotated)
{
    const uint32_t code = bits(high, 10, 1) << 11 | bits(low, 12, 3) << 8 | (low & 0xFFu);
    const uint32_t byte = code & 0xFFu;
    *rotated = code >> 10 != 0;
    if (*rotated) {
        const uint32_t value = 0x80u | (code & 0x7Fu);
        const uint32_t by = code >> 7;
        return value >> by | value << (32 - by);
    }
    switch (code >> 8 & 3u) {
    case 0:
        return byte;
    case 1:
        return byte << 16 | byte;
    case 2:
        return byte << 24 | byte << 8;
    default:
        return byte * 0x01010101u;
    }
}

static bool modified_constant(struct decoder *d, uint32_t high, uint32_t low)
{
    const bool flags = (high & 0x10u) != 0;
    const unsigned rn = high & 15u;
    const unsigned rd = bits(low, 8, 4);
    const struct family *family = family_of(bits(high, 5, 4), rn, rd, flags);
    if (family == NULL) {
        return false;
    }
    bool rotated;
    const uint32_t value = expand(high, low, &rotated);
    if (rotated && flags && family->logical) {
        decode_emit(d, op_set_carry, 0, 0, 0, value >> 31);
    }
    if (rd == REG_PC) {
        decode_emit(d, family->compare_imm, 0, rn, 0, value);
    } else {
        decode_emit(d, flags ? family->imm_s : family->imm, rd, rn, 0, value);
    }
    return true;
}

static bool bit_field(struct decoder *d, uint32_t high, uint32_t low)
{
    const unsigned code = bits(high, 4, 5);
    unsigned rn = high & 15u;
    const unsigned rd = bits(low, 8, 4);
    const unsigned lsb = bits(low, 12, 3) << 2 | bits(low, 6, 2);
    const unsigned last = low & 31u;
    if (is_special(rd) || rn == REG_SP || (low & 0x20u) != 0 || (high & 0x400u) != 0) {
        return false;
    }
    if (code == 22) {
        if (last < lsb) {
            return false;
        }
        if (rn == REG_PC) {
            decode_emit(d, op_mov_i, REG_TEMP, 0, 0, 0);
            rn = REG_TEMP;
        }
        decode_emit(d, op_bfi, rd, rn, lsb, ((2u << (last - lsb)) - 1u) << lsb);
        return true;
    }
    if (rn == REG_PC || lsb + last > 31) {
        return false;
    }
    decode_emit(d, code == 28 ? op_ubfx : op_sbfx, rd, rn, lsb, last + 1);
    return true;
}

static bool plain_constant(struct decoder *d, uint32_t high, uint32_t low)
{
    const unsigned rn = high & 15u;
    const unsigned rd = bits(low, 8, 4);
    const uint32_t value = bits(high, 10, 1) << 11 | bits(low, 12, 3) << 8 | (low & 0xFFu);
    const unsigned code = bits(high, 4, 5);
    if (rd == REG_PC) {
        return false;
    }
    switch (code) {
    case 0:
    case 10: {
        const uint32_t change = code == 0 ? value : 0u - value;
        if (rn == REG_PC) {
            decode_emit(d, op_mov_i, rd, 0, 0, (decode_pc(d) & ~3u) + change);
        } else {
            decode_emit(d, op_add_i, rd, rn, 0, change);
        }
        return true;
    }
    case 4:
    case 12:
        if (rd == REG_SP) {
            return false;
        }
        decode_emit(d, code == 4 ? op_mov_i : op_movt, rd, rd, 0, rn << 12 | value);
        return true;
    case 20:
    case 22:
    case 28:
        return bit_field(d, high, low);
    default:
        return false;
    }
}

static bool by_register(struct decoder *d, uint32_t high, uint32_t low)
{
    static op_function *const shifts[][2] = {
        {op_lsl, op_lsl_s}, {op_lsr, op_lsr_s}, {op_asr, op_asr_s}, {op_ror, op_ror_s}};
    static op_function *const extends[8] = {[0] = op_sxth, [1] = op_uxth, [4] = op_sxtb, [5] = op_uxtb};
    static op_function *const reverses[] = {op_rev, op_rev16, op_rbit, op_revsh};
    const unsigned code = bits(high, 4, 4);
    const unsigned kind = bits(low, 4, 4);
    const unsigned rn = high & 15u;
    const unsigned rd = bits(low, 8, 4);
    const unsigned rm = low & 15u;
    if ((low & 0xF000u) != 0xF000u || is_special(rd) || is_special(rm) || rn == REG_SP) {
        return false;
    }
    if (code < 8 && kind == 0 && rn != REG_PC) {
        decode_emit(d, shifts[code >> 1][code & 1u], rd, rn, rm, 0);
    } else if (code < 8 && (kind & 0xCu) == 8 && extends[code] != NULL) {
        decode_emit(d, extends[code], rn == REG_PC ? rd : REG_TEMP, 0, rm, 8 * (kind & 3u));
        if (rn != REG_PC) {
            decode_emit(d, op_add, rd, rn, REG_TEMP, 0);
        }
    } else if (code == 9 && (kind & 0xCu) == 8 && rn == rm) {
        decode_emit(d, reverses[kind & 3u], rd, 0, rm, 0);
    } else if (code == 11 && kind == 8 && rn == rm) {
        decode_emit(d, op_clz, rd, 0, rm, 0);
    } else {
        return false;
    }
    return true;
}

/* ---- multiply and divide */

static bool multiply(struct decoder *d, uint32_t high, uint32_t low)
{
    const unsigned rn = high & 15u;
    const unsigned ra = low >> 12;
    const unsigned rd = bits(low, 8, 4);
    const unsigned rm = low & 15u;
    const unsigned kind = bits(low, 4, 4);
    const unsigned code = bits(high, 4, 3);
    if (is_special(rn) || is_special(rd) || is_special(rm) || ra == REG_SP || kind > 3) {
        return false;
    }
    if (code == 0 && kind == 0) {
        decode_emit(d, ra == REG_PC ? op_mul : op_mla, rd, rn, rm, ra);
        return true;
    }
    if (code == 0 && kind == 1 && ra != REG_PC) {
        decode_emit(d, op_mls, rd, rn, rm, ra);
        return true;
    }
    if (code == 1) {
        decode_emit(d, ra == REG_PC ? op_smul_half : op_smla_half, rd, rn, rm, ra | kind << 4);
        return true;
    }
    return false;
}

static bool multiply_long(struct decoder *d, uint32_t high, uint32_t low)
{
    const unsigned rn = high & 15u;
    const unsigned rd_low = low >> 12;
    const unsigned rd = bits(low, 8, 4);
    const unsigned rm = low & 15u;
    const unsigned kind = bits(low, 4, 4);
    const unsigned code = bits(high, 4, 3);
    if (is_special(rn) || is_special(rd) || is_special(rm)) {
        return false;
    }
    if (kind == 15 && (code == 1 || code == 3) && rd_low == 15) {
        decode_emit(d, code == 1 ? op_sdiv : op_udiv, rd, rn, rm, 0);
        return true;
    }
    static op_function *const longs[8] = {[0] = op_smull, [2] = op_umull, [4] = op_smlal, [6] = op_umlal};
    if (kind != 0 || longs[code] == NULL || is_special(rd_low) || rd_low == rd) {
        return false;
    }
    decode_emit(d, longs[code], rd, rn, rm, rd_low);
    return true;
}

/* ---- branches and special registers */

static bool barrier(struct decoder *d, uint32_t low)
{
    switch (low >> 4) {
    case 0x8F4:
    case 0x8F5: /* DSB, DMB */
        decode_emit(d, op_nop, 0, 0, 0, 0);
        return true;
    case 0x8F6: /* ISB: the engine ends the block here */
        if (decode_in_it(d)) {
            return false;
        }
        decode_jump(d, d->pc + 4);
        return true;
    default:
        return false;
    }
}

static bool special_register(struct decoder *d, uint32_t high, uint32_t low)
{
    const unsigned number = low & 0xFFu;
    if (high == 0xF3BFu) {
        return barrier(d, low);
    }
    if (high == 0xF3AFu && low == 0x8000u) {
        decode_emit(d, op_nop, 0, 0, 0, 0);
        return true;
    }
    if (decode_in_it(d)) {
        return false;
    }
    if (high == 0xF3EFu && (low & 0xF000u) == 0x8000u && !is_special(bits(low, 8, 4))) {
        const bool known = number == 5 || number == 8 || number == 9 || number == 16 || number == 17 ||
                           number == 19 || number == 20;
        decode_emit(d, op_mrs, bits(low, 8, 4), 0, 0, number);
        return known;
    }
    if ((high & 0xFFF0u) == 0xF380u && (low & 0xFF00u) == 0x8800u && !is_special(high & 15u) &&
        (number == 16 || number == 17)) {
        decode_emit(d, number == 16 ? op_msr_primask : op_msr_basepri, high & 15u, 0, 0, 0);
        decode_jump(d, d->pc + 4);
        return true;
    }
    return false;
}

static uint32_t sign_extend(uint32_t value, unsigned width)
{
    const uint32_t sign = 1u << (width - 1);
    return (value ^ sign) - sign;
}

static bool branch(struct decoder *d, uint32_t high, uint32_t low)
{
    const uint32_t s = bits(high, 10, 1);
    const uint32_t j1 = bits(low, 13, 1);
    const uint32_t j2 = bits(low, 11, 1);
    if ((low & 0xD000u) == 0x8000u) {
        const unsigned condition = bits(high, 6, 4);
        if (condition >= 14) {
            return special_register(d, high, low);
        }
        const uint32_t distance = s << 20 | j2 << 19 | j1 << 18 | (high & 0x3Fu) << 12 | (low & 0x7FFu) << 1;
        if (decode_in_it(d)) {
            return false;
        }
        decode_branch_if(d, condition, decode_pc(d) + sign_extend(distance, 21));
        return true;
    }
    if ((low & 0xD000u) == 0xC000u) {
        return false;
    }
    const uint32_t i1 = (j1 ^ s) ^ 1u;
    const uint32_t i2 = (j2 ^ s) ^ 1u;
    const uint32_t distance = s << 24 | i1 << 23 | i2 << 22 | (high & 0x3FFu) << 12 | (low & 0x7FFu) << 1;
    if ((low & 0x4000u) != 0) {
        decode_emit(d, op_mov_i, REG_LR, 0, 0, (d->pc + 4) | 1u);
    }
    decode_jump(d, decode_pc(d) + sign_extend(distance, 25));
    return true;
}

/* ---- loads and stores of one register */

bool decode_load_pc(struct decoder *d, unsigned base, uint32_t offset, uint32_t writeback)
{
    decode_emit(d, op_ldr_pc, 0, base, 0, offset);
    if (writeback != 0) {
        decode_emit(d, op_add_i, base, base, 0, writeback);
    }
    decode_emit(d, op_branch_temp, 0, 0, 0, 0);
    d->ended = true;
    return true;
}

static op_function *transfer_of(uint32_t high)
{
    static op_function *const stores[] = {op_strb, op_strh, op_str, NULL};
    static op_function *const loads[] = {op_ldrb, op_ldrh, op_ldr, NULL};
    static op_function *const signed_loads[] = {op_ldrsb, op_ldrsh, NULL, NULL};
    const unsigned size = bits(high, 5, 2);
    const bool has_sign = (high & 0x100u) != 0;
    if ((high & 0x10u) == 0) {
        return has_sign ? NULL : stores[size];
    }
    return has_sign ? signed_loads[size] : loads[size];
}

/* From a constant beside the code; registers are better off with the value itself. */
static bool load_literal(struct decoder *d, uint32_t high, uint32_t low)
{
    const unsigned size = 1u << bits(high, 5, 2);
    const uint32_t offset = low & 0xFFFu;
    const uint32_t base = decode_pc(d) & ~3u;
    uint32_t value;
    if (is_special(low >> 12) ||
        !decode_literal(d, (high & 0x80u) != 0 ? base + offset : base - offset, size, &value)) {
        return false;
    }
    value = (high & 0x100u) != 0 ? sign_extend(value, 8 * size) : value;
    decode_emit(d, op_mov_i, low >> 12, 0, 0, value);
    return true;
}

struct transfer {
    op_function *run;
    unsigned rt, base;
    bool load_pc;
};

static bool emit_transfer(struct decoder *d, const struct transfer *t, uint32_t offset, uint32_t writeback)
{
    if (t->load_pc) {
        return decode_load_pc(d, t->base, offset, writeback);
    }
    decode_emit(d, t->run, t->rt, t->base, 0, offset);
    if (writeback != 0) {
        decode_emit(d, op_add_i, t->base, t->base, 0, writeback);
    }
    return true;
}

static bool indexed(struct decoder *d, struct transfer *t, uint32_t low)
{
    const bool before = (low & 0x400u) != 0;
    const bool writeback = (low & 0x100u) != 0;
    const uint32_t size = low & 0xFFu;
    const uint32_t offset = (low & 0x200u) != 0 ? size : 0u - size;
    const bool unprivileged = (low & 0x700u) == 0x600u;
    if (unprivileged || (!before && !writeback) || (writeback && t->rt == t->base)) {
        return false;
    }
    return emit_transfer(d, t, before ? offset : 0, writeback ? offset : 0);
}

static bool single(struct decoder *d, uint32_t high, uint32_t low)
{
    struct transfer t = {.run = transfer_of(high), .rt = low >> 12, .base = high & 15u};
    const bool load = (high & 0x10u) != 0;
    t.load_pc = t.run == op_ldr && t.rt == REG_PC;
    if (t.run == NULL || (t.rt == REG_PC && !t.load_pc) || (t.rt == REG_SP && t.run != op_ldr)) {
        return false;
    }
    if (t.base == REG_PC) {
        return load && load_literal(d, high, low);
    }
    if ((high & 0x80u) != 0) {
        return emit_transfer(d, &t, low & 0xFFFu, 0);
    }
    if ((low & 0x800u) != 0) {
        return indexed(d, &t, low);
    }
    if ((low & 0x7C0u) != 0 || is_special(low & 15u)) {
        return false;
    }
    decode_emit(d, op_address, REG_TEMP, t.base, low & 15u, bits(low, 4, 2));
    t.base = REG_TEMP;
    return emit_transfer(d, &t, 0, 0);
}

bool decode_32(struct decoder *d, uint32_t high, uint32_t low)
{
    if ((high & 0xEC00u) == 0xEC00u) {
        return decode_fp(d, high, low);
    }
    switch (high >> 9 & 0xFu) {
    case 4: /* 1110 100x */
        return (high & 0x40u) == 0 ? several(d, high, low) : pair(d, high, low);
    case 5:
        return shifted_register(d, high, low);
    case 8:
    case 9:
    case 10:
    case 11: /* 1111 0xxx */
        if ((low & 0x8000u) != 0) {
            return branch(d, high, low);
        }
        return (high & 0x200u) == 0 ? modified_constant(d, high, low) : plain_constant(d, high, low);
    case 12: /* 1111 100x */
        return single(d, high, low);
    default: /* 1111 101x */
        if ((high & 0x100u) == 0) {
            return by_register(d, high, low);
        }
        return (high & 0x80u) == 0 ? multiply(d, high, low) : multiply_long(d, high, low);
    }
}
