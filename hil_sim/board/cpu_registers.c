/* The CPU's registers: read and written by their names, wherever they are, and moved into the engine and
 * back. */
#include "machine.h"

#define NZCV       0xF0000000u
#define XPSR_SAVED (0x080F0000u | XPSR_IT | XPSR_T | XPSR_EXCEPTION) /* Q and GE too */

static const int general[] = {UC_ARM_REG_R0,  UC_ARM_REG_R1, UC_ARM_REG_R2,  UC_ARM_REG_R3,
                              UC_ARM_REG_R4,  UC_ARM_REG_R5, UC_ARM_REG_R6,  UC_ARM_REG_R7,
                              UC_ARM_REG_R8,  UC_ARM_REG_R9, UC_ARM_REG_R10, UC_ARM_REG_R11,
                              UC_ARM_REG_R12, UC_ARM_REG_SP, UC_ARM_REG_LR,  UC_ARM_REG_PC};
enum { GENERAL = sizeof general / sizeof general[0], DOUBLES = FP_SINGLES / 2 };

static bool on_process_stack(const struct core *core)
{
    return (core->xpsr & XPSR_EXCEPTION) == 0 && (core->control & CONTROL_SPSEL) != 0;
}

/* Which stack pointer SP is follows from the mode and from CONTROL. */
static void change_mode(struct core *core, uint32_t xpsr, uint32_t control)
{
    const bool before = on_process_stack(core);
    core->xpsr = xpsr;
    core->control = control;
    if (on_process_stack(core) != before) {
        const uint32_t sp = core->r[REG_SP];
        core->r[REG_SP] = core->other_sp;
        core->other_sp = sp;
    }
}

uint32_t core_xpsr(const struct core *core)
{
    return core->xpsr | (core->negative & 1u << 31) | (uint32_t)(core->zero == 0) << 30 | core->carry << 29 |
           core->overflow >> 31 << 28;
}

void core_set_itstate(struct core *core, uint32_t itstate)
{
    core->xpsr = (core->xpsr & ~XPSR_IT) | (itstate & 0xFCu) << 8 | (itstate & 3u) << 25;
}

static void set_xpsr(struct core *core, uint32_t value)
{
    core->negative = value;
    core->zero = (value >> 30 & 1u) ^ 1u;
    core->carry = value >> 29 & 1u;
    core->overflow = value << 3;
    change_mode(core, value & XPSR_SAVED, core->control);
}

/* In handler mode a write to SPSEL has no effect (PM0214 2.1.3). */
static void set_control(struct core *core, uint32_t value)
{
    const bool handler = (core->xpsr & XPSR_EXCEPTION) != 0;
    const uint32_t kept = handler ? core->control & CONTROL_SPSEL : value & CONTROL_SPSEL;
    change_mode(core, core->xpsr, (value & (CONTROL_NPRIV | CONTROL_FPCA)) | kept);
}

static uint32_t *stack_pointer(struct core *core, bool process)
{
    return on_process_stack(core) == process ? &core->r[REG_SP] : &core->other_sp;
}

/* Where a register lies that is a word of its own; NULL for others. */
static uint32_t *place_of(struct core *core, int reg)
{
    if (reg >= UC_ARM_REG_R0 && reg <= UC_ARM_REG_R12) {
        return &core->r[reg - UC_ARM_REG_R0];
    }
    switch (reg) {
    case UC_ARM_REG_SP:
        return &core->r[REG_SP];
    case UC_ARM_REG_LR:
        return &core->r[REG_LR];
    case UC_ARM_REG_PC:
        return &core->r[REG_PC];
    case UC_ARM_REG_MSP:
        return stack_pointer(core, false);
    case UC_ARM_REG_PSP:
        return stack_pointer(core, true);
    case UC_ARM_REG_PRIMASK:
        return &core->primask;
    case UC_ARM_REG_BASEPRI:
        return &core->basepri;
    case UC_ARM_REG_FAULTMASK:
        return &core->faultmask;
    case UC_ARM_REG_CONTROL:
        return &core->control;
    case UC_ARM_REG_FPSCR:
        return &core->fpscr;
    default:
        return NULL;
    }
}

uint32_t cpu_get(struct board *b, int reg)
{
    uint32_t value = 0;
    if (b->core.in_engine) {
        uc_reg_read(b->uc, reg, &value);
        return value;
    }
    if (reg == UC_ARM_REG_XPSR || reg == UC_ARM_REG_IPSR) {
        return core_xpsr(&b->core) & (reg == UC_ARM_REG_IPSR ? XPSR_EXCEPTION : ~0u);
    }
    const uint32_t *place = place_of(&b->core, reg);
    return place != NULL ? *place : 0;
}

