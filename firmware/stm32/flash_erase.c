/* Erasing a sector beside a running controller: bridges off, a longer watchdog, missed ticks counted.
 *
 * Code is fetched from the same flash, so that the bus holds it up until the erase is over (RM0090 section
 * 3.6). What runs on is hardware: the bridges brake, encoders are counted. Requests of the host are lost. */
#include "flash_erase.h"

#include "cortex.h"
#include "flash_cells.h"
#include "hal.h"
#include "motors.h"
#include "registers.h"
#include "usart_link.h"

/* Cycles since the last tick that ran was due. */
static uint32_t cycles_since_tick(void)
{
    for (;;) {
        const uint32_t before = SYSTICK->val;
        const bool waits = (SCB_ICSR & ICSR_PENDSTSET) != 0;
        const uint32_t after = SYSTICK->val;
        if (after <= before) { /* it did not wrap in between */
            return SYSTICK->load - after + (waits ? SYSTICK->load + 1u : 0u);
        }
    }
}

/* Ticks that came due `since` cycles before `began` and are not going to run: a late one would end after the
 * next is due, and count as an overrun. The phase of the ticks stays, and so does device time. */
static uint32_t drop_ticks(uint32_t since, uint32_t began)
{
    uint32_t missed;
    do { /* again, when one came due between the two steps */
        SCB_ICSR = ICSR_PENDSTCLR;
        missed = (since + (DWT_CYCCNT - began)) / (SYSTICK->load + 1u);
    } while ((SCB_ICSR & ICSR_PENDSTSET) != 0);
    return missed;
}

bool flash_erase(uint32_t sector, enum watchdog_period period, uint32_t *missed_ticks)
{
    SCB_DEMCR |= DEMCR_TRCENA;
    DWT_CTRL |= DWT_CTRL_CYCCNTENA;
    motors_stop(); /* nothing watches over them until the erase is over */
    watchdog_lengthen(period);
    const uint32_t state = hal_critical_enter();
    const uint32_t since = cycles_since_tick();
    const uint32_t began = DWT_CYCCNT;
    const bool good = flash_erase_sector(sector);
    *missed_ticks = drop_ticks(since, began);
    usart_link_forget();
    hal_critical_exit(state);
    watchdog_shorten();
    motors_go();
    return good;
}
