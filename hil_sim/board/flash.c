/* The flash controller: unlock keys, sector erase and programming that stall the core, RM0090 section 3. */
#include "machine.h"

#include <string.h>

enum { EOP = 1 << 0, WRPERR = 1 << 4, PGAERR = 1 << 5, PGPERR = 1 << 6, PGSERR = 1 << 7, BSY = 1 << 16 };
enum { PG = 1 << 0, SER = 1 << 1, MER = 1 << 2, STRT = 1 << 16, EOPIE = 1 << 24, LOCK = 1u << 31 };
enum { IRQ_FLASH = 4, SECTORS = 12 };
/* Typical times at 2.7 to 3.6 V, STM32F405 datasheet table 40. */
#define PROGRAM_PS    (16 * PS_PER_US)
#define ERASE_16K_PS  (250000 * PS_PER_US)
#define ERASE_64K_PS  (550000 * PS_PER_US)
#define ERASE_128K_PS (1000000 * PS_PER_US)
#define ERASE_ALL_PS  (8000000 * PS_PER_US)

/* Four sectors of 16 KiB, one of 64, seven of 128 (RM0090 table 5). */
static uint32_t sector_start(uint32_t sector)
{
    return sector <= 4 ? sector * 0x4000u : (sector - 4) * 0x20000u;
}

static uint32_t sector_of(uint32_t offset)
{
    uint32_t sector = SECTORS - 1;
    while (sector_start(sector) > offset) {
        sector--;
    }
    return sector;
}

static uint32_t sector_size(uint32_t sector)
{
    return sector_start(sector + 1) - sector_start(sector);
}

void flash_reset(struct board *b)
{
    b->flash = (struct flash){.cr = LOCK, .optcr = 0x0FFFAAEDu};
    b->stall_until = 0;
    event_cancel(b, EVENT_FLASH);
}

