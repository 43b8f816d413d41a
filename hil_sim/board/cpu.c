/* The CPU: the interpreter or the engine runs the instructions, block by block; this file keeps the time and
 * handles events between blocks. */
#include "thumb.h"

#include <stdlib.h>
#include <string.h>

#define OPCODE_WFI 0xBF30u
#define NO_END     0xFFFFFFFEu /* what an erased vector holds; code cannot run there */
/* The engine jumps to EXC_RETURN values as to any address: a page is mapped there, so that its block hook
 * sees them. */
#define RETURN_PAGE  0xFFFFF000u
#define RETURN_FIRST 0xFFFFFFE0u

/* Interrupt numbers of Unicorn's ARM, as observed with 2.1.4; the last one is this file's own. */
enum { TRAP_SVC = 2, TRAP_PREFETCH_ABORT = 3, TRAP_BREAKPOINT = 7, TRAP_EXCEPTION_RETURN = 1000 };

/* Host address of guest memory, NULL where there is none (or none to write). */
uint8_t *cpu_memory(const struct board *b, uint32_t address, size_t length, bool write)
{
    const struct {
        uint32_t base, size;
        uint8_t *host;
        bool writable;
    } map[] = {{SRAM_BASE, SRAM_SIZE, b->sram, true},
               {CCM_BASE, CCM_SIZE, b->ccm, true},
               {FLASH_BASE, FLASH_SIZE, b->flash_array, false},
               {0, FLASH_SIZE, b->flash_array, false},
               {SYSTEM_BASE, SYSTEM_SIZE, b->system, false}};
    for (size_t i = 0; i < sizeof map / sizeof map[0]; i++) {
        uint32_t offset = address - map[i].base;
        if (offset < map[i].size && length <= map[i].size - offset && (map[i].writable || !write)) {
            return map[i].host + offset;
        }
    }
    return NULL;
}

/* The cycle at which the hook must hand over: an event, the end of the span, or at once. */
void cpu_update_break(struct board *b)
{
    uint64_t at = b->next_event < b->target ? b->next_event : b->target;
    bool look = b->needs_check || b->reset_wanted || b->stall_until > b->now || b->flash.stale_end != 0 ||
                b->tlb_stale || b->it_stale || b->cut_at_instruction != NEVER;
    b->break_at = look ? 0 : at;
}

/* Charges what runs with what has been spent since the last time. */
void cpu_settle(struct board *b)
{
    struct running *top = &b->running[b->depth];
    top->instructions += b->stats.instructions - b->settled_instructions;
    top->cycles += b->busy_cycles - b->settled_cycles;
    b->settled_instructions = b->stats.instructions;
    b->settled_cycles = b->busy_cycles;
}

static void finish_block(struct board *b)
{
    b->now += b->current.cycles;
    b->busy_cycles += b->current.cycles;
    b->stats.instructions += b->current.instructions;
    b->it_left = b->current.it_left;
    b->current = (struct block){0};
    b->accesses = 0;
    if (b->moment < b->now) {
        b->moment = b->now;
    }
}

/* A fault ended the block early: only the instructions before the faulting one are charged. */
static void cut_block(struct board *b, uint32_t pc)
{
    uint32_t done = pc - b->block_pc;
    const uint8_t *code = cpu_memory(b, b->block_pc, done, false);
    if (b->current.cycles != 0 && code != NULL && done < b->current.size) {
        uint8_t flags = b->current.flags;
        block_measure(code, done, b->it_left, &b->current);
        b->current.flags = flags;
    }
    finish_block(b);
}

static const struct block *measured(struct board *b, uint32_t pc, uint32_t size, struct block *scratch)
{
    uint32_t offset = pc >= FLASH_BASE ? pc - FLASH_BASE : pc;
    if (offset < FLASH_SIZE && b->it_left == 0) {
        struct block *known = &b->flash_blocks[offset / 2];
        if (known->size != size || known->flags == 0) {
            block_measure(b->flash_array + offset, size, 0, known);
        }
        return known;
    }
    const uint8_t *code = cpu_memory(b, pc, size, false);
    if (code == NULL) {
        *scratch =
            (struct block){.cycles = 1, .instructions = 1, .size = (uint16_t)size, .flags = BLOCK_KNOWN};
    } else {
        block_measure(code, size, b->it_left, scratch);
    }
    return scratch;
}

