/* The flash controller: unlock keys, sector erase and programming that stall the CPU, RM0090 section 3. */
#include "machine.h"

#include <string.h>

enum { EOP = 1 << 0, WRPERR = 1 << 4, PGAERR = 1 << 5, PGPERR = 1 << 6, PGSERR = 1 << 7, BSY = 1 << 16 };
enum { PG = 1 << 0, SER = 1 << 1, MER = 1 << 2, STRT = 1 << 16, EOPIE = 1 << 24, LOCK = 1u << 31 };
enum { OPTLOCK = 1 << 0, OPTSTRT = 1 << 1 };
enum { IRQ_FLASH = 4, SECTORS = 12 };
/* Times at 2.7 to 3.6 V, typical and longest, STM32F405 datasheet table 40. */
static const struct times {
    uint64_t program_us, erase_16k_us, erase_64k_us, erase_128k_us, erase_all_us;
} times[] = {{16, 250000, 550000, 1000000, 8000000}, {100, 500000, 1100000, 2000000, 16000000}};

static uint64_t longest_or_typical(const struct board *b, uint64_t typical_us, uint64_t longest_us)
{
    return (b->flash_slow ? longest_us : typical_us) * PS_PER_US;
}
#define TIME_PS(b, what) longest_or_typical(b, times[0].what, times[1].what)

/* Four sectors of 16 KiB, one of 64, seven of 128 (RM0090 table 5). */
static uint32_t sector_start(uint32_t sector)
{
    return sector <= 4 ? sector * 0x4000u : (sector - 4) * 0x20000u;
}

static uint32_t sector_size(uint32_t sector)
{
    return sector_start(sector + 1) - sector_start(sector);
}

/* The engine may hold a translation of code that was here; it is discarded between two blocks. */
static void changed(struct board *b, uint32_t first, uint32_t length)
{
    struct flash *f = &b->flash;
    bool none = f->stale_end == 0;
    f->stale_first = none || first < f->stale_first ? first : f->stale_first;
    f->stale_end = first + length > f->stale_end ? first + length : f->stale_end;
    cpu_update_break(b);
}

static uint64_t tear_noise(struct board *b)
{
    uint64_t x = b->tear_state;
    x ^= x << 13;
    x ^= x >> 7;
    x ^= x << 17;
    b->tear_state = x;
    return x;
}

/* An interrupted operation leaves undefined content (RM0090 3.6). Here each bit that was to change has
 * changed or not, by a seeded draw: early in the operation few have, late nearly all. `share` in 1/256 of
 * it. */
static void tear(struct board *b, uint32_t share)
{
    const struct operation *o = &b->flash.operation;
    for (uint32_t i = o->first; i < o->first + o->length; i++) {
        uint8_t old = b->flash_before[i];
        uint8_t left = old ^ b->flash_array[i];
        uint64_t draws = left != 0 ? tear_noise(b) : 0;
        for (; left != 0; left &= (uint8_t)(left - 1u), draws >>= 7) {
            if ((draws & 0x7Fu) * 2u < share) {
                old ^= (uint8_t)(left & -left);
            }
        }
        b->flash_array[i] = old;
    }
    changed(b, o->first, o->length);
}

/* A reset or power-off during an operation. */
static void interrupt_operation(struct board *b)
{
    const struct operation *o = &b->flash.operation;
    const uint64_t now = time_to_ps(b, b->moment);
    if ((b->flash.sr & BSY) != 0 && now < o->end_ps) {
        const uint64_t past = now > o->begin_ps ? now - o->begin_ps : 0;
        tear(b, (uint32_t)(past * 256u / (o->end_ps - o->begin_ps)));
    }
}

void flash_reset(struct board *b)
{
    flash_cache_settle(b, 0, FLASH_SIZE);
    interrupt_operation(b);
    const struct flash before = b->flash;
    b->flash = (struct flash){.cr = LOCK,
                              .optcr = b->option_bytes | OPTLOCK,
                              .stale_first = before.stale_first,
                              .stale_end = before.stale_end};
    b->stall_until = 0;
    flash_waits_reset(b);
    event_cancel(b, EVENT_FLASH);
}

