/* What the chip does while a debugger halts the core. */
#include "debugger.h"

#include <stdint.h>

#include "fault.h"
#include "registers.h"

/* While the counters of TIM1 and TIM8 are stopped for a debugger their outputs are disabled as if MOE were
 * reset (RM0090 section 38.16.2), which OSSI and the idle levels make a brake and a disabled driver. The
 * watchdog has to stop with it, or it would end each debugging session; tools that do not know this image may
 * have stopped it already. A chip without the unit has no debugger that could halt it. */
void debugger_brakes(void)
{
    uint32_t present;
    if (guarded_read(DBGMCU_APB1_FZ_ADDRESS, &present)) {
        DBGMCU_APB2_FZ |= DBGMCU_APB2_FZ_TIM1_STOP | DBGMCU_APB2_FZ_TIM8_STOP;
        DBGMCU_APB1_FZ |= DBGMCU_APB1_FZ_IWDG_STOP;
    }
}
