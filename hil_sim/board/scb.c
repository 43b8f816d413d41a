/* The system control block, the FPU's control registers, DWT and debug registers of the CPU, PM0214 4.4
 * and 4.6. */
#include "machine.h"

enum { VECTKEY = 0x05FA, TRCENA = 1 << 24 };

static uint32_t icsr(struct board *b)
{
    uint32_t value = cpu_get(b, UC_ARM_REG_IPSR) & 0x1FFu;
    unsigned active = 0;
    for (unsigned word = 0; word < 4; word++) {
        active += (unsigned)__builtin_popcount(b->nvic.active[word]);
    }
    value |= active <= 1 ? 1u << 11 : 0;
    value |= (uint32_t)b->nvic.best << 12;
    value |= b->nvic.best >= EXC_IRQ0 ? 1u << 22 : 0;
    value |= nvic_bit(b->nvic.pending, EXC_SYSTICK) ? 1u << 26 : 0;
    value |= nvic_bit(b->nvic.pending, EXC_PENDSV) ? 1u << 28 : 0;
    value |= nvic_bit(b->nvic.pending, EXC_NMI) ? 1u << 31 : 0;
    return value;
}

static void write_icsr(struct board *b, uint32_t value)
{
    if ((value & (1u << 31)) != 0) {
        nvic_pend(b, EXC_NMI, true);
    }
    if ((value & (3u << 27)) != 0) {
        nvic_pend(b, EXC_PENDSV, (value & (1u << 28)) != 0);
    }
    if ((value & (3u << 25)) != 0) {
        nvic_pend(b, EXC_SYSTICK, (value & (1u << 26)) != 0);
    }
}

static void write_aircr(struct board *b, uint32_t value)
{
    if (value >> 16 != VECTKEY) {
        return;
    }
    b->nvic.prigroup = (uint8_t)(value >> 8 & 7u);
    if ((value & 4u) != 0) {
        b->reset_wanted = true;
        b->reset_cause = BOARD_RESET_SOFTWARE;
    }
    nvic_refresh(b);
}

static uint32_t shcsr(const struct board *b)
{
    static const struct {
        uint8_t exception, active_bit, pending_bit;
    } map[] = {{EXC_MEMORY_FAULT, 0, 13}, {EXC_BUS_FAULT, 1, 14}, {EXC_USAGE_FAULT, 3, 12}, {EXC_SVC, 7, 15},
               {EXC_DEBUG, 8, 31},        {EXC_PENDSV, 10, 31},   {EXC_SYSTICK, 11, 31}};
    uint32_t value = b->scb.shcsr & (7u << 16);
    for (size_t i = 0; i < sizeof map / sizeof map[0]; i++) {
        value |= nvic_bit(b->nvic.active, map[i].exception) ? 1u << map[i].active_bit : 0;
        if (map[i].pending_bit != 31) {
            value |= nvic_bit(b->nvic.pending, map[i].exception) ? 1u << map[i].pending_bit : 0;
        }
    }
    return value;
}

static void access_shpr(struct board *b, uint32_t offset, bool write, uint32_t *value, unsigned size)
{
    for (unsigned i = 0; i < size; i++) {
        uint8_t *priority = &b->nvic.priority[4 + offset - 0xD18u + i];
        if (write) {
            *priority = (uint8_t)(*value >> (8 * i)) & 0xF0u;
        } else {
            *value |= (uint32_t)*priority << (8 * i);
        }
    }
    if (write) {
        nvic_refresh(b);
    }
}

/* Registers that only hold their value, and those that only show one. */
static bool plain(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    struct {
        uint32_t offset, *store, mask;
    } map[] = {{0xD08, &b->scb.vtor, 0x3FFFFE00u}, {0xD10, &b->scb.scr, 0x16},
               {0xD14, &b->scb.ccr, 0x31B},        {0xD34, &b->scb.mmfar, ~0u},
               {0xD38, &b->scb.bfar, ~0u},         {0xF34, &b->scb.fpccr, ~0u},
               {0xF38, &b->scb.fpcar, ~7u},        {0xF3C, &b->scb.fpdscr, 0x7C00000u},
               {0xDFC, &b->scb.demcr, 0x010F07F1u}};
    for (size_t i = 0; i < sizeof map / sizeof map[0]; i++) {
        if (map[i].offset == offset) {
            if (write) {
                *map[i].store = *value & map[i].mask;
            } else {
                *value = *map[i].store;
            }
            return true;
        }
    }
    static const struct {
        uint32_t offset, value;
    } fixed[] = {{0xD00, 0x410FC241u}, {0x004, 2},          {0x008, 0},          {0xD40, 0x30},
                 {0xD44, 0x200},       {0xD48, 0x100000},   {0xD50, 0x30},       {0xD60, 0x01101110},
                 {0xD64, 0x02112000},  {0xD68, 0x21232231}, {0xD6C, 0x01111131}, {0xD70, 0x01310132},
                 {0xD90, 0},           {0xDF0, 0},          {0xF40, 0x10110021}, {0xF44, 0x11000011}};
    for (size_t i = 0; i < sizeof fixed / sizeof fixed[0]; i++) {
        if (fixed[i].offset == offset) {
            *value = write ? *value : fixed[i].value;
            return true;
        }
    }
    return false;
}

/* Offsets from 0xE000E000. */
bool scb_access(struct board *b, uint32_t offset, bool write, uint32_t *value, unsigned size)
{
    if (offset >= 0xD18u && offset < 0xD24u) {
        access_shpr(b, offset, write, value, size);
        return true;
    }
    switch (offset) {
    case 0xD04:
        if (write) {
            write_icsr(b, *value);
        } else {
            *value = icsr(b);
        }
        return true;
    case 0xD0C:
        if (write) {
            write_aircr(b, *value);
        } else {
            *value = 0xFA050000u | (uint32_t)b->nvic.prigroup << 8;
        }
        return true;
    case 0xD24:
        if (write) {
            b->scb.shcsr = *value & (7u << 16);
        } else {
            *value = shcsr(b);
        }
        return true;
    case 0xD28: /* CFSR, HFSR, DFSR: writing ones clears */
        b->scb.cfsr &= write ? ~*value : ~0u;
        *value = b->scb.cfsr;
        return true;
    case 0xD29: /* BFSR and UFSR as byte and half-word */
    case 0xD2A:
        b->scb.cfsr &= write ? ~(*value << (8 * (offset - 0xD28u))) : ~0u;
        *value = b->scb.cfsr >> (8 * (offset - 0xD28u));
        return true;
    case 0xD2C:
        b->scb.hfsr &= write ? ~*value : ~0u;
        *value = b->scb.hfsr;
        return true;
    case 0xD30:
        b->scb.dfsr &= write ? ~*value : ~0u;
        *value = b->scb.dfsr;
        return true;
    case 0xD88: /* CPACR: coprocessors 10 and 11 are the FPU */
        if (write) {
            b->scb.cpacr = *value & 0x00F00000u;
            b->no_fp = (b->scb.cpacr & 0x00F00000u) == 0;
        } else {
            *value = b->scb.cpacr;
        }
        return true;
    case 0xF00: /* STIR */
        if (write && (*value & 0x1FFu) + EXC_IRQ0 < BOARD_EXCEPTIONS) {
            nvic_pend(b, EXC_IRQ0 + (*value & 0x1FFu), true);
        }
        return true;
    default:
        return plain(b, offset, write, value);
    }
}
