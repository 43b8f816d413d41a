/* The data cache after an erase, RM0090 section 3.5.2: its lines keep what they held until they are written
 * to or the cache is emptied, by DCRST while it is off. Which of its 8 lines lie in the erased sector depends
 * on what was loaded last, which the board does not follow: the first 8 that were not blank are taken. While
 * the cache is on, the array shows the old bytes there, so that no load costs anything. */
#include "thumb.h"

#include <string.h>

enum { DCEN = 1 << 10, DCRST = 1 << 12 };

static void show(struct board *b, const struct flash_stale_line *line, bool cached)
{
    memcpy(b->flash_array + line->offset, cached ? line->cached : line->erased, FLASH_LINE);
    b->code.stale = b->code.stale || thumb_has_run(b, line->offset, FLASH_LINE);
}

static void show_all(struct board *b, bool cached)
{
    for (uint32_t i = 0; i < b->flash.stale_lines; i++) {
        show(b, &b->flash.stale_line[i], cached);
    }
}

/* Lines that overlap these bytes hold the array's content from now on: a store updates the cache as well. */
void flash_cache_settle(struct board *b, uint32_t first, uint32_t length)
{
    struct flash *f = &b->flash;
    uint32_t kept = 0;
    for (uint32_t i = 0; i < f->stale_lines; i++) {
        const struct flash_stale_line line = f->stale_line[i];
        if (line.offset < first + length && first < line.offset + FLASH_LINE) {
            show(b, &line, false);
        } else {
            f->stale_line[kept++] = line;
        }
    }
    f->stale_lines = kept;
}

void flash_cache_erased(struct board *b, uint32_t first, uint32_t length)
{
    struct flash *f = &b->flash;
    for (uint32_t at = first; at < first + length && f->cache_used && f->stale_lines < FLASH_STALE_LINES;
         at += FLASH_LINE) {
        if (memcmp(b->flash_before + at, b->flash_array + at, FLASH_LINE) != 0) {
            struct flash_stale_line *line = &f->stale_line[f->stale_lines++];
            line->offset = at;
            memcpy(line->cached, b->flash_before + at, FLASH_LINE);
            memcpy(line->erased, b->flash_array + at, FLASH_LINE);
        }
    }
    show_all(b, (f->acr & DCEN) != 0);
}

void flash_cache_control(struct board *b)
{
    struct flash *f = &b->flash;
    const bool on = (f->acr & DCEN) != 0;
    if ((f->acr & DCRST) != 0 && on) {
        warn_once(b, 0xF0000014u, "FLASH_ACR.DCRST while the data cache is on: ignored");
    } else if ((f->acr & DCRST) != 0) {
        flash_cache_settle(b, 0, FLASH_SIZE);
        f->cache_used = false;
    }
    f->cache_used = f->cache_used || on;
    show_all(b, on);
}

void flash_cache_unlocked(struct board *b)
{
    if (b->flash.stale_lines != 0) {
        warn_once(b, 0xF0000015u, "flash is changed again while the data cache still holds what was erased");
    }
}