/* Code is fetched from flash, so that the core waits until the operation is over; code in SRAM runs on. */
static void busy_for(struct board *b, uint64_t ps)
{
    uint64_t end = time_to_ps(b, b->moment) + ps;
    b->flash.sr |= BSY;
    event_at_ps(b, EVENT_FLASH, end);
    if (b->block_pc < SRAM_BASE) {
        b->stall_until = time_to_cycle(b, end);
        core_update_break(b);
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

static void erase(struct board *b, uint32_t first, uint32_t length, uint64_t ps)
{
    uint8_t *cells = b->flash_array + first;
    if (cut_now(b)) {
        /* Half erased: some cells are already blank, the others still hold their charge. */
        for (uint32_t i = 0; i < length; i++) {
            cells[i] |= (uint8_t)(0x55u << (i & 1u));
        }
        board_power(b, false);
    } else {
        memset(cells, 0xFF, length);
        busy_for(b, ps);
    }
    memcpy(b->flash_shadow + first, cells, length);
    blocks_forget(b, first, length);
    uc_ctl_remove_cache(b->uc, (uint64_t)FLASH_BASE + first, (uint64_t)FLASH_BASE + first + length);
    uc_ctl_remove_cache(b->uc, (uint64_t)first, (uint64_t)first + length);
}

static void start_erase(struct board *b)
{
    if ((b->flash.cr & MER) != 0) {
        erase(b, 0, FLASH_SIZE, ERASE_ALL_PS);
        return;
    }
    uint32_t sector = b->flash.cr >> 3 & 0xFu;
    if ((b->flash.cr & SER) == 0 || sector >= SECTORS) {
        b->flash.sr |= PGSERR;
        return;
    }
    uint32_t size = sector_size(sector);
    erase(b, sector_start(sector), size,
          size == 0x4000u ? ERASE_16K_PS : size == 0x10000u ? ERASE_64K_PS : ERASE_128K_PS);
}

/* A store into the array is under way. The engine cannot refuse it, so the array is opened for the rest of the
   block and afterwards compared with its shadow: what was not allowed is taken back, what was becomes programming. */
bool flash_store(struct board *b, uint32_t address)
{
    uint32_t offset = address >= FLASH_BASE ? address - FLASH_BASE : address;
    if (offset >= FLASH_SIZE) {
        return false;
    }
    b->flash.window_open = true;
    b->flash.window_sector = sector_of(offset);
    uc_mem_protect(b->uc, address >= FLASH_BASE ? FLASH_BASE : 0, FLASH_SIZE, UC_PROT_ALL);
    core_update_break(b);
    return true;
}

static uint32_t width(const struct board *b)
{
    return 1u << (b->flash.cr >> 8 & 3u);
}

/* Programming only clears bits. Bytes that a store left as they were cost no time. */
static void program(struct board *b, uint32_t at)
{
    uint32_t size = width(b);
    for (uint32_t i = at; i < at + size && i < FLASH_SIZE; i++) {
        b->flash_array[i] &= b->flash_shadow[i];
    }
    if (cut_now(b)) {
        for (uint32_t i = at; i < at + size; i++) {
            b->flash_array[i] |= (uint8_t)(b->flash_shadow[i] & 0x0Fu); /* half of the cells did not make it */
        }
        memcpy(b->flash_shadow + at, b->flash_array + at, size);
        board_power(b, false);
        return;
    }
    memcpy(b->flash_shadow + at, b->flash_array + at, size);
    busy_for(b, PROGRAM_PS);
}

void flash_close_window(struct board *b)
{
    b->flash.window_open = false;
    uc_mem_protect(b->uc, FLASH_BASE, FLASH_SIZE, UC_PROT_READ | UC_PROT_EXEC);
    uc_mem_protect(b->uc, 0, FLASH_SIZE, UC_PROT_READ | UC_PROT_EXEC);
    uint32_t first = sector_start(b->flash.window_sector);
    uint32_t end = first + sector_size(b->flash.window_sector);
    bool allowed = (b->flash.cr & (LOCK | PG)) == PG && (b->flash.sr & (WRPERR | PGAERR | PGPERR | PGSERR)) == 0;
    if (!allowed) {
        b->flash.sr |= PGSERR;
        note_oddity(b, 0xF0000010u, "store into flash without FLASH_CR.PG: ignored");
    }
    uint64_t total = 0;
    bool changed = false;
    for (uint32_t at = first; at < end && b->powered; at++) {
        if (b->flash_array[at] == b->flash_shadow[at]) {
            continue;
        }
        changed = true;
        if (allowed) {
            at -= at % width(b);
            program(b, at);
            at += width(b) - 1;
            total += PROGRAM_PS;
        } else {
            b->flash_array[at] = b->flash_shadow[at];
        }
    }
    if (total > PROGRAM_PS) {
        busy_for(b, total); /* several stores in one go queue up on the bus */
    }
    if (changed) {
        blocks_forget(b, first, end - first);
    }
    core_update_break(b);
}

static void write_cr(struct board *b, uint32_t value)
{
    struct flash *f = &b->flash;
    if ((f->cr & LOCK) != 0) {
        note_oddity(b, 0xF0000011u, "FLASH_CR written while locked: ignored");
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

bool flash_access(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    static const uint32_t keys[] = {0x45670123u, 0xCDEF89ABu};
    static const uint32_t option_keys[] = {0x08192A3Bu, 0x4C5D6E7Fu};
    struct flash *f = &b->flash;
    switch (offset) {
    case 0x00:
        if (write) {
            f->acr = *value & 0x1F07u;
        }
        *value = f->acr;
        return true;
    case 0x04: /* a wrong key locks the register until the next reset (RM0090 3.6.1) */
        if (write && f->key_step < 2) {
            f->key_step = *value == keys[f->key_step] ? (uint8_t)(f->key_step + 1) : 3;
            f->cr &= f->key_step == 2 ? ~(uint32_t)LOCK : ~0u;
        }
        return true;
    case 0x08:
        if (write && f->opt_key_step < 2) {
            f->opt_key_step = *value == option_keys[f->opt_key_step] ? (uint8_t)(f->opt_key_step + 1) : 3;
            f->optcr &= f->opt_key_step == 2 ? ~1u : ~0u;
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
    case 0x14: /* option bytes keep their factory content */
        *value = f->optcr;
        return !write;
    default:
        return false;
    }
}
