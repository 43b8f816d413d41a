/* The independent watchdog: resets the chip when the program stops feeding it (hal_watchdog_feed). */
#ifndef WATCHDOG_H
#define WATCHDOG_H

/* Starts it; nothing but a reset stops it again. */
void watchdog_start(void);

#endif
