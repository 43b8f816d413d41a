/* The independent watchdog: resets the chip when the program stops feeding it (hal_watchdog_feed). */
#ifndef WATCHDOG_H
#define WATCHDOG_H

/* Starts it, with its long period; nothing but a reset stops it again. */
void watchdog_start(void);

/* The short period: for as long as ticks come. Takes up to 0.6 ms. */
void watchdog_shorten(void);

/* What the CPU is stalled by: the erase of a sector of 16 KiB, or of a larger one. */
enum watchdog_period { WATCHDOG_SMALL_SECTOR, WATCHDOG_LARGE_SECTOR };

/* A period that outlasts it. The bridges must be off. */
void watchdog_lengthen(enum watchdog_period period);

#endif
