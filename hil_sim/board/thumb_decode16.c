/* Decodes the 16-bit instructions (ARMv7-M Architecture Reference Manual, A5.2). */
#include "thumb.h"

/* Inside an IT block these set no flags, but for comparisons. */
static op_function *pick(const struct decoder *d, op_function *plain, op_function *with_flags)
{
    return decode_in_it(d) ? plain : with_flags;
}

static bool shift_add_move(struct decoder *d, uint32_t op)
{
    const unsigned rd = op & 7u;
    const unsigned rm = op >> 3 & 7u;
    const uint32_t amount = op >> 6 & 31u;
    const unsigned high = op >> 8 & 7u;
    switch (op >> 11) {
    case 0:
        if (amount == 0) {
            decode_emit(d, pick(d, op_mov, op_mov_s), rd, 0, rm, 0);
        } else {
            decode_emit(d, pick(d, op_lsl_i, op_lsl_s_i), rd, rm, 0, amount);
        }
        return true;
    case 1:
        decode_emit(d, pick(d, op_lsr_i, op_lsr_s_i), rd, rm, 0, amount == 0 ? 32 : amount);
        return true;
    case 2:
        decode_emit(d, pick(d, op_asr_i, op_asr_s_i), rd, rm, 0, amount == 0 ? 32 : amount);
        return true;
    case 3: {
        const bool subtract = (op & 0x200u) != 0;
        const unsigned operand = op >> 6 & 7u;
        if ((op & 0x400u) != 0) {
            decode_emit(d, subtract ? pick(d, op_sub_i, op_sub_s_i) : pick(d, op_add_i, op_add_s_i), rd, rm,
                        0, operand);
        } else {
            decode_emit(d, subtract ? pick(d, op_sub, op_sub_s) : pick(d, op_add, op_add_s), rd, rm, operand,
                        0);
        }
        return true;
    }
    case 4:
        decode_emit(d, pick(d, op_mov_i, op_mov_s_i), high, 0, 0, op & 0xFFu);
        return true;
    case 5:
        decode_emit(d, op_cmp_i, 0, high, 0, op & 0xFFu);
        return true;
    case 6:
        decode_emit(d, pick(d, op_add_i, op_add_s_i), high, high, 0, op & 0xFFu);
        return true;
    default:
        decode_emit(d, pick(d, op_sub_i, op_sub_s_i), high, high, 0, op & 0xFFu);
        return true;
    }
}

static bool data_processing(struct decoder *d, uint32_t op)
{
    const unsigned rd = op & 7u;
    const unsigned rm = op >> 3 & 7u;
    switch (op >> 6 & 15u) {
    case 0:
        decode_emit(d, pick(d, op_and, op_and_s), rd, rd, rm, 0);
        return true;
    case 1:
        decode_emit(d, pick(d, op_eor, op_eor_s), rd, rd, rm, 0);
        return true;
    case 2:
        decode_emit(d, pick(d, op_lsl, op_lsl_s), rd, rd, rm, 0);
        return true;
    case 3:
        decode_emit(d, pick(d, op_lsr, op_lsr_s), rd, rd, rm, 0);
        return true;
    case 4:
        decode_emit(d, pick(d, op_asr, op_asr_s), rd, rd, rm, 0);
        return true;
    case 5:
        decode_emit(d, pick(d, op_adc, op_adc_s), rd, rd, rm, 0);
        return true;
    case 6:
        decode_emit(d, pick(d, op_sbc, op_sbc_s), rd, rd, rm, 0);
        return true;
    case 7:
        decode_emit(d, pick(d, op_ror, op_ror_s), rd, rd, rm, 0);
        return true;
    case 8:
        decode_emit(d, op_tst, 0, rd, rm, 0);
        return true;
    case 9:
        decode_emit(d, pick(d, op_rsb_i, op_rsb_s_i), rd, rm, 0, 0);
        return true;
    case 10:
        decode_emit(d, op_cmp, 0, rd, rm, 0);
        return true;
    case 11:
        decode_emit(d, op_cmn, 0, rd, rm, 0);
        return true;
    case 12:
        decode_emit(d, pick(d, op_orr, op_orr_s), rd, rd, rm, 0);
        return true;
    case 13:
        decode_emit(d, pick(d, op_mul, op_muls), rd, rd, rm, 0);
        return true;
    case 14:
        decode_emit(d, pick(d, op_bic, op_bic_s), rd, rd, rm, 0);
        return true;
    default:
        decode_emit(d, pick(d, op_mvn, op_mvn_s), rd, 0, rm, 0);
        return true;
    }
}

