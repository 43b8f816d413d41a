/* The chip's own supply: brakes while it sags, and whether a deeper sag would reset the chip in time.
 *
 * The programmable voltage detector raises an interrupt when the supply falls through 2.93 V (level 6: 2.85
 * to 2.99 V, recovered at 2.96 to 3.10 V; datasheet table 19). It comes before the brown-out reset at its
 * highest level (2.75 to 2.88 V), after which the pins float, and before 2.7 V, where flash is too slow for
 * 168 MHz at 5 wait states (RM0090 table 10). Level 7 would reach up to 3.09 V, and recover at 3.21 V at the
 * latest: too near to a regulator's 3.3 V less 3 %. */
#include "supply.h"

#include "cortex.h"
#include "motors.h"
#include "registers.h"

enum { DETECTOR_LEVEL = 6 };
#define LINE_PVD (1u << 16) /* rises as the supply falls, RM0090 section 5.2.3 */

static volatile bool dipped;
static bool reported;

void supply_start(void)
{
    dipped = false;
    reported = false;
    RCC->apb1enr |= RCC_APB1ENR_PWR;
    (void)RCC->apb1enr;
    PWR_CR = (PWR_CR & ~PWR_CR_PLS(7u)) | PWR_CR_PLS((uint32_t)DETECTOR_LEVEL) | PWR_CR_PVDE;
    EXTI->rtsr |= LINE_PVD;
    EXTI->pr = LINE_PVD;
    EXTI->imr |= LINE_PVD;
    NVIC_IPR(IRQ_PVD) = PRIORITY_SUPPLY;
    NVIC_ISER(0) = 1u << IRQ_PVD;
}

static bool is_low(void)
{
    return (PWR_CSR & PWR_CSR_PVDO) != 0;
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
    return (FLASH_OPTCR & FLASH_OPTCR_BOR_LEV) == FLASH_OPTCR_BOR_LEVEL_3;
}
