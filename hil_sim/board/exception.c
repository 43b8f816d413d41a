/* Exception entry, return, tail-chaining and faults, as PM0214 section 2.3 has them; FP context is stacked
 * eagerly. */
#include "machine.h"

#include <string.h>

enum {
    ENTRY_CYCLES = 12,
    EXIT_CYCLES = 10,
    CHAIN_CYCLES = 6,
    FP_CYCLES = 17, /* the FP part of the frame, each way */
    FRAME_WORDS = 8,
    FP_FRAME_WORDS = 26
};
#define SHCSR_BUSFAULTENA (1u << 17)
#define STKERR            (1u << 12) /* CFSR */
#define UNSTKERR          (1u << 11)
#define HFSR_FORCED       (1u << 30)
#define XPSR_ALIGN        (1u << 9)
#define CCR_STKALIGN      (1u << 9)
#define FPCCR_ASPEN       (1u << 31)
#define RETURN_NO_FP      (1u << 4)
#define RETURN_PSP        (1u << 2)
#define RETURN_THREAD     (1u << 3)

enum { FRAME_REGISTERS = 6, FP_IN_FRAME = 16 };
static const int frame_registers[FRAME_REGISTERS] = {0, 1, 2, 3, 12, REG_LR};

static void lock_up(struct board *b)
{
    b->locked_up = true;
    warn_once(b, 0xF0000001u, "CPU locked up: a fault that no handler could take");
}

static void spend(struct board *b, uint64_t cycles)
{
    b->now += cycles;
    b->busy_cycles += cycles;
}

/* Accounting: the cost of the running exception is set aside while another one runs. */
static void begin_activation(struct board *b, unsigned exception)
{
    cpu_settle(b);
    b->depth++;
    b->running[b->depth] = (struct running){.exception = exception};
    b->cost[exception].activations++;
    b->stats.interrupts++;
}

static void end_activation(struct board *b)
{
    cpu_settle(b);
    const struct running *top = &b->running[b->depth];
    struct board_cost *cost = &b->cost[top->exception];
    cost->instructions += top->instructions;
    cost->cycles += top->cycles;
    cost->worst_instructions =
        top->instructions > cost->worst_instructions ? top->instructions : cost->worst_instructions;
    cost->worst_cycles = top->cycles > cost->worst_cycles ? top->cycles : cost->worst_cycles;
    b->depth--;
}

/* Puts the CPU into the handler; xPSR first, because it decides which stack pointer SP is. */
static void enter_handler(struct board *b, unsigned exception, uint32_t xpsr, uint32_t control,
                          uint32_t exc_return)
{
    uint32_t vector = 0;
    const uint8_t *entry = cpu_memory(b, b->scb.vtor + 4 * exception, 4, false);
    if (entry == NULL) {
        lock_up(b);
        return;
    }
    memcpy(&vector, entry, sizeof vector);
    cpu_set(b, UC_ARM_REG_XPSR_NZCVQG, (xpsr & 0xF80F0000u) | XPSR_T | exception);
    if ((control & ~1u) != 0) {
        cpu_set(b, UC_ARM_REG_CONTROL, control & 1u);
    }
    b->core.r[REG_LR] = exc_return;
    cpu_set(b, UC_ARM_REG_PC, vector);
    b->it_left = 0;
    nvic_pend(b, exception, false);
    nvic_set_active(b, exception, true);
    begin_activation(b, exception);
}

/* SP moves whether or not there is memory; what lies in memory is written. False: not all of it does. */
static bool store_frame(struct board *b, uint32_t base, const uint32_t *words, uint32_t size)
{
    uint8_t *frame = cpu_memory(b, base, size, true);
    if (frame != NULL) {
        memcpy(frame, words, size);
    }
    for (uint32_t i = 0; i < size / 4 && frame == NULL; i++) {
        uint8_t *word = cpu_memory(b, base + 4 * i, 4, true);
        if (word != NULL) {
            memcpy(word, &words[i], 4);
        }
    }
    return frame != NULL;
}

static bool push_frame(struct board *b, uint32_t return_pc, uint32_t xpsr, bool fp)
{
    uint32_t words[FP_FRAME_WORDS] = {0};
    const uint32_t sp = b->core.r[REG_SP];
    for (int i = 0; i < FRAME_REGISTERS; i++) {
        words[i] = b->core.r[frame_registers[i]];
    }
    uint32_t size = 4u * (fp ? FP_FRAME_WORDS : FRAME_WORDS);
    bool aligned = (sp & 4u) == 0 || ((b->scb.ccr & CCR_STKALIGN) == 0 && !fp);
    uint32_t base = sp - size - (aligned ? 0 : 4);
    words[6] = return_pc & ~1u;
    words[7] = (xpsr & ~XPSR_ALIGN) | XPSR_T | (aligned ? 0 : XPSR_ALIGN);
    if (fp) {
        memcpy(words + FRAME_WORDS, b->core.s, (size_t)4 * FP_IN_FRAME);
        words[FRAME_WORDS + FP_IN_FRAME] = b->core.fpscr;
    }
    const bool good = store_frame(b, base, words, size);
    cpu_set(b, UC_ARM_REG_SP, base);
    if (fp) {
        b->scb.fpcar = base + 4u * FRAME_WORDS;
    }
    return good;
}

