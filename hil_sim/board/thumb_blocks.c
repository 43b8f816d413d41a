/* Blocks of code in flash for the interpreter: found by their address, decoded when they first run. */
#include "thumb.h"

#include <stdlib.h>

enum { CHUNK = 64 * 1024, FLASH_PAGES = FLASH_SIZE / CODE_PAGE };

struct code_chunk {
    struct code_chunk *next;
    size_t used;
    _Alignas(16) uint8_t bytes[CHUNK];
};

static void *take(struct code_cache *cache, size_t size)
{
    size = (size + 15u) & ~(size_t)15u;
    if (cache->chunks == NULL || cache->chunks->used + size > CHUNK) {
        struct code_chunk *chunk = malloc(sizeof *chunk);
        if (chunk == NULL) {
            return NULL;
        }
        chunk->next = cache->chunks;
        chunk->used = 0;
        cache->chunks = chunk;
    }
    void *memory = cache->chunks->bytes + cache->chunks->used;
    cache->chunks->used += size;
    return memory;
}

/* All blocks go at once: jumps know each other's. */
void thumb_forget(struct board *b)
{
    struct code_cache *cache = &b->code;
    while (cache->chunks != NULL) {
        struct code_chunk *next = cache->chunks->next;
        free(cache->chunks);
        cache->chunks = next;
    }
    for (uint32_t page = 0; page < FLASH_PAGES; page++) {
        if ((cache->pages[page / 32] >> page % 32 & 1u) != 0) {
            for (uint32_t i = 0; i < CODE_PAGE / 2; i++) {
                cache->at[page * (CODE_PAGE / 2) + i] = NULL;
            }
        }
    }
    memset(cache->pages, 0, sizeof cache->pages);
    cache->stale = false;
}

static void mark_pages(struct board *b, uint32_t first, uint32_t length)
{
    for (uint32_t page = first / CODE_PAGE; page <= (first + length - 1) / CODE_PAGE && page < FLASH_PAGES;
         page++) {
        b->code.pages[page / 32] |= 1u << page % 32;
    }
}

/* Whether decoded code, or a constant in it, comes from this part of flash. */
bool thumb_has_run(const struct board *b, uint32_t first, uint32_t length)
{
    for (uint32_t page = first / CODE_PAGE; page < FLASH_PAGES && page * CODE_PAGE < first + length; page++) {
        if ((b->code.pages[page / 32] >> page % 32 & 1u) != 0) {
            return true;
        }
    }
    return false;
}

struct op *decode_emit(struct decoder *d, op_function *run, unsigned a, unsigned b, unsigned c, uint32_t imm)
{
    struct op *op = &d->ops[d->count++];
    op->run = run;
    op->imm = imm;
    op->a = (uint8_t)a;
    op->b = (uint8_t)b;
    op->c = (uint8_t)c;
    op->at = (uint8_t)((d->pc - d->first) / 2);
    return op;
}

/* What an instruction reads as PC: its own address plus four, PM0214 2.1.3. */
uint32_t decode_pc(const struct decoder *d)
{
    return d->pc + 4;
}

/* `c` is the ITSTATE of the block that follows; zero, but for a page that ends inside an IT block. */
void decode_jump(struct decoder *d, uint32_t target)
{
    decode_emit(d, op_jump, 0, 0, 0, target);
    d->ended = true;
}

op_function *decode_unless(unsigned condition)
{
#define SKIP(name, holds) op_skip_unless_##name,
    static op_function *const skips[] = {CONDITIONS(SKIP)};
    return skips[condition];
}

/* Followed by the jumps for both cases. */
void decode_branch_if(struct decoder *d, unsigned condition, uint32_t target)
{
#define BRANCH(name, holds)  op_b_##name,
#define COMPARE(name, holds) {op_cmp_b_##name, op_cmp_i_b_##name},
    static op_function *const branches[] = {CONDITIONS(BRANCH)};
    static op_function *const comparisons[][2] = {CONDITIONS(COMPARE)};
    struct op *last = d->count != 0 ? &d->ops[d->count - 1] : NULL;
    const bool compares = last != NULL && !d->after_it && (last->run == op_cmp || last->run == op_cmp_i);
    if (compares) {
        last->run = comparisons[condition][last->run == op_cmp_i ? 1 : 0];
    } else {
        decode_emit(d, branches[condition], 0, 0, 0, 0);
    }
    decode_emit(d, op_jump, 0, 0, 0, target);
    decode_jump(d, d->pc + d->size);
}

static uint32_t half_word(const uint8_t *code)
{
    return (uint32_t)code[0] | (uint32_t)code[1] << 8;
}

static bool is_wide(uint32_t op)
{
    return op >= 0xE800u;
}

/* ITSTATE after one more instruction of the IT block (PM0214 2.1.3, 3.9.3). */
static uint8_t advance(uint32_t itstate)
{
    return (itstate & 7u) == 0 ? 0 : (uint8_t)((itstate & 0xE0u) | (itstate << 1 & 0x1Fu));
}

static bool is_it(uint32_t op)
{
    return (op & 0xFF00u) == 0xBF00u && (op & 0xFu) != 0;
}

