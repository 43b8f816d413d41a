/* Sleep of the main loop between interrupts. */
#ifndef IDLE_H
#define IDLE_H

#include "cortex.h"
#include "registers.h"

/* Sleep on exit (PM0214 section 2.5.1): a handler that returns to the main loop puts the CPU straight back
 * to sleep, so that a byte on the line costs its own interrupt and nothing else. A handler that has work for
 * the main loop calls idle_end; the tick always does, which bounds every wait to a millisecond. */

/* Called with interrupts off, right before the CPU sleeps. */
static inline void idle_begin(void)
{
    SCB_SCR = SCR_SLEEPONEXIT;
}

static inline void idle_end(void)
{
    SCB_SCR = 0;
}

#endif
