/* Runs the independent watchdog from its own 32 kHz oscillator.
 *
 * The datasheet (DocID022152) gives that oscillator 17 to 47 kHz (section 5.3.9). The control tick feeds it
 * every millisecond: 200 counts of 4 clocks are 17 ms at 47 kHz, 25 ms at 32 kHz, and 47 ms at 17 kHz, so
 * that a hung tick or a locked-up core lets go of the wheels within 50 ms.
 *
 * The erase of a 16 KiB sector takes up to 500 ms by words and 800 ms by bytes (5.3.12). Code in flash is
 * stalled for that long, so the period must be longer then: 1500 counts of 32 clocks are 1.02, 1.5 and 2.82
 * s. One of 64 or 128 KiB takes up to 2 s by words: 3300 counts are 2.25, 3.3 and 6.21 s.
 */
#include "watchdog.h"

#include <stdint.h>

#include "hal.h"
#include "registers.h"

enum { SHORT_COUNTS = 200, LONG_COUNTS = 1500, LONGEST_COUNTS = 3300 };

/* New settings cross into the oscillator's clock within five of its periods (RM0090 section 21.4.4), 0.3 ms
 * at 17 kHz; this many reads take longer. */
enum { UPDATE_READS = 20000 };

static void wait_for_update(void)
{
    for (uint32_t i = 0; i < UPDATE_READS && (IWDG->sr & (IWDG_SR_PVU | IWDG_SR_RVU)) != 0; i++) {
    }
}

/* A setting that is written while the one before is still under way is lost (RM0090 section 21.4.2). */
static void set_period(uint32_t prescaler, uint32_t counts)
{
    wait_for_update();
    IWDG->kr = IWDG_KEY_ACCESS;
    IWDG->pr = prescaler;
    IWDG->rlr = counts - 1u;
    wait_for_update();
    IWDG->kr = IWDG_KEY_RELOAD;
}

void watchdog_start(void)
{
    /* The settings take effect a few of its own clocks later; until then it runs with its reset values, at
     * least 348 ms, which start-up stays below. No wait is needed (RM0090 section 21.3). */
    IWDG->kr = IWDG_KEY_START;
    IWDG->kr = IWDG_KEY_ACCESS;
    IWDG->pr = IWDG_PR_DIV32;
    IWDG->rlr = LONG_COUNTS - 1;
}

void watchdog_shorten(void)
{
    set_period(IWDG_PR_DIV4, SHORT_COUNTS);
}

void watchdog_lengthen(enum watchdog_period period)
{
    set_period(IWDG_PR_DIV32, period == WATCHDOG_LARGE_SECTOR ? LONGEST_COUNTS : LONG_COUNTS);
}

void hal_watchdog_feed(void)
{
    IWDG->kr = IWDG_KEY_RELOAD;
}
