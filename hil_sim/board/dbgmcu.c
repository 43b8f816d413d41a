/* The debug support unit, RM0090 section 38: the identity of the chip, and what stops while a debugger halts
 * the core. */
#include "machine.h"

enum { APB1_FZ = 1, APB2_FZ = 2 }; /* of the stored words, after CR */
enum { WWDG_STOP = 1 << 11, IWDG_STOP = 1 << 12 };

/* Bits of the timers, sections 38.16.4 and 38.16.5: bit + 1 in APB1_FZ, 33 + bit in APB2_FZ. */
static const uint8_t stop_bit[TIMERS + 1] = {
    [1] = 33, [2] = 1,  [3] = 2,   [4] = 3,   [5] = 4,  [6] = 5,  [7] = 6,
    [8] = 34, [9] = 49, [10] = 50, [11] = 51, [12] = 7, [13] = 8, [14] = 9};

static bool stops(const struct board *b, int timer)
{
    const uint32_t bit = stop_bit[timer];
    const uint32_t word = b->dbgmcu[bit > 32 ? APB2_FZ : APB1_FZ];
    return (word >> ((bit - 1) % 32) & 1u) != 0;
}

/* A frozen timer does not count. The outputs of those with complementary ones are disabled meanwhile, as if
 * MOE were reset (section 38.16.2). */
void dbgmcu_freeze_timers(struct board *b)
{
    for (int i = 1; i <= TIMERS; i++) {
        timer_sync(b, i);
        b->timer[i].frozen = b->halted && stops(b, i);
        timer_schedule(b, i);
    }
    pins_update(b);
}

/* SysTick and the cycle counter stop with the core in any case (ARMv7-M manual, sections B3.3.1 and C1.8.2).
 */
void board_set_halted(struct board *board, bool halted)
{
    if (board->halted == halted) {
        return;
    }
    if (board->moment < board->now) {
        board->moment = board->now;
    }
    if (halted) {
        systick_freeze(board, true); /* as it stands now */
    }
    board->halted = halted;
    if (!halted) {
        systick_freeze(board, false);
    }
    if (!halted || (board->dbgmcu[APB1_FZ] & IWDG_STOP) != 0) {
        iwdg_freeze(board, halted);
    }
    dbgmcu_freeze_timers(board);
    board->needs_check = true;
    cpu_update_break(board);
}

bool dbgmcu_access(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    if (offset == 0) {
        *value = b->idcode;
        return true;
    }
    uint32_t *store = &b->dbgmcu[offset / 4 - 1];
    /* Timers, and watchdogs of which there is one: the window watchdog is not modelled at all. */
    const uint32_t apb1 = 0x1FFu | WWDG_STOP | IWDG_STOP;
    const uint32_t apb2 = 0x70003u;
    const uint32_t known = offset == 0x8 ? apb1 : offset == 0xC ? apb2 : ~0u;
    if (write && (*value & ~known) != 0) {
        warn_once(b, 0xF00000B0u, "DBGMCU: only timers and IWDG stop while the core is halted");
    }
    *store = write ? *value : *store;
    *value = *store;
    return true;
}