/* Code is fetched from flash, so that the CPU waits until the operation is over; code in SRAM runs on. */
static void busy_for(struct board *b, uint64_t ps)
{
    uint64_t now = time_to_ps(b, b->moment);
    uint64_t begin = now > b->flash.busy_until_ps ? now : b->flash.busy_until_ps; /* stores queue up */
    uint64_t end = begin + ps;
    b->flash.operation.begin_ps = begin;
    b->flash.operation.end_ps = end;
    b->flash.busy_until_ps = end;
    b->flash.sr |= BSY;
    event_at_ps(b, EVENT_FLASH, end);
    if (b->block_pc < SRAM_BASE) {
        b->stall_until = time_to_cycle(b, end);
        cpu_update_break(b);
    }
}

void flash_event(struct board *b)
{
    b->flash.sr &= ~(uint32_t)BSY;
    b->flash.cr &= ~(uint32_t)STRT;
    if ((b->flash.cr & EOPIE) != 0) {
        b->flash.sr |= EOP;
    }
    nvic_set_line(b, IRQ_FLASH, (b->flash.sr & EOP) != 0 && (b->flash.cr & EOPIE) != 0);
}

/* True when the supply fails during this operation. */
static bool cut_now(struct board *b)
{
    if (b->flash_cut_after < 0) {
        return false;
    }
    return b->flash_cut_after-- == 0;
}

void flash_forget_code(struct board *b)
{
    struct flash *f = &b->flash;
    blocks_forget(b, f->stale_first & ~3u, ((f->stale_end + 3u) & ~3u) - (f->stale_first & ~3u));
    uc_ctl_remove_cache(b->uc, (uint64_t)FLASH_BASE + f->stale_first, (uint64_t)FLASH_BASE + f->stale_end);
    uc_ctl_remove_cache(b->uc, (uint64_t)f->stale_first, (uint64_t)f->stale_end);
    f->stale_end = 0;
}

/* The cells are about to change; their content is kept in case the operation is interrupted. */
static void begin_operation(struct board *b, uint32_t first, uint32_t length)
{
    flash_cache_settle(b, first, length);
    memcpy(b->flash_before + first, b->flash_array + first, length);
    b->flash.operation = (struct operation){.first = first, .length = length};
    changed(b, first, length);
}

/* The array holds the new content already; the CPU cannot read before the time is over. */
static void run_operation(struct board *b, uint64_t ps)
{
    if (cut_now(b)) {
        tear(b, (uint32_t)(tear_noise(b) >> 32) % 257u);
        board_power(b, false);
    } else {
        busy_for(b, ps);
    }
}

static void erase(struct board *b, uint32_t first, uint32_t length, uint64_t ps)
{
    begin_operation(b, first, length);
    memset(b->flash_array + first, 0xFF, length);
    run_operation(b, ps);
    if (b->powered) {
        flash_cache_erased(b, first, length);
    }
}

static void start_erase(struct board *b)
{
    if ((b->flash.cr & MER) != 0) {
        erase(b, 0, FLASH_SIZE, TIME_PS(b, erase_all_us));
        return;
    }
    uint32_t sector = b->flash.cr >> 3 & 0xFu;
    if ((b->flash.cr & SER) == 0 || sector >= SECTORS) {
        b->flash.sr |= PGSERR;
        return;
    }
    uint32_t size = sector_size(sector);
    erase(b, sector_start(sector), size,
          size == 0x4000u    ? TIME_PS(b, erase_16k_us)
          : size == 0x10000u ? TIME_PS(b, erase_64k_us)
                             : TIME_PS(b, erase_128k_us));
}

/* A store into the array, which the engine itself discards. It has to be as wide as PSIZE says, and only
   clears bits; the first store that is not allowed raises an error flag (RM0090 3.6.3 and 3.8.4). */
