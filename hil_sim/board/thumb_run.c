/* Runs decoded blocks one after another, with branches between them, until the CPU has to look up. */
#include "thumb.h"

/* Goes on at an address that is known now. */
void thumb_continue_at(struct board *b, uint32_t pc)
{
    const uint32_t offset = pc - FLASH_BASE;
    R(REG_PC) = pc;
    b->code.next = offset < FLASH_SIZE ? b->code.at[offset / 2] : NULL;
    if (b->code.next == NULL || b->code.next->pc != pc) {
        b->code.next = thumb_find(b, pc, 0);
    }
}

/* A jump that has been taken before. */
static void op_linked_jump(struct board *b, struct op *op)
{
    b->code.next = op->link;
}

/* A jump to imm; c is the ITSTATE there. */
void op_jump(struct board *b, struct op *op)
{
    struct code_block *block = thumb_find(b, op->imm, op->c);
    b->code.next = block;
    if (block == NULL) {
        R(REG_PC) = op->imm;
        core_set_itstate(&b->core, op->c);
        return;
    }
    op->run = op_linked_jump;
    op->link = block;
}

void op_branch_temp(struct board *b, struct op *op)
{
    (void)op;
    thumb_continue_at(b, R(REG_TEMP) & ~1u);
}

void op_bx(struct board *b, struct op *op)
{
    const uint32_t target = R(op->a);
    if ((target & 1u) == 0) {
        thumb_escape(b, op);
        return;
    }
    thumb_continue_at(b, target & ~1u);
}

void op_blx(struct board *b, struct op *op)
{
    const uint32_t target = R(op->a);
    if ((target & 1u) == 0) {
        thumb_escape(b, op);
        return;
    }
    R(REG_LR) = op->imm | 1u;
    thumb_continue_at(b, target & ~1u);
}

static void table_branch(struct board *b, struct op *op, uint32_t address, uint32_t size)
{
    uint32_t entry = 0;
    const uint8_t *memory = cpu_memory(b, address, size, false);
    if (memory == NULL) {
        thumb_escape(b, op);
        return;
    }
    memcpy(&entry, memory, size);
    thumb_continue_at(b, op->imm + 2 * entry);
}

void op_tbb(struct board *b, struct op *op)
{
    table_branch(b, op, R(op->a) + R(op->b), 1);
}

void op_tbh(struct board *b, struct op *op)
{
    table_branch(b, op, R(op->a) + 2 * R(op->b), 2);
}

/* The two jumps follow. */
static inline void choose(struct board *b, struct op *op, bool taken)
{
    op += taken ? 1 : 2;
    if (op->run == op_linked_jump) { /* a test is cheaper than a call that has to be predicted */
        op_linked_jump(b, op);
    } else {
        op_jump(b, op);
    }
}

void op_cbz(struct board *b, struct op *op)
{
    choose(b, op, R(op->a) == 0);
}

void op_cbnz(struct board *b, struct op *op)
{
    choose(b, op, R(op->a) != 0);
}

#define CONDITIONAL(name, holds)                                                                             \
    void op_b_##name(struct board *b, struct op *op)                                                         \
    {                                                                                                        \
        choose(b, op, holds);                                                                                \
    }                                                                                                        \
    void op_skip_unless_##name(struct board *b, struct op *op)                                               \
    {                                                                                                        \
        op += (holds) ? 1 : op->imm;                                                                         \
        op->run(b, op);                                                                                      \
    }
CONDITIONS(CONDITIONAL)

#define COMPARE_AND_BRANCH(name, holds)                                                                      \
    void op_cmp_b_##name(struct board *b, struct op *op)                                                     \
    {                                                                                                        \
        difference_with_flags(b, R(op->b), R(op->c));                                                        \
        choose(b, op, holds);                                                                                \
    }                                                                                                        \
    void op_cmp_i_b_##name(struct board *b, struct op *op)                                                   \
    {                                                                                                        \
        difference_with_flags(b, R(op->b), op->imm);                                                         \
        choose(b, op, holds);                                                                                \
    }
CONDITIONS(COMPARE_AND_BRANCH)

void op_wfi(struct board *b, struct op *op)
{
    R(REG_PC) = op->imm;
    b->code.next = NULL;
    b->code.stop = THUMB_WAITS;
}

/* The engine executes this instruction and the rest of the block. */
void thumb_escape(struct board *b, struct op *op)
{
    const uint32_t pc = b->block_pc + 2u * op->at;
    R(REG_PC) = pc;
    core_set_itstate(&b->core, thumb_itstate(b, b->block_pc, b->code.running->itstate, pc));
    b->code.next = NULL;
    b->code.stop = THUMB_ESCAPES;
}

/* As cpu_begin_block and its finish_block, on the one path that is worth it: once for every five
 * instructions. */
static inline bool begin(struct board *b, struct code_block *block)
{
    const uint64_t now = b->now + b->current.cycles;
    b->now = now;
    b->busy_cycles += b->current.cycles;
    b->stats.instructions += b->current.instructions;
    b->it_left = b->current.it_left;
    b->accesses = 0;
    b->moment = b->moment < now ? now : b->moment;
    b->block_pc = block->pc;
    b->code.running = block;
    if (now >= b->break_at && b->it_left == 0) {
        b->current = (struct block){0};
        return cpu_look_up(b);
    }
    return true;
}

/* From the given block on, until code comes that is not known, or something else has to be seen to first;
 * why, says b->code.stop. */
void thumb_run(struct board *b, struct code_block *block)
{
    b->code.stop = THUMB_LEAVES;
    while (block != NULL) {
        if (!begin(b, block)) {
            R(REG_PC) = block->pc;
            b->code.stop = THUMB_AT_BLOCK;
            return;
        }
        if ((block->measure.flags & BLOCK_FP) != 0 && b->no_fp) {
            R(REG_PC) = block->pc;
            b->current = (struct block){0};
            b->code.stop = THUMB_NO_FP;
            return;
        }
        b->current = block->measure;
        block->ops[0].run(b, block->ops);
        block = b->code.next;
    }
}
