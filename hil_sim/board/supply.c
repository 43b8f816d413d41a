/* The chip's supply as a voltage: power-on, power-down and brown-out resets, and the voltage detector (RM0090
 * section 5.2).
 *
 * Thresholds are the typical ones of the datasheet, table 19. Between a threshold's falling and rising edge
 * the state stays as it is. */
#include "machine.h"

/* Volts, falling and rising. */
struct threshold {
    double falls, rises;
};
static const struct threshold power_down = {1.68, 1.72};
/* By FLASH_OPTCR.BOR_LEV (RM0090 section 3.9.10): 0 is the highest, 3 is off. */
static const struct threshold brown_out[] = {{2.83, 2.92}, {2.50, 2.59}, {2.19, 2.29}, {1.68, 1.72}};
/* By PWR_CR.PLS. */
static const struct threshold detector[] = {{2.04, 2.14}, {2.19, 2.30}, {2.35, 2.45}, {2.51, 2.60},
                                            {2.66, 2.76}, {2.84, 2.93}, {2.93, 3.03}, {3.03, 3.14}};
/* SRAM keeps its content above; the datasheet gives no figure. */
static const double sram_keeps_v = 1.2;

enum { PVDE = 1 << 4, PVDO = 1 << 2, VOSRDY = 1 << 14, LINE_PVD = 1 << 16 };

/* The detector's output is the signal of EXTI line 16: high while the supply is below. */
static void update_detector(struct board *b)
{
    const struct threshold *t = &detector[b->pwr_cr >> 5 & 7u];
    const bool was_low = b->supply_low;
    const bool on = b->powered && (b->pwr_cr & PVDE) != 0;
    b->supply_low = on && b->supply_v < (was_low ? t->rises : t->falls);
    if (b->supply_low != was_low) {
        exti_edge(b, LINE_PVD, b->supply_low);
    }
}

/* The reset that the supply holds: nothing runs, no pin is driven. */
static void hold(struct board *b)
{
    b->held = true;
    board_hold(b);
}

void supply_follow(struct board *b)
{
    const struct threshold *t = &brown_out[b->option_bytes >> 2 & 3u];
    const double volts = b->supply_v;
    b->sram_lost = b->sram_lost || volts < sram_keeps_v;
    b->powered_down = b->powered_down || volts < power_down.falls;
    if (b->powered && volts < t->falls) {
        hold(b);
    } else if (b->held && volts > t->rises) {
        b->held = false;
        board_release(b, b->sram_lost, b->powered_down);
        b->sram_lost = b->powered_down = false;
    }
    update_detector(b);
}

void board_set_supply(struct board *board, double volts)
{
    board->supply_v = volts;
    supply_follow(board);
}

void board_set_option_bytes(struct board *board, uint32_t option_bytes)
{
    board->option_bytes = option_bytes & ~3u;
}

uint32_t board_option_bytes(const struct board *board)
{
    return board->option_bytes;
}

bool pwr_access(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    if (offset == 0x0) {
        b->pwr_cr = write ? *value & 0x43F3u : b->pwr_cr;
        update_detector(b);
        *value = b->pwr_cr;
        return true;
    }
    if (offset == 0x4) { /* CSR; the regulator follows at once */
        *value = VOSRDY | (b->supply_low ? PVDO : 0);
        return true;
    }
    return false;
}
