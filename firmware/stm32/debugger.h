/* What the chip does while a debugger halts the core. */
#ifndef DEBUGGER_H
#define DEBUGGER_H

/* From now on a halt brakes both bridges, and holds the watchdog. */
void debugger_brakes(void);

#endif