bool flash_store(struct board *b, uint32_t address, uint32_t size, uint64_t value)
{
    struct flash *f = &b->flash;
    uint32_t offset = address >= FLASH_BASE ? address - FLASH_BASE : address;
    if (offset >= FLASH_SIZE || size > FLASH_SIZE - offset) {
        return false;
    }
    if ((f->cr & (LOCK | PG)) != PG) {
        f->sr |= PGSERR;
        warn_once(b, 0xF0000010u, "store into flash without FLASH_CR.PG: ignored");
        return true;
    }
    if (size != 1u << (f->cr >> 8 & 3u)) {
        f->sr |= PGPERR;
        warn_once(b, 0xF0000012u, "store into flash is not as wide as FLASH_CR.PSIZE: ignored");
        return true;
    }
    if ((f->sr & (WRPERR | PGAERR | PGPERR | PGSERR)) != 0) {
        return true;
    }
    begin_operation(b, offset, size);
    for (uint32_t i = 0; i < size; i++) {
        b->flash_array[offset + i] &= (uint8_t)(value >> (8 * i));
    }
    run_operation(b, TIME_PS(b, program_us));
    return true;
}

static void write_cr(struct board *b, uint32_t value)
{
    struct flash *f = &b->flash;
    if ((f->cr & LOCK) != 0) {
        warn_once(b, 0xF0000011u, "FLASH_CR written while locked: ignored");
        return;
    }
    if ((f->sr & BSY) != 0) {
        return;
    }
    f->cr = value & (LOCK | EOPIE | 1u << 25 | STRT | 0x3FFu);
    if ((value & STRT) != 0) {
        start_erase(b);
    }
}

/* Option bytes: written to the register, stored by OPTSTRT, in force from the next reset (RM0090 section
 * 3.7.2). */
static void write_optcr(struct board *b, uint32_t value)
{
    struct flash *f = &b->flash;
    if ((f->optcr & OPTLOCK) != 0) {
        warn_once(b, 0xF0000013u, "FLASH_OPTCR written while locked: ignored");
        return;
    }
    if ((f->sr & BSY) != 0) {
        return;
    }
    f->optcr = value & 0x0FFFFFEFu & ~(uint32_t)OPTSTRT;
    if ((value & OPTSTRT) != 0) {
        b->option_bytes = f->optcr & ~(uint32_t)OPTLOCK;
        begin_operation(b, 0, 0);
        busy_for(b, TIME_PS(b, erase_16k_us));
    }
    f->opt_key_step = (f->optcr & OPTLOCK) != 0 ? 0 : f->opt_key_step;
}

bool flash_access(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    static const uint32_t keys[] = {0x45670123u, 0xCDEF89ABu};
    static const uint32_t option_keys[] = {0x08192A3Bu, 0x4C5D6E7Fu};
    struct flash *f = &b->flash;
    switch (offset) {
    case 0x00:
        if (write) {
            f->acr = *value & 0x1F07u;
            flash_waits_control(b, f->acr);
            flash_cache_control(b);
        }
        *value = f->acr;
        return true;
    case 0x04: /* a wrong key locks the register until the next reset (RM0090 3.6.1) */
        if (write && f->key_step < 2) {
            f->key_step = *value == keys[f->key_step] ? (uint8_t)(f->key_step + 1) : 3;
            f->cr &= f->key_step == 2 ? ~(uint32_t)LOCK : ~0u;
            flash_cache_unlocked(b);
        }
        return true;
    case 0x08:
        if (write && f->opt_key_step < 2) {
            f->opt_key_step = *value == option_keys[f->opt_key_step] ? (uint8_t)(f->opt_key_step + 1) : 3;
            f->optcr &= f->opt_key_step == 2 ? ~(uint32_t)OPTLOCK : ~0u;
        }
        return true;
    case 0x0C:
        if (write) {
            f->sr &= ~(*value & 0xF3u);
            nvic_set_line(b, IRQ_FLASH, (f->sr & EOP) != 0 && (f->cr & EOPIE) != 0);
        }
        *value = f->sr;
        return true;
    case 0x10:
        if (write) {
            write_cr(b, *value);
            f->key_step = (f->cr & LOCK) != 0 && f->key_step == 2 ? 0 : f->key_step;
        }
        *value = f->cr;
        return true;
    case 0x14:
        if (write) {
            write_optcr(b, *value);
        }
        *value = f->optcr;
        return true;
    default:
        return false;
    }
}