static bool high_registers(struct decoder *d, uint32_t op)
{
    const unsigned rm = op >> 3 & 15u;
    const unsigned rd = (op & 7u) | (op >> 4 & 8u);
    const unsigned kind = op >> 8 & 3u;
    if (kind == 3) {
        if (rm == REG_PC || (op & 7u) != 0) {
            return false;
        }
        decode_emit(d, (op & 0x80u) != 0 ? op_blx : op_bx, rm, 0, 0, d->pc + 2);
        d->ended = true;
        return true;
    }
    if (rd == REG_PC || rm == REG_PC) {
        return false;
    }
    if (kind == 1) {
        decode_emit(d, op_cmp, 0, rd, rm, 0);
        return true;
    }
    if (kind == 0) {
        decode_emit(d, op_add, rd, rd, rm, 0);
    } else {
        decode_emit(d, op_mov, rd, 0, rm, 0);
    }
    return true;
}

static bool by_register_offset(struct decoder *d, uint32_t op)
{
    static op_function *const kinds[] = {op_str, op_strh, op_strb, op_ldrsb,
                                         op_ldr, op_ldrh, op_ldrb, op_ldrsh};
    decode_emit(d, op_address, REG_TEMP, op >> 3 & 7u, op >> 6 & 7u, 0);
    decode_emit(d, kinds[op >> 9 & 7u], op & 7u, REG_TEMP, 0, 0);
    return true;
}

static bool by_offset(struct decoder *d, uint32_t op)
{
    const bool load = (op & 0x800u) != 0;
    const uint32_t offset = op >> 6 & 31u;
    switch (op >> 12) {
    case 6:
        decode_emit(d, load ? op_ldr : op_str, op & 7u, op >> 3 & 7u, 0, 4 * offset);
        return true;
    case 7:
        decode_emit(d, load ? op_ldrb : op_strb, op & 7u, op >> 3 & 7u, 0, offset);
        return true;
    case 8:
        decode_emit(d, load ? op_ldrh : op_strh, op & 7u, op >> 3 & 7u, 0, 2 * offset);
        return true;
    default:
        decode_emit(d, load ? op_ldr : op_str, op >> 8 & 7u, REG_SP, 0, 4 * (op & 0xFFu));
        return true;
    }
}

static bool compare_and_branch(struct decoder *d, uint32_t op)
{
    if (decode_in_it(d)) {
        return false;
    }
    const uint32_t distance = (op >> 3 & 0x1Fu) << 1 | (op >> 9 & 1u) << 6;
    decode_emit(d, (op & 0x800u) != 0 ? op_cbnz : op_cbz, op & 7u, 0, 0, 0);
    decode_emit(d, op_jump, 0, 0, 0, decode_pc(d) + distance);
    decode_jump(d, d->pc + d->size);
    return true;
}

static bool change_masks(struct decoder *d, uint32_t op)
{
    if ((op & 0xFFECu) != 0xB660u || decode_in_it(d)) {
        return false;
    }
    decode_emit(d, op_cps, (op & 0x10u) != 0, op >> 1 & 1u, op & 1u, 0);
    decode_jump(d, d->pc + 2);
    return true;
}