void cpu_set(struct board *b, int reg, uint32_t value)
{
    if (reg == UC_ARM_REG_XPSR_NZCVQG) {
        set_xpsr(&b->core, value);
        return;
    }
    if (reg == UC_ARM_REG_CONTROL) {
        set_control(&b->core, value);
        return;
    }
    uint32_t *place = place_of(&b->core, reg);
    if (place != NULL) {
        *place = reg == UC_ARM_REG_PC ? value & ~1u : value;
    }
}

static void engine_set(struct board *b, int reg, uint32_t value)
{
    uc_reg_write(b->uc, reg, &value);
}

static uint32_t engine_get(struct board *b, int reg)
{
    uint32_t value = 0;
    uc_reg_read(b->uc, reg, &value);
    return value;
}

/* Some of these cost the engine its translation cache, and seldom change. */
static void engine_change(struct board *b, int reg, uint32_t value)
{
    if (engine_get(b, reg) != value) {
        engine_set(b, reg, value);
    }
}

/* The engine takes SPSEL in thread mode alone, and any of these in a privileged mode alone. */
static void modes_to_engine(struct board *b)
{
    struct core *core = &b->core;
    const uint32_t privileged = XPSR_T | EXC_NMI;
    engine_set(b, UC_ARM_REG_XPSR_NZCVQG, privileged);
    if (engine_get(b, UC_ARM_REG_CONTROL) != core->control) {
        engine_set(b, UC_ARM_REG_CONTROL, 0);
        engine_set(b, UC_ARM_REG_XPSR_NZCVQG, XPSR_T);
        engine_set(b, UC_ARM_REG_CONTROL, core->control);
        engine_set(b, UC_ARM_REG_XPSR_NZCVQG, privileged);
    }
    engine_change(b, UC_ARM_REG_PRIMASK, core->primask);
    engine_change(b, UC_ARM_REG_BASEPRI, core->basepri);
    engine_change(b, UC_ARM_REG_FAULTMASK, core->faultmask);
    engine_change(b, UC_ARM_REG_MSP, *stack_pointer(core, false));
    engine_change(b, UC_ARM_REG_PSP, *stack_pointer(core, true));
    engine_set(b, UC_ARM_REG_XPSR_NZCVQG, core_xpsr(core));
}

static void fp_places(struct core *core, int *regs, void **places)
{
    for (int i = 0; i < DOUBLES; i++) {
        regs[i] = UC_ARM_REG_D0 + i;
        places[i] = &core->s[(size_t)2 * (size_t)i];
    }
}

void core_to_engine(struct board *b)
{
    struct core *core = &b->core;
    int regs[DOUBLES];
    void *places[GENERAL > DOUBLES ? GENERAL : DOUBLES];
    modes_to_engine(b);
    for (int i = 0; i < GENERAL; i++) {
        places[i] = &core->r[i];
    }
    const uint32_t pc = core->r[REG_PC];
    core->r[REG_PC] |= 1u; /* as the engine takes it in Thumb state */
    uc_reg_write_batch(b->uc, (int *)general, places, GENERAL);
    core->r[REG_PC] = pc;
    fp_places(core, regs, places);
    uc_reg_write_batch(b->uc, regs, places, DOUBLES);
    engine_set(b, UC_ARM_REG_FPSCR, core->fpscr);
    core->in_engine = true;
}

void core_from_engine(struct board *b)
{
    struct core *core = &b->core;
    int regs[DOUBLES];
    void *places[GENERAL > DOUBLES ? GENERAL : DOUBLES];
    core->in_engine = false;
    const uint32_t msp = engine_get(b, UC_ARM_REG_MSP);
    const uint32_t psp = engine_get(b, UC_ARM_REG_PSP);
    for (int i = 0; i < GENERAL; i++) {
        places[i] = &core->r[i];
    }
    uc_reg_read_batch(b->uc, (int *)general, places, GENERAL);
    core->r[REG_PC] &= ~1u;
    core->control = engine_get(b, UC_ARM_REG_CONTROL);
    set_xpsr(core, engine_get(b, UC_ARM_REG_XPSR));
    *stack_pointer(core, false) = msp;
    *stack_pointer(core, true) = psp;
    core->primask = engine_get(b, UC_ARM_REG_PRIMASK);
    core->basepri = engine_get(b, UC_ARM_REG_BASEPRI);
    core->faultmask = engine_get(b, UC_ARM_REG_FAULTMASK);
    fp_places(core, regs, places);
    uc_reg_read_batch(b->uc, regs, places, DOUBLES);
    core->fpscr = engine_get(b, UC_ARM_REG_FPSCR);
}
