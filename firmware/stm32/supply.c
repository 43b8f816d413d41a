/* The chip's own supply: brakes while it sags, and whether a deeper sag would reset the chip in time.
 *
 * The programmable voltage detector raises an interrupt when the supply falls through its level. It comes
 * before the brown-out reset at its highest level, after which the pins float; registers.h has the voltages.
 */
#include "supply.h"

#include "cortex.h"
#include "motors.h"
#include "registers.h"

#define LINE_PVD (1u << 16) /* rises as the supply falls: RM0090 section 5.2.3, RM0440 section 6.2.2 */

static volatile bool dipped;
static bool reported;

void supply_start(void)
{
    dipped = false;
    reported = false;
    PVD_CONTROL = (PVD_CONTROL & ~PVD_LEVEL(7u)) | PVD_LEVEL(PVD_HIGHEST_LEVEL) | PVD_ENABLE;
    EXTI->rtsr |= LINE_PVD;
    EXTI->pr = LINE_PVD;
    EXTI->imr |= LINE_PVD;
    NVIC_IPR(IRQ_PVD) = PRIORITY_SUPPLY;
    NVIC_ISER(0) = 1u << IRQ_PVD;
}

static bool is_low(void)
{
    return (PVD_STATUS & PVD_IS_LOW) != 0;
}

void PVD_Handler(void)
{
    motors_stop();
    dipped = true;
    EXTI->pr = LINE_PVD;
    cpu_finish_writes();
}

bool supply_dipped(void)
{
    reported = dipped;
    return dipped || is_low();
}

void supply_settle(void)
{
    if (reported && !is_low()) {
        dipped = false;
        motors_go();
    }
}

bool supply_resets_in_time(void)
{
    return (BOR_OPTIONS & BOR_LEVEL) == BOR_HIGHEST_LEVEL;
}
