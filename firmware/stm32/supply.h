/* The chip's own supply: brakes while it sags, and whether a deeper sag would reset the chip in time. */
#ifndef SUPPLY_H
#define SUPPLY_H

#include <stdbool.h>

/* From here on a sag of the supply brakes both bridges. */
void supply_start(void);

/* The supply is low, or has been since supply_settle. */
bool supply_dipped(void);

/* From the tick, when the controller has seen what supply_dipped says: the bridges follow hal_drive again if
 * the supply has recovered. */
void supply_settle(void);

/* The option bytes hold the brown-out reset at its highest level, above what flash needs at this clock. */
bool supply_resets_in_time(void);

void PVD_Handler(void);

#endif