/* The engine ends a block where the next instruction touches another page. */
static bool touches_next_page(const struct decoder *d, uint32_t next)
{
    const uint32_t begin = d->first & ~(uint32_t)(CODE_PAGE - 1);
    const uint32_t used = next - begin;
    return used >= CODE_PAGE || (used >= CODE_PAGE - 3 && is_wide(half_word(d->code + (next - d->first))));
}

static bool decode_instruction(struct decoder *d, uint32_t op)
{
    const uint32_t at = d->pc - d->first;
    return d->size == 4 ? decode_32(d, op, half_word(d->code + at + 2)) : decode_16(d, op);
}

/* One instruction and, inside an IT block, the condition in front of it. */
static bool decode_conditional(struct decoder *d, uint32_t op)
{
    const unsigned condition = d->itstate >> 4;
    if (!decode_in_it(d) || condition >= 0xEu) {
        return decode_instruction(d, op);
    }
    const uint32_t skip = d->count;
    decode_emit(d, decode_unless(condition), 0, 0, 0, 0);
    if (!decode_instruction(d, op)) {
        return false;
    }
    d->ops[skip].imm = d->count - skip;
    return true;
}

/* False: something in it is left to the engine, and so is the whole block. */
static bool decode(struct decoder *d, uint32_t room)
{
    uint32_t next = d->first;
    bool was_in_it = false;
    for (unsigned instructions = 0; !d->ended; instructions++) {
        d->pc = next;
        const uint32_t at = d->pc - d->first;
        if (at + 4 > room || at / 2 > BLOCK_HALF_WORDS || instructions > BLOCK_INSTRUCTIONS) {
            return false;
        }
        const uint32_t op = half_word(d->code + at);
        d->size = is_wide(op) ? 4 : 2;
        const bool in_it = decode_in_it(d);
        d->after_it = was_in_it;
        was_in_it = in_it;
        next = d->pc + d->size;
        if (is_it(op)) {
            if (in_it) {
                return false;
            }
            d->itstate = (uint8_t)op;
        } else {
            const bool decoded = decode_conditional(d, op);
            if (!decoded) {
                return false;
            }
            d->itstate = in_it ? advance(d->itstate) : 0;
        }
        if (d->ended && in_it) { /* its condition may not hold */
            decode_emit(d, op_jump, 0, 0, d->itstate, next);
        }
        if (!d->ended && touches_next_page(d, next)) {
            decode_emit(d, op_jump, 0, 0, d->itstate, next);
            d->ended = true;
        }
    }
    d->pc = next;
    return true;
}

static struct code_block *keep(struct board *b, const struct decoder *d, uint8_t itstate)
{
    const size_t ops = sizeof(struct op) * d->count;
    struct code_block *block = take(&b->code, sizeof *block + ops);
    if (block == NULL) {
        return NULL;
    }
    const uint32_t length = d->pc - d->first;
    block->pc = d->first;
    block->itstate = itstate;
    const uint32_t it_left = (itstate & 0xFu) != 0 ? 4u - (uint32_t)__builtin_ctz(itstate & 0xFu) : 0;
    block_measure(d->code, length, it_left, &block->measure);
    memcpy(block->ops, d->ops, ops);
    mark_pages(b, d->first - FLASH_BASE, length);
    return block;
}

static struct code_block *decode_at(struct board *b, uint32_t pc, uint8_t itstate)
{
    const uint32_t offset = pc - FLASH_BASE;
    struct decoder d = {.board = b, .code = b->flash_array + offset, .first = pc, .itstate = itstate};
    return decode(&d, FLASH_SIZE - offset) ? keep(b, &d, itstate) : NULL;
}

/* The block at an address, NULL where the engine has to execute it. */
struct code_block *thumb_find(struct board *b, uint32_t pc, uint8_t itstate)
{
    static struct code_block none;
    const uint32_t offset = pc - FLASH_BASE;
    if (offset >= FLASH_SIZE || b->engine_only) {
        return NULL;
    }
    if (itstate != 0) {
        return decode_at(b, pc, itstate);
    }
    struct code_block **known = &b->code.at[offset / 2];
    if (*known == NULL) {
        struct code_block *made = decode_at(b, pc, 0);
        *known = made != NULL ? made : &none;
        mark_pages(b, offset, 2);
    }
    return *known != &none ? *known : NULL;
}

/* The ITSTATE with which the instruction at `pc` executes, reached from that at `begin`, which has the given
 * one. */
uint8_t thumb_itstate(const struct board *b, uint32_t begin, uint8_t itstate, uint32_t pc)
{
    for (uint32_t at = begin; at < pc;) {
        const uint8_t *code = cpu_memory(b, at, 2, false);
        if (code == NULL) {
            return 0;
        }
        const uint32_t op = half_word(code);
        itstate = is_it(op) ? (uint8_t)op : advance(itstate);
        at += is_wide(op) ? 4 : 2;
    }
    return itstate;
}

/* A word or less of flash that stays what it is as long as the block is kept. */
bool decode_literal(struct decoder *d, uint32_t address, unsigned size, uint32_t *value)
{
    const uint32_t offset = address - FLASH_BASE;
    if (offset > FLASH_SIZE - size || address % size != 0) {
        return false;
    }
    *value = 0;
    memcpy(value, d->board->flash_array + offset, size);
    mark_pages(d->board, offset, size);
    return true;
}
