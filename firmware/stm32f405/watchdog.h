/* The independent watchdog: resets the chip when the program stops feeding it (hal_watchdog_feed). */
#ifndef WATCHDOG_H
#define WATCHDOG_H

/* Starts it, with its long period; nothing but a reset stops it again. */
void watchdog_start(void);

/* The short period: for as long as ticks come. Takes up to 0.6 ms. */
void watchdog_shorten(void);

/* The long period, for an erase of the flash, which stalls the CPU. The bridges must be off. */
void watchdog_lengthen(void);

#endif