/* A pending exception that PRIMASK or another mask holds back does not leave the engine. */
static bool must_leave(struct board *b)
{
    if (!b->powered || b->reset_wanted || b->now >= b->next_event || b->now >= b->target ||
        b->stall_until > b->now || b->flash.stale_end != 0 || b->it_stale ||
        b->stats.instructions >= b->cut_at_instruction) {
        return true;
    }
    return b->nvic.best != 0 && b->nvic.best_priority < nvic_execution_priority(b);
}

/* Between two blocks: the one before is over, and its time with it. False: something else comes before the
 * next. */
bool cpu_begin_block(struct board *b, uint32_t pc)
{
    finish_block(b);
    b->block_pc = pc;
    if (b->it_left == 0 && b->now >= b->break_at) {
        return cpu_look_up(b);
    }
    return true;
}

/* At the beginning of a block before which something may be due. False: it comes first. */
bool cpu_look_up(struct board *b)
{
    events_run(b, b->now);
    return !must_leave(b);
}

/* Called by the engine before each block. Returning early means that the block has not begun. */
static void on_block(uc_engine *uc, uint64_t address, uint32_t size, void *user)
{
    struct board *b = user;
    if (b->resumes) {
        b->resumes = false;
        return;
    }
    const bool begun = cpu_begin_block(b, (uint32_t)address);
    if (!begun || (b->it_left == 0 && thumb_find(b, (uint32_t)address, 0) != NULL)) {
        b->at_block = true;
        uc_emu_stop(uc);
        return;
    }
    if (address >= RETURN_PAGE) {
        b->trap = TRAP_EXCEPTION_RETURN;
        uc_emu_stop(uc);
        return;
    }
    struct block scratch;
    const struct block *block = measured(b, (uint32_t)address, size, &scratch);
    if ((block->flags & BLOCK_FP) != 0 && b->no_fp) {
        b->at_block = true;
        b->trap = TRAP_NONE;
        b->fault_type = -1;
        b->fault_seen = true;
        uc_emu_stop(uc);
        return;
    }
    b->current = *block;
    if (b->flash_waits.counted) {
        b->current.cycles = (uint16_t)(b->current.cycles + flash_waits_of_block(b, b->block_pc, size));
    }
}

static void on_interrupt(uc_engine *uc, uint32_t number, void *user)
{
    struct board *b = user;
    b->trap = (int)number;
    uc_emu_stop(uc);
}

static bool on_memory_fault(uc_engine *uc, uc_mem_type type, uint64_t address, int size, int64_t value,
                            void *user)
{
    struct board *b = user;
    (void)uc;
    if (type == UC_MEM_WRITE_PROT && flash_store(b, (uint32_t)address, (uint32_t)size, (uint64_t)value)) {
        return true;
    }
    b->fault_seen = true;
    b->fault_address = (uint32_t)address;
    b->fault_type = (int)type;
    return false;
}

/* A hook has been called in the middle of a block. For an access inside an IT block the engine sets ITSTATE
 * and does not restore it: the next block would be executed as the rest of the IT block. */
void cpu_engine_read_state(struct board *b)
{
    if ((cpu_get(b, UC_ARM_REG_XPSR) & XPSR_IT) != 0) {
        b->it_stale = true;
        cpu_update_break(b);
    }
}

/* Fills the engine's translation cache; addresses stay what they are. A page of SRAM is executable only once
 * code has run from it: stores into other pages then need no check for self-modifying code, which makes them
 * five times faster. */
