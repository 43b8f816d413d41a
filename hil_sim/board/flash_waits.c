/* Flash wait states and the ART accelerator, RM0090 section 3.5: the cycles that reads of flash take beyond
 * the first. Counted on request only (board_count_flash_waits), because each block and each load then costs
 * the emulation several times as much.
 *
 * A read brings a line of 16 bytes after LATENCY wait states, one read at a time. Three kinds of line come
 * without waiting (section 3.5.2): the one that is executed, the next one once it has been prefetched
 * (PRFTEN), and those kept in the two caches, 64 lines of code (ICEN) and 8 of data (DCEN), the least
 * recently used replaced. Only a miss is kept, a line that was prefetched in time is not. Literals and tables
 * are data.
 *
 * The manual leaves open, and is assumed here: a line that is still being prefetched when the CPU needs it is
 * a miss, and kept; a prefetch begins with each new line, is never abandoned, and what misses meanwhile waits
 * for it as well; the CPU executes nothing ahead of a line that it waits for. The vector of an exception is
 * read while the registers are stacked, which takes longer; a tail-chained one is waited for. */
#include "machine.h"

#include <string.h>

enum { CODE_LINES = 64, DATA_LINES = 8 };
enum { LATENCY = 7, PRFTEN = 1 << 8, ICEN = 1 << 9, DCEN = 1 << 10, ICRST = 1 << 11, DCRST = 1 << 12 };

static bool is_flash(uint32_t address)
{
    return address < FLASH_SIZE || address - FLASH_BASE < FLASH_SIZE;
}

static uint32_t line_of(uint32_t address)
{
    return (address < FLASH_BASE ? address : address - FLASH_BASE) / FLASH_LINE + 1u; /* 0 is none */
}

static bool is_kept(struct flash_cache *c, uint32_t line, uint64_t now)
{
    const uint8_t place = c->place[line];
    if (place != 0) {
        c->used[place - 1] = now;
    }
    return place != 0;
}

static void keep(struct flash_cache *c, size_t count, uint32_t line, uint64_t now)
{
    size_t oldest = 0;
    for (size_t i = 1; i < count; i++) {
        oldest = c->used[i] < c->used[oldest] ? i : oldest;
    }
    c->place[c->line[oldest]] = 0;
    c->line[oldest] = line;
    c->used[oldest] = now;
    c->place[line] = (uint8_t)(oldest + 1);
}

static void forget(struct flash_cache *c)
{
    for (size_t i = 0; i < FLASH_KEPT_LINES; i++) {
        c->place[c->line[i]] = 0;
        c->line[i] = 0;
        c->used[i] = 0;
    }
}

/* One read of the array, asked for at `now`; returns when the CPU has it. */
static uint64_t read_array(struct board *b, uint64_t now)
{
    struct flash_waits *w = &b->flash_waits;
    const uint64_t begin = now > w->free_at ? now : w->free_at;
    const uint64_t ready = begin + (b->flash.acr & LATENCY);
    w->free_at = ready + 1;
    return ready;
}

/* The CPU goes on in this line of code at `now`; returns when it can. */
static uint64_t execute(struct board *b, uint32_t line, uint64_t now)
{
    struct flash_waits *w = &b->flash_waits;
    const bool cached = (b->flash.acr & ICEN) != 0;
    if (line == w->executed) {
        return now;
    }
    const uint64_t asked = now;
    if (line == w->prefetched) {
        now = now > w->prefetched_at ? now : w->prefetched_at;
    } else if (!cached || !is_kept(&w->code, line, now)) {
        now = read_array(b, now);
    }
    if (cached && now > asked) {
        keep(&w->code, CODE_LINES, line, now);
    }
    w->executed = line;
    w->prefetched = 0;
    if ((b->flash.acr & PRFTEN) != 0) {
        w->prefetched = line + 1;
        const bool there = cached && is_kept(&w->code, line + 1, now);
        w->prefetched_at = there ? now : read_array(b, now);
    }
    return now;
}

static uint64_t load(struct board *b, uint32_t address, uint64_t now)
{
    struct flash_waits *w = &b->flash_waits;
    const uint32_t line = line_of(address);
    const bool cached = (b->flash.acr & DCEN) != 0;
    if (cached && is_kept(&w->data, line, now)) {
        return now;
    }
    now = read_array(b, now);
    if (cached) {
        keep(&w->data, DATA_LINES, line, now);
    }
    return now;
}

