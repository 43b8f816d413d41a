/* The debug support unit, RM0090 section 38: the identity of the chip, and what stops while a debugger halts
 * the core. */
#include "machine.h"

enum { APB1_FZ = 1, APB2_FZ = 2 }; /* of the stored words, after CR */
enum { IWDG_STOP = 1 << 12, TIM1_STOP = 1 << 0, TIM8_STOP = 1 << 1 };

/* For timers with complementary outputs these are disabled meanwhile, as if MOE were reset (section 38.16.2).
 */
bool dbgmcu_freezes_tim(const struct board *b, int timer)
{
    const uint32_t bit = timer == 1 ? TIM1_STOP : TIM8_STOP;
    return b->halted && (timer == 1 || timer == 8) && (b->dbgmcu[APB2_FZ] & bit) != 0;
}

/* SysTick stops with the core in any case (ARMv7-M manual, section B3.3.1). */
void board_set_halted(struct board *board, bool halted)
{
    if (board->halted == halted) {
        return;
    }
    if (board->moment < board->now) {
        board->moment = board->now;
    }
    board->halted = halted;
    systick_freeze(board, halted);
    if (!halted || (board->dbgmcu[APB1_FZ] & IWDG_STOP) != 0) {
        iwdg_freeze(board, halted);
    }
    pins_update(board);
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
    const uint32_t known = offset == 0x8 ? IWDG_STOP : offset == 0xC ? TIM1_STOP | TIM8_STOP : ~0u;
    if (write && (*value & ~known) != 0) {
        warn_once(b, 0xF00000B0u, "DBGMCU: only IWDG, TIM1 and TIM8 stop while the core is halted");
    }
    *store = write ? *value : *store;
    *value = *store;
    return true;
}