static bool on_tlb_fill(uc_engine *uc, uint64_t address, uc_mem_type type, uc_tlb_entry *result, void *user)
{
    struct board *b = user;
    (void)uc;
    if (type != UC_MEM_FETCH) {
        cpu_engine_read_state(b);
    }
    uint32_t page = ((uint32_t)address - SRAM_BASE) / CODE_PAGE;
    bool sram = page < SRAM_SIZE / CODE_PAGE;
    if (sram && type == UC_MEM_FETCH && (b->sram_code_pages[page / 32] >> page % 32 & 1u) == 0) {
        b->sram_code_pages[page / 32] |= 1u << page % 32;
        b->sram_has_code = true;
        b->tlb_stale = true; /* other privilege levels may still have the page cached as data */
        cpu_update_break(b);
    }
    bool data_only = sram && (b->sram_code_pages[page / 32] >> page % 32 & 1u) == 0;
    data_only = data_only || (uint32_t)address - CCM_BASE < CCM_SIZE;
    result->paddr = address & ~(uint64_t)(CODE_PAGE - 1);
    result->perms = data_only ? UC_PROT_READ | UC_PROT_WRITE : UC_PROT_ALL;
    return true;
}

typedef void (*any_function)(void);

static bool add_hook(struct board *b, int kinds, any_function callback, uint64_t first, uint64_t last)
{
    uc_hook handle;
    void *pointer;
    memcpy(&pointer, &callback, sizeof pointer);
    return uc_hook_add(b->uc, &handle, kinds, pointer, b, first, last) == UC_ERR_OK;
}

/* A hook on a memory range slows stores there down; RAM needs none, because no access to it faults. */
static bool add_fault_hooks(struct board *b)
{
    static const struct {
        uint64_t first, last;
    } spans[] = {
        {0, CCM_BASE - 1}, {CCM_BASE + CCM_SIZE, SRAM_BASE - 1}, {SRAM_BASE + SRAM_SIZE, 0xFFFFFFFFu}};
    bool good = true;
    for (size_t i = 0; i < sizeof spans / sizeof spans[0]; i++) {
        good = good &&
               add_hook(b, UC_HOOK_MEM_INVALID, (any_function)on_memory_fault, spans[i].first, spans[i].last);
    }
    return good;
}

bool cpu_open(struct board *b)
{
    if (uc_open(UC_ARCH_ARM, UC_MODE_THUMB, &b->uc) != UC_ERR_OK) {
        return false;
    }
    bool good = uc_ctl_set_cpu_model(b->uc, UC_CPU_ARM_CORTEX_M4) == UC_ERR_OK;
    const uint32_t code = UC_PROT_READ | UC_PROT_EXEC;
    static const uint32_t flash_at[] = {FLASH_BASE, 0};
    for (size_t i = 0; i < 2; i++) {
        /* Mapped writable and protected afterwards: only then does the engine discard stores that a hook took
         * care of. */
        good =
            good && uc_mem_map_ptr(b->uc, flash_at[i], FLASH_SIZE, UC_PROT_ALL, b->flash_array) == UC_ERR_OK;
        good = good && uc_mem_protect(b->uc, flash_at[i], FLASH_SIZE, code) == UC_ERR_OK;
    }
    good = good && uc_mem_map_ptr(b->uc, SYSTEM_BASE, SYSTEM_SIZE, code, b->system) == UC_ERR_OK;
    good = good && uc_mem_map_ptr(b->uc, SRAM_BASE, SRAM_SIZE, UC_PROT_ALL, b->sram) == UC_ERR_OK;
    /* CCM hangs on the data bus only (RM0090 2.3.1): no code runs from it. */
    good =
        good && uc_mem_map_ptr(b->uc, CCM_BASE, CCM_SIZE, UC_PROT_READ | UC_PROT_WRITE, b->ccm) == UC_ERR_OK;
    /* Execution only: data there faults as on the chip. Each half-word is a block of its own. */
    static uint16_t branches_to_self[0x1000 / 2];
    for (size_t i = 0; i < sizeof branches_to_self / sizeof branches_to_self[0]; i++) {
        branches_to_self[i] = 0xE7FE;
    }
    good = good && uc_mem_map_ptr(b->uc, RETURN_PAGE, sizeof branches_to_self, UC_PROT_EXEC,
                                  branches_to_self) == UC_ERR_OK;
    good = good && bus_map(b);
    good = good && uc_ctl_exits_enable(b->uc) == UC_ERR_OK; /* and there is none: the hooks end every run */
    good = good && uc_ctl_tlb_mode(b->uc, UC_TLB_VIRTUAL) == UC_ERR_OK;
    good = good && add_hook(b, UC_HOOK_TLB_FILL, (any_function)on_tlb_fill, 1, 0);
    good = good && add_hook(b, UC_HOOK_BLOCK, (any_function)on_block, 1, 0);
    good = good && add_hook(b, UC_HOOK_INTR, (any_function)on_interrupt, 1, 0);
    return good && add_fault_hooks(b);
}

