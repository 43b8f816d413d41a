/* The memory that the log lies in: a part of SRAM, and the core-coupled memory where there is any. */
#ifndef LOG_MEMORY_H
#define LOG_MEMORY_H

/* Tests the core-coupled memory; once, before the controller starts. */
void log_memory_start(void);

#endif