/* The fault of a frame that is not in memory: the bus fault, or the hard fault where that is off or not more
 * urgent than what is interrupted. */
static unsigned stack_fault(struct board *b, uint32_t cfsr, int interrupted)
{
    b->scb.cfsr |= cfsr;
    if ((b->scb.shcsr & SHCSR_BUSFAULTENA) != 0 && nvic_group(b, EXC_BUS_FAULT) < interrupted) {
        return EXC_BUS_FAULT;
    }
    b->scb.hfsr |= HFSR_FORCED;
    return EXC_HARD_FAULT;
}

/* Which exception begins when its frame could not be stacked: the more urgent one of it and the fault; the
 * other waits. The bus fault's own handler runs all the same (PM0214 section 2.4.2); the hard fault's cannot.
 */
static unsigned after_stack_error(struct board *b, unsigned exception)
{
    if (exception == EXC_BUS_FAULT) {
        b->scb.cfsr |= STKERR;
        return exception;
    }
    const unsigned fault = stack_fault(b, STKERR, nvic_execution_priority(b));
    if (exception == EXC_HARD_FAULT) {
        lock_up(b);
        return 0;
    }
    const bool derived_first = nvic_group(b, fault) < nvic_group(b, exception);
    nvic_pend(b, derived_first ? exception : fault, true);
    return derived_first ? fault : exception;
}

static void stack_and_enter(struct board *b, unsigned exception, uint32_t return_pc)
{
    const uint32_t control = b->core.control;
    const uint32_t xpsr = core_xpsr(&b->core);
    bool handler = (xpsr & XPSR_EXCEPTION) != 0;
    bool fp = (control & CONTROL_FPCA) != 0 && (b->scb.fpccr & FPCCR_ASPEN) != 0;
    spend(b, ENTRY_CYCLES + (fp ? FP_CYCLES : 0));
    if (!push_frame(b, return_pc, xpsr, fp)) {
        exception = after_stack_error(b, exception);
        if (exception == 0) {
            return;
        }
    }
    uint32_t exc_return = 0xFFFFFFE1u | (fp ? 0 : RETURN_NO_FP);
    if (!handler) {
        exc_return |= RETURN_THREAD | ((control & CONTROL_SPSEL) != 0 ? RETURN_PSP : 0);
    }
    enter_handler(b, exception, xpsr, control, exc_return);
}

static void enter(struct board *b, unsigned exception, uint32_t return_pc)
{
    const enum board_phase before = board_enter(b, BOARD_INTERRUPTS);
    stack_and_enter(b, exception, return_pc);
    board_enter(b, before);
}

/* Takes the most urgent exception when it may pre-empt what runs now. */
bool exception_take_pending(struct board *b, uint32_t return_pc)
{
    if (b->nvic.best == 0 || b->nvic.best_priority >= nvic_execution_priority(b)) {
        return false;
    }
    enter(b, b->nvic.best, return_pc);
    return true;
}

/* A frame that is not in memory: its fault follows at once, without stacking (PM0214 section 2.3.7). */
static void fault_of_return(struct board *b, uint32_t exc_return)
{
    const int interrupted = nvic_execution_priority(b);
    const unsigned fault = stack_fault(b, UNSTKERR, interrupted);
    if (fault == EXC_HARD_FAULT && interrupted <= -1) {
        lock_up(b);
        return;
    }
    enter_handler(b, fault, cpu_get(b, UC_ARM_REG_XPSR), cpu_get(b, UC_ARM_REG_CONTROL), exc_return);
}