/* Registers as reset leaves them; stack pointer and start address come from the vector table (PM0214 2.1.3).
 */
void cpu_reset(struct board *b)
{
    static const int cleared[] = {UC_ARM_REG_R0,  UC_ARM_REG_R1,   UC_ARM_REG_R2,  UC_ARM_REG_R3,
                                  UC_ARM_REG_R4,  UC_ARM_REG_R5,   UC_ARM_REG_R6,  UC_ARM_REG_R7,
                                  UC_ARM_REG_R8,  UC_ARM_REG_R9,   UC_ARM_REG_R10, UC_ARM_REG_R11,
                                  UC_ARM_REG_R12, UC_ARM_REG_FPSCR};
    b->current = (struct block){0};
    b->it_left = 0;
    b->sleeping = b->locked_up = false;
    b->no_fp = true;
    cpu_settle(b);
    b->depth = 0;
    b->running[0] = (struct running){0};
    cpu_set(b, UC_ARM_REG_XPSR_NZCVQG,
            0x01000000u | EXC_NMI); /* handler mode: privileged, whatever was before */
    for (size_t i = 0; i < sizeof cleared / sizeof cleared[0]; i++) {
        cpu_set(b, cleared[i], 0);
    }
    cpu_set(b, UC_ARM_REG_PRIMASK, 0);
    cpu_set(b, UC_ARM_REG_BASEPRI, 0);
    cpu_set(b, UC_ARM_REG_FAULTMASK, 0);
    cpu_set(b, UC_ARM_REG_CONTROL, 0);
    cpu_set(b, UC_ARM_REG_PSP, 0);
    cpu_set(b, UC_ARM_REG_XPSR_NZCVQG, 0x01000000u);
    uint32_t vectors[2];
    memcpy(vectors, b->flash_array, sizeof vectors);
    cpu_set(b, UC_ARM_REG_SP, vectors[0] & ~3u);
    cpu_set(b, UC_ARM_REG_LR, 0xFFFFFFFFu);
    cpu_set(b, UC_ARM_REG_PC, vectors[1] | 1u);
}

/* Where the first FP instruction of a block lies, for the fault that a switched-off coprocessor raises. */
static uint32_t first_fp(struct board *b, uint32_t pc, uint32_t *before)
{
    struct block probe = {0};
    const uint8_t *code = cpu_memory(b, pc, 2, false);
    *before = 0;
    for (uint32_t size = 2; code != NULL; size += 2) {
        block_measure(code, size, b->it_left, &probe);
        if ((probe.flags & BLOCK_FP) != 0) {
            *before = probe.instructions - 1u;
            return pc + size - 2;
        }
    }
    return pc;
}

static void fault_no_coprocessor(struct board *b)
{
    uint32_t before;
    uint32_t pc = first_fp(b, b->block_pc, &before);
    if (before != 0) {
        b->current = (struct block){.cycles = 1, .size = UINT16_MAX}; /* cut below */
        b->resumes = true; /* lets the instructions in front of it run */
        core_to_engine(b);
        uc_emu_start(b->uc, b->block_pc | 1u, NO_END, 0, before);
        core_from_engine(b);
        b->resumes = false;
        cut_block(b, pc);
    }
    exception_fault(b, EXC_USAGE_FAULT, 1u << 19, pc); /* CFSR.NOCP */
}

