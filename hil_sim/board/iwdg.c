/* The independent watchdog on the 32 kHz internal oscillator, RM0090 section 21. */
#include "machine.h"

enum { KEY_RELOAD = 0xAAAA, KEY_UNLOCK = 0x5555, KEY_START = 0xCCCC };
#define UPDATE_PS (5 * (PS_PER_S / LSI_HZ)) /* a new prescaler or reload value crosses the clock domain */

static uint64_t timeout_ps(const struct iwdg *w)
{
    uint32_t shift = w->pr > 6 ? 6 : w->pr;
    return (uint64_t)(w->rlr + 1) * (4ULL << shift) * (PS_PER_S / LSI_HZ);
}

static void reload(struct board *b)
{
    if (b->iwdg.running) {
        event_at_ps(b, EVENT_IWDG, time_to_ps(b, b->moment) + timeout_ps(&b->iwdg));
    }
}

void iwdg_reset(struct board *b)
{
    b->iwdg = (struct iwdg){.rlr = 0xFFF};
    event_cancel(b, EVENT_IWDG);
}

static void write_key(struct board *b, uint32_t key)
{
    struct iwdg *w = &b->iwdg;
    w->unlocked = key == KEY_UNLOCK;
    if (key == KEY_START) {
        w->running = true;
        b->rcc.csr |= 2u; /* the watchdog switches its oscillator on by itself (RM0090 7.2.9) */
    }
    if (key == KEY_RELOAD || key == KEY_START) {
        reload(b);
    }
}

bool iwdg_access(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    struct iwdg *w = &b->iwdg;
    const uint64_t now_ps = time_to_ps(b, b->moment);
    switch (offset) {
    case 0x0:
        if (write) {
            write_key(b, *value & 0xFFFFu);
        }
        return true;
    case 0x4:
    case 0x8: {
        uint32_t *store = offset == 0x4 ? &w->pr : &w->rlr;
        if (!write) {
            *value = *store;
        } else if (w->unlocked) {
            *store = *value & (offset == 0x4 ? 7u : 0xFFFu);
            w->updating_until_ps = now_ps + UPDATE_PS;
        } else {
            warn_once(b, 0xF00000A0u, "IWDG written while locked: ignored");
        }
        return true;
    }
    case 0xC: /* SR: PVU and RVU */
        *value = now_ps < w->updating_until_ps ? 3u : 0;
        return true;
    default:
        return false;
    }
}