static void pop_frame(struct board *b, uint32_t exc_return)
{
    bool fp = (exc_return & RETURN_NO_FP) == 0;
    bool thread = (exc_return & RETURN_THREAD) != 0;
    bool psp = (exc_return & RETURN_PSP) != 0;
    uint32_t size = 4u * (fp ? FP_FRAME_WORDS : FRAME_WORDS);
    uint32_t base = cpu_get(b, psp ? UC_ARM_REG_PSP : UC_ARM_REG_MSP);
    const uint8_t *frame = cpu_memory(b, base, size, false);
    if (frame == NULL) {
        fault_of_return(b, exc_return);
        return;
    }
    uint32_t words[FP_FRAME_WORDS];
    memcpy(words, frame, size);
    uint32_t sp = base + size + ((words[7] & XPSR_ALIGN) != 0 ? 4 : 0);
    uint32_t xpsr = words[7] & ~XPSR_ALIGN;
    if (thread != ((xpsr & 0x1FFu) == 0)) {
        exception_fault(b, EXC_USAGE_FAULT, 1u << 18, cpu_get(b, UC_ARM_REG_PC)); /* INVPC */
        return;
    }
    /* xPSR with IPSR decides what SP means; the condition and IT bits come with it. */
    cpu_set(b, psp ? UC_ARM_REG_PSP : UC_ARM_REG_MSP, sp);
    cpu_set(b, UC_ARM_REG_XPSR_NZCVQG, xpsr);
    for (int i = 0; i < FRAME_REGISTERS; i++) {
        b->core.r[frame_registers[i]] = words[i];
    }
    cpu_set(b, UC_ARM_REG_PC, words[6]);
    uint32_t before = cpu_get(b, UC_ARM_REG_CONTROL);
    uint32_t control = (before & 1u) | (thread && psp ? CONTROL_SPSEL : 0) | (fp ? CONTROL_FPCA : 0);
    if (control != before) {
        cpu_set(b, UC_ARM_REG_CONTROL, control);
    }
    if (fp) {
        memcpy(b->core.s, words + FRAME_WORDS, (size_t)4 * FP_IN_FRAME);
        b->core.fpscr = words[FRAME_WORDS + FP_IN_FRAME];
    }
    uint32_t it = ((xpsr >> 8) & 0xFCu) | ((xpsr >> 25) & 3u);
    b->it_left = (it & 0xFu) != 0 ? 4u - (uint32_t)__builtin_ctz(it & 0xFu) : 0;
    if (thread && (b->scb.scr & 2u) != 0) {
        b->sleeping = true; /* SLEEPONEXIT */
    }
}

/* The priority that what we return to executes with, seen before its frame is popped. */
static bool chains(struct board *b)
{
    return b->nvic.best != 0 && b->nvic.best_priority < nvic_execution_priority(b);
}

static void unstack_and_return(struct board *b, uint32_t exc_return)
{
    uint32_t xpsr = cpu_get(b, UC_ARM_REG_XPSR);
    unsigned exception = xpsr & 0x1FFu;
    uint32_t kind = exc_return & 0xFu;
    bool known = (exc_return & 0xFFFFFFE0u) == 0xFFFFFFE0u && (kind == 1 || kind == 9 || kind == 0xD);
    if (exception == 0 || !known || !nvic_bit(b->nvic.active, exception)) {
        exception_fault(b, exception == 0 ? EXC_BUS_FAULT : EXC_USAGE_FAULT,
                        exception == 0 ? 1u << 8 : 1u << 18, exc_return & ~1u);
        return;
    }
    if (exception != EXC_NMI) {
        if (cpu_get(b, UC_ARM_REG_FAULTMASK) != 0) { /* cleared by every return but the NMI's, PM0214 2.1.3 */
            cpu_set(b, UC_ARM_REG_FAULTMASK, 0);
        }
    }
    nvic_set_active(b, exception, false);
    events_run(b, b->now);
    if (chains(b) && !b->reset_wanted) {
        spend(b, CHAIN_CYCLES + flash_waits_of_chained_vector(b));
        end_activation(b);
        b->stats.tail_chains++;
        enter_handler(b, b->nvic.best, xpsr, cpu_get(b, UC_ARM_REG_CONTROL), exc_return);
        return;
    }
    spend(b, EXIT_CYCLES + ((exc_return & RETURN_NO_FP) == 0 ? FP_CYCLES : 0));
    end_activation(b);
    pop_frame(b, exc_return);
}

void exception_return(struct board *b, uint32_t exc_return)
{
    const enum board_phase before = board_enter(b, BOARD_INTERRUPTS);
    unstack_and_return(b, exc_return);
    board_enter(b, before);
}

/* A fault of the instruction at return_pc. It becomes a hard fault when its own handler is off or not urgent
 * enough. */
void exception_fault(struct board *b, unsigned exception, uint32_t cfsr, uint32_t return_pc)
{
    static const uint32_t enable[] = {
        [EXC_MEMORY_FAULT] = 1u << 16, [EXC_BUS_FAULT] = SHCSR_BUSFAULTENA, [EXC_USAGE_FAULT] = 1u << 18};
    b->scb.cfsr |= cfsr;
    int running = nvic_execution_priority(b);
    if (exception != EXC_HARD_FAULT &&
        ((b->scb.shcsr & enable[exception]) == 0 || nvic_group(b, exception) >= running)) {
        b->scb.hfsr |= HFSR_FORCED;
        exception = EXC_HARD_FAULT;
    }
    if (exception == EXC_HARD_FAULT && running <= -1) {
        lock_up(b);
        return;
    }
    enter(b, exception, return_pc);
}

void exception_svc(struct board *b, uint32_t return_pc)
{
    if (nvic_group(b, EXC_SVC) < nvic_execution_priority(b)) {
        enter(b, EXC_SVC, return_pc);
    } else {
        exception_fault(b, EXC_HARD_FAULT, 0, return_pc - 2);
        b->scb.hfsr |= HFSR_FORCED;
    }
}