static bool hint(struct decoder *d, uint32_t op)
{
    if (op == 0xBF00u || op == 0xBF40u) { /* NOP, SEV */
        decode_emit(d, op_nop, 0, 0, 0, 0);
        return true;
    }
    if (op != 0xBF30u || decode_in_it(d)) {
        return false;
    }
    decode_emit(d, op_wfi, 0, 0, 0, d->pc + 2);
    d->ended = true;
    return true;
}

static bool miscellaneous(struct decoder *d, uint32_t op)
{
    static op_function *const extends[] = {op_sxth, op_sxtb, op_uxth, op_uxtb};
    static op_function *const reverses[] = {op_rev, op_rev16, NULL, op_revsh};
    switch (op >> 8 & 15u) {
    case 0:
        decode_emit(d, (op & 0x80u) != 0 ? op_sub_i : op_add_i, REG_SP, REG_SP, 0, 4 * (op & 0x7Fu));
        return true;
    case 1:
    case 3:
    case 9:
    case 11:
        return compare_and_branch(d, op);
    case 2:
        decode_emit(d, extends[op >> 6 & 3u], op & 7u, REG_TEMP, op >> 3 & 7u, 0);
        return true;
    case 4:
    case 5:
        return decode_block_transfer(d, REG_SP, (op & 0xFFu) | (op & 0x100u) << 6, false, true, true);
    case 6:
        return change_masks(d, op);
    case 10:
        if (reverses[op >> 6 & 3u] == NULL) {
            return false;
        }
        decode_emit(d, reverses[op >> 6 & 3u], op & 7u, 0, op >> 3 & 7u, 0);
        return true;
    case 12:
    case 13:
        return decode_block_transfer(d, REG_SP, (op & 0xFFu) | (op & 0x100u) << 7, true, false, true);
    case 15:
        return hint(d, op);
    default:
        return false;
    }
}

static bool branch(struct decoder *d, uint32_t op)
{
    if (op >> 12 == 14) {
        if ((op & 0x800u) != 0) {
            return false;
        }
        const uint32_t distance = (op & 0x7FFu) << 1;
        decode_jump(d, decode_pc(d) + distance - ((op & 0x400u) != 0 ? 0x1000u : 0));
        return true;
    }
    const unsigned condition = op >> 8 & 15u;
    if (condition >= 14 || decode_in_it(d)) {
        return false; /* UDF and SVC */
    }
    const uint32_t distance = (op & 0xFFu) << 1;
    decode_branch_if(d, condition, decode_pc(d) + distance - ((op & 0x80u) != 0 ? 0x200u : 0));
    return true;
}

bool decode_16(struct decoder *d, uint32_t op)
{
    uint32_t literal;
    const unsigned high = op >> 8 & 7u;
    switch (op >> 12) {
    case 0:
    case 1:
    case 2:
    case 3:
        return shift_add_move(d, op);
    case 4:
        if ((op & 0x800u) != 0) {
            if (!decode_literal(d, (decode_pc(d) & ~3u) + 4 * (op & 0xFFu), 4, &literal)) {
                return false;
            }
            decode_emit(d, op_mov_i, high, 0, 0, literal);
            return true;
        }
        return (op & 0x400u) != 0 ? high_registers(d, op) : data_processing(d, op);
    case 5:
        return by_register_offset(d, op);
    case 6:
    case 7:
    case 8:
    case 9:
        return by_offset(d, op);
    case 10:
        if ((op & 0x800u) != 0) {
            decode_emit(d, op_add_i, high, REG_SP, 0, 4 * (op & 0xFFu));
        } else {
            decode_emit(d, op_mov_i, high, 0, 0, (decode_pc(d) & ~3u) + 4 * (op & 0xFFu));
        }
        return true;
    case 11:
        return miscellaneous(d, op);
    case 12: {
        const bool load = (op & 0x800u) != 0;
        const bool writeback = !load || (op >> high & 1u) == 0;
        return decode_block_transfer(d, high, op & 0xFFu, load, false, writeback);
    }
    default:
        return branch(d, op);
    }
}
