/* Runs the independent watchdog from its own 32 kHz oscillator.
 *
 * The datasheet (DocID022152) gives that oscillator 17 to 47 kHz (section 5.3.9) and the erase of a 16 KiB
 * sector up to 500 ms by words and 800 ms by bytes (5.3.12). Code in flash is stalled for that long, so the
 * shortest period must be longer: 1500 counts of 32 clocks are 1.02 s at 47 kHz, 1.5 s at 32 kHz, and 2.82 s
 * at 17 kHz. */
#include "watchdog.h"

#include "hal.h"
#include "registers.h"

enum { RELOAD = 1500 - 1 };

void watchdog_start(void)
{
    /* The settings take effect a few of its own clocks later; until then it runs with its reset values, at
     * least 348 ms, which start-up stays below. No wait is needed (RM0090 section 21.3). */
    IWDG->kr = IWDG_KEY_START;
    IWDG->kr = IWDG_KEY_ACCESS;
    IWDG->pr = IWDG_PR_DIV32;
    IWDG->rlr = RELOAD;
}

void hal_watchdog_feed(void)
{
    IWDG->kr = IWDG_KEY_RELOAD;
}
