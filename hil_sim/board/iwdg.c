/* The independent watchdog on the 32 kHz internal oscillator, RM0090 section 21. */
#include "machine.h"

enum { KEY_RELOAD = 0xAAAA, KEY_UNLOCK = 0x5555, KEY_START = 0xCCCC, UPDATE_PERIODS = 5 };

static uint64_t period_ps(const struct board *b)
{
    return PS_PER_S / b->lsi_hz;
}

static uint64_t count_ps(const struct board *b)
{
    const uint32_t pr = b->iwdg.pr_active;
    return (4ULL << (pr > 6 ? 6 : pr)) * period_ps(b);
}

/* The next thing to happen: new settings arrive, or the count ends. */
static void schedule(struct board *b)
{
    const struct iwdg *w = &b->iwdg;
    if (w->running) {
        const bool update_first = w->updating && w->updating_until_ps < w->deadline_ps;
        event_at_ps(b, EVENT_IWDG, update_first ? w->updating_until_ps : w->deadline_ps);
    }
}

/* Settings that have crossed into the oscillator's clock: the counter runs on at the new rate, and the next
 * reload takes the new value. */
static void take_over(struct board *b, uint64_t now_ps)
{
    struct iwdg *w = &b->iwdg;
    if (!w->updating || now_ps < w->updating_until_ps) {
        return;
    }
    const uint64_t left = w->deadline_ps > w->updating_until_ps ? w->deadline_ps - w->updating_until_ps : 0;
    const uint64_t counts = left / count_ps(b);
    w->updating = false;
    w->pr_active = w->pr;
    w->rlr_active = w->rlr;
    w->deadline_ps = w->updating_until_ps + counts * count_ps(b);
    schedule(b);
}

static void reload(struct board *b, uint64_t now_ps)
{
    struct iwdg *w = &b->iwdg;
    if (w->running) {
        w->deadline_ps = now_ps + (uint64_t)(w->rlr_active + 1) * count_ps(b);
        schedule(b);
    }
}

/* A debugger holds the counter. */
void iwdg_freeze(struct board *b, bool frozen)
{
    struct iwdg *w = &b->iwdg;
    const uint64_t now_ps = time_to_ps(b, b->moment);
    if (frozen) {
        w->frozen_ps = now_ps;
        event_cancel(b, EVENT_IWDG);
    } else if (w->frozen_ps != 0) {
        w->deadline_ps += now_ps - w->frozen_ps;
        w->frozen_ps = 0;
        schedule(b);
    }
}

void iwdg_event(struct board *b)
{
    const uint64_t now_ps = time_to_ps(b, b->moment);
    if (b->iwdg.updating && b->iwdg.updating_until_ps < b->iwdg.deadline_ps) {
        take_over(b, b->iwdg.updating_until_ps > now_ps ? b->iwdg.updating_until_ps : now_ps);
        return;
    }
    b->reset_wanted = true;
    b->reset_cause = BOARD_RESET_WATCHDOG;
    cpu_update_break(b);
}

void iwdg_reset(struct board *b)
{
    b->iwdg = (struct iwdg){.rlr = 0xFFF, .rlr_active = 0xFFF};
    event_cancel(b, EVENT_IWDG);
}

void board_set_lsi_hz(struct board *board, uint32_t hz)
{
    board->lsi_hz = hz;
}

static void write_key(struct board *b, uint32_t key, uint64_t now_ps)
{
    struct iwdg *w = &b->iwdg;
    w->unlocked = key == KEY_UNLOCK;
    if (key == KEY_START) {
        w->running = true;
        b->rcc.csr |= 2u; /* the watchdog switches its oscillator on by itself (RM0090 7.2.9) */
    }
    if (key == KEY_RELOAD || key == KEY_START) {
        reload(b, now_ps);
    }
}

/* PR or RLR. One that is written while the one before is under way is lost (RM0090 21.4.2 and 21.4.3). */
static void write_setting(struct board *b, uint32_t *store, uint32_t *flag, uint32_t value, uint64_t now_ps)
{
    struct iwdg *w = &b->iwdg;
    if (!w->unlocked) {
        warn_once(b, 0xF00000A0u, "IWDG written while locked: ignored");
    } else if (w->updating && *flag != 0) {
        warn_once(b, 0xF00000A1u, "IWDG written while an update is under way: ignored");
    } else {
        w->pvu = w->updating ? w->pvu : 0;
        w->rvu = w->updating ? w->rvu : 0;
        *store = value;
        *flag = 1;
        w->updating = true;
        w->updating_until_ps = now_ps + UPDATE_PERIODS * period_ps(b);
        schedule(b);
    }
}

bool iwdg_access(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    struct iwdg *w = &b->iwdg;
    const uint64_t now_ps = time_to_ps(b, b->moment);
    take_over(b, now_ps);
    if (!w->updating) {
        w->pvu = w->rvu = 0;
    }
    switch (offset) {
    case 0x0:
        if (write) {
            write_key(b, *value & 0xFFFFu, now_ps);
        }
        return true;
    case 0x4:
        if (write) {
            write_setting(b, &w->pr, &w->pvu, *value & 7u, now_ps);
        } else {
            *value = w->pr;
        }
        return true;
    case 0x8:
        if (write) {
            write_setting(b, &w->rlr, &w->rvu, *value & 0xFFFu, now_ps);
        } else {
            *value = w->rlr;
        }
        return true;
    case 0xC: /* SR: PVU and RVU */
        *value = w->pvu | w->rvu << 1;
        return true;
    default:
        return false;
    }
}