/* Faults as CFSR names them, PM0214 4.4.16: PRECISERR and BFARVALID, IACCVIOL, IBUSERR, UNDEFINSTR, INVSTATE.
 */
static void fault_by_memory(struct board *b, uint32_t pc)
{
    cut_block(b, pc);
    switch (b->fault_type) {
    case UC_MEM_FETCH_UNMAPPED:
    case UC_MEM_FETCH_PROT:
        exception_fault(b, EXC_BUS_FAULT, 1u << 8, pc);
        break;
    default:
        b->scb.bfar = b->fault_address;
        exception_fault(b, EXC_BUS_FAULT, (1u << 9) | (1u << 15), pc);
    }
}

static void wait_for_event(struct board *b, uint32_t pc)
{
    uint16_t opcode = 0;
    const uint8_t *code = cpu_memory(b, pc - 2, 2, false);
    if (code != NULL) {
        memcpy(&opcode, code, sizeof opcode);
    }
    /* WFE may complete at any time (PM0214 2.5.2); SEV is not visible here, so it always completes at
     * once. */
    b->sleeping = opcode == OPCODE_WFI;
}

/* UNALIGNED, INVSTATE or UNDEFINSTR of CFSR. */
static uint32_t usage_fault_of(uc_err error)
{
    switch (error) {
    case UC_ERR_READ_UNALIGNED:
    case UC_ERR_WRITE_UNALIGNED:
        return 1u << 24;
    case UC_ERR_EXCEPTION:
        return 1u << 17;
    default:
        return 1u << 16;
    }
}

static void branch_to_return_page(struct board *b, uint32_t pc)
{
    if (pc >= RETURN_FIRST) {
        exception_return(b, pc | 1u);
    } else {
        exception_fault(b, EXC_BUS_FAULT, 1u << 8, pc);
    }
}

/* One stretch in the engine, and what made it end. */
static void run_engine(struct board *b)
{
    b->at_block = false;
    b->trap = TRAP_NONE;
    b->fault_seen = false;
    core_to_engine(b);
    uc_err error = uc_emu_start(b->uc, b->core.r[REG_PC] | 1u, NO_END, 0, 0);
    core_from_engine(b);
    b->resumes = false;
    const uint32_t pc = b->core.r[REG_PC];
    if (b->it_left == 0) { /* the engine's own may be out of date */
        const bool inside = pc - b->block_pc < CODE_PAGE;
        core_set_itstate(&b->core, inside ? thumb_itstate(b, b->block_pc, 0, pc) : 0);
    }
    if (b->at_block && !b->fault_seen) {
        return;
    }
    if (b->fault_seen && b->fault_type < 0) {
        fault_no_coprocessor(b);
    } else if (b->fault_seen) {
        fault_by_memory(b, pc);
    } else if (b->trap == TRAP_EXCEPTION_RETURN) {
        branch_to_return_page(b, pc);
    } else if (b->trap == TRAP_SVC) {
        finish_block(b);
        exception_svc(b, pc);
    } else if (b->trap == TRAP_BREAKPOINT) {
        cut_block(b, pc);
        b->scb.hfsr |= 1u << 31; /* DEBUGEVT: no debugger is attached */
        exception_fault(b, EXC_HARD_FAULT, 0, pc);
    } else if (b->trap == TRAP_PREFETCH_ABORT || pc - CCM_BASE < CCM_SIZE) {
        cut_block(b, pc); /* no hook watches the RAMs, so that code in CCM ends here */
        exception_fault(b, EXC_BUS_FAULT, 1u << 8, pc);
    } else if (error == UC_ERR_OK) {
        finish_block(b);
        wait_for_event(b, pc);
    } else if (error == UC_ERR_INSN_INVALID && pc == b->block_pc + b->current.size &&
               (b->current.flags & BLOCK_WAITS) != 0) {
        finish_block(b); /* the engine reports WFE and YIELD so */
        wait_for_event(b, pc);
    } else {
        cut_block(b, pc);
        exception_fault(b, EXC_USAGE_FAULT, usage_fault_of(error), pc);
    }
}