/* The address of the literal that the instruction at `pc` loads; 0: none. */
static uint32_t literal(uint32_t pc, uint16_t op, uint16_t second)
{
    const uint32_t base = (pc + 4u) & ~3u;
    if ((op & 0xF800u) == 0x4800u) {
        return base + (op & 0xFFu) * 4u; /* LDR */
    }
    if ((op & 0xFF7Fu) == 0xF85Fu) {
        const uint32_t offset = second & 0xFFFu; /* LDR.W */
        return (op & 0x80u) != 0 ? base + offset : base - offset;
    }
    if ((op & 0xFF3Fu) == 0xED1Fu || (op & 0xFE5Fu) == 0xE85Fu) {
        const uint32_t offset = (second & 0xFFu) * 4u; /* VLDR, LDRD */
        return (op & 0x80u) != 0 ? base + offset : base - offset;
    }
    return 0;
}

uint32_t flash_waits_of_block(struct board *b, uint32_t pc, uint32_t size)
{
    struct flash_waits *w = &b->flash_waits;
    w->literals = 0;
    if (!is_flash(pc)) {
        w->executed = w->prefetched = 0;
        return 0;
    }
    const uint8_t *code = cpu_memory(b, pc, size, false);
    uint64_t now = b->now;
    uint64_t cycles = 0;
    for (uint32_t at = 0; at < size;) {
        uint16_t op;
        uint16_t second = 0;
        memcpy(&op, code + at, sizeof op);
        const bool wide = op >= 0xE800u;
        now = execute(b, line_of(pc + at), now);
        if (wide) {
            memcpy(&second, code + at + 2, sizeof second);
            now = execute(b, line_of(pc + at + 2), now);
        }
        const uint32_t address = literal(pc + at, op, second);
        if (address != 0 && is_flash(address) && w->literals < FLASH_LITERALS) {
            w->literal[w->literals++] = address;
            now = load(b, address, now);
        }
        const uint32_t cost = instruction_cycles(op, second);
        now += cost;
        cycles += cost;
        at += wide ? 4 : 2;
    }
    return (uint32_t)(now - b->now - cycles);
}

/* Loads other than literals, whose place in the block is not known: counted at its end, behind its own. */
static void on_load(uc_engine *uc, uc_mem_type type, uint64_t address, int size, int64_t value, void *user)
{
    struct board *b = user;
    struct flash_waits *w = &b->flash_waits;
    (void)uc;
    (void)type;
    (void)size;
    (void)value;
    cpu_engine_read_state(b);
    for (uint32_t i = 0; i < w->literals; i++) {
        if (w->literal[i] == (uint32_t)address) {
            return;
        }
    }
    const uint64_t now = b->now + b->current.cycles;
    b->current.cycles = (uint16_t)(b->current.cycles + (load(b, (uint32_t)address, now) - now));
}

uint32_t flash_waits_of_chained_vector(const struct board *b)
{
    return b->flash_waits.counted && is_flash(b->scb.vtor) ? b->flash.acr & LATENCY : 0;
}

/* The caches are emptied only while they are off (RM0090 section 3.5.2). */
void flash_waits_control(struct board *b, uint32_t acr)
{
    struct flash_waits *w = &b->flash_waits;
    if ((acr & (ICRST | ICEN)) == ICRST) {
        forget(&w->code);
    }
    if ((acr & (DCRST | DCEN)) == DCRST) {
        forget(&w->data);
    }
}

void flash_waits_reset(struct board *b)
{
    struct flash_waits *w = &b->flash_waits;
    forget(&w->code);
    forget(&w->data);
    w->executed = w->prefetched = w->literals = 0;
    w->free_at = 0;
}

bool board_count_flash_waits(struct board *board)
{
    if (board->flash_waits.counted) {
        return true;
    }
    static const uint64_t flash_at[] = {FLASH_BASE, 0};
    bool good = true;
    for (size_t i = 0; i < 2; i++) {
        void (*const callback)(uc_engine *, uc_mem_type, uint64_t, int, int64_t, void *) = on_load;
        void *pointer;
        memcpy(&pointer, &callback, sizeof pointer);
        uc_hook handle;
        good = good && uc_hook_add(board->uc, &handle, UC_HOOK_MEM_READ, pointer, board, flash_at[i],
                                   flash_at[i] + FLASH_SIZE - 1) == UC_ERR_OK;
    }
    uc_ctl_flush_tb(board->uc); /* loads translated before do not ask for hooks */
    board->flash_waits.counted = good;
    board_set_engine_only(board, true); /* the interpreter's loads pass no hook */
    return good;
}