/* The interpreter has stopped. False: the engine has to go on from here. */
static bool settle_stop(struct board *b)
{
    switch (b->code.stop) {
    case THUMB_AT_BLOCK:
        return true;
    case THUMB_WAITS:
        finish_block(b);
        b->sleeping = true;
        return true;
    case THUMB_NO_FP:
        fault_no_coprocessor(b);
        return true;
    case THUMB_ESCAPES:
        b->resumes = true;
        return false;
    default:
        return false;
    }
}

/* One stretch of code, in the interpreter as far as that goes, and what made it end. */
static void run_code(struct board *b)
{
    const uint32_t begin = b->core.r[REG_PC];
    if (begin == NO_END) { /* an erased vector: the engine ends at once */
        exception_fault(b, EXC_BUS_FAULT, 1u << 8, NO_END);
        return;
    }
    struct code_block *block = b->it_left == 0 ? thumb_find(b, begin, 0) : NULL;
    if (block != NULL) {
        thumb_run(b, block);
        if (settle_stop(b)) {
            return;
        }
    }
    const uint32_t pc = b->core.r[REG_PC];
    if (pc < RETURN_PAGE) {
        run_engine(b);
    } else if (cpu_begin_block(b, pc)) {
        branch_to_return_page(b, pc);
    }
}

/* The CPU stands still until the given cycle or the next event. */
static void stand_still(struct board *b, uint64_t until)
{
    uint64_t next = b->next_event < b->target ? b->next_event : b->target;
    next = next < until ? next : until;
    if (next > b->now) {
        if (b->sleeping) {
            b->stats.sleep_cycles += next - b->now;
        }
        b->now = next;
    }
}

static bool wakes(struct board *b)
{
    return b->nvic.best_priority < nvic_execution_priority(b);
}

/* Runs up to b->target. Between blocks, in this order: events, flash stalls, exceptions, then code. */
void cpu_run(struct board *b)
{
    while (true) {
        b->moment = b->now > b->moment ? b->now : b->moment;
        events_run(b, b->now);
        if (b->reset_wanted) {
            board_reset(b, b->reset_cause);
        }
        if (b->stats.instructions >= b->cut_at_instruction) {
            b->cut_at_instruction = NEVER;
            board_power(b, false);
        }
        if (b->flash.stale_end != 0) {
            flash_forget_code(b);
        }
        if (b->it_stale && b->it_left == 0) {
            b->it_stale = false;
            /* The engine has already translated the next block for that state, and chained the last one to
             * it. */
            uc_ctl_remove_cache(b->uc, b->block_pc, (uint64_t)b->block_pc + 2u);
            cpu_set(b, UC_ARM_REG_XPSR_NZCVQG, cpu_get(b, UC_ARM_REG_XPSR) & ~XPSR_IT);
        }
        if (b->code.stale) {
            thumb_forget(b);
        }
        if (b->tlb_stale) {
            b->tlb_stale = false;
            uc_ctl_flush_tlb(b->uc);
        }
        if (!b->powered || b->locked_up || b->halted || b->clock_dead) {
            if (b->now >= b->target) {
                return;
            }
            stand_still(b, NEVER);
            continue;
        }
        if (b->stall_until > b->now) {
            if (b->now >= b->target) {
                return;
            }
            stand_still(b, b->stall_until);
            continue;
        }
        if (b->it_left == 0 && b->nvic.best != 0 && (!b->sleeping || wakes(b))) {
            b->sleeping = false;
            if (exception_take_pending(b, cpu_get(b, UC_ARM_REG_PC))) {
                continue;
            }
        }
        /* Held back by a mask that the code may clear: checked again at each block. */
        b->needs_check = b->nvic.best != 0 && b->nvic.best_priority < b->nvic.active_group;
        if (b->now >= b->target) {
            return;
        }
        cpu_update_break(b);
        if (b->sleeping) {
            stand_still(b, NEVER);
        } else {
            run_code(b);
        }
    }
}
