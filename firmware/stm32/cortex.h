/* The few Cortex-M4 instructions that C has no name for (PM0214 section 3.11), and interrupt priorities. */
#ifndef CORTEX_H
#define CORTEX_H

#include <stdint.h>

/* The chip keeps the upper four bits of a priority byte; a smaller number preempts a larger one.
 *
 * The serial port's interrupts (an idle line, a run that has left) are short and stand above the control
 * tick, so that a tick leaves no gap on the line. Where there is no DMA they come for each byte, which the
 * next one overruns 10.8 us later at 921600 baud. Edges of the encoders stand above both: they are dated when
 * their interrupt begins, and take half a microsecond, twice a tick at most. Faults preempt all. */
#define PRIORITY_SUPPLY 0x10u
#define PRIORITY_EDGE   0x20u
#define PRIORITY_SERIAL 0x40u
#define PRIORITY_TICK   0x80u
/* CAN stands beside the tick, so that neither interrupts the other and they may share what they like: its
 * receiver keeps three frames, 141 us of the densest traffic at 1 Mbit/s. */
#define PRIORITY_CAN PRIORITY_TICK

static inline void cpu_interrupts_off(void)
{
    __asm volatile("cpsid i" ::: "memory");
}

static inline void cpu_interrupts_on(void)
{
    __asm volatile("cpsie i" ::: "memory");
}

/* Sleeps until an interrupt is pending, also while interrupts are off (PM0214 section 2.5.2). */
static inline void cpu_wait_for_interrupt(void)
{
    __asm volatile("dsb\n\twfi" ::: "memory");
}

static inline void cpu_barrier(void)
{
    __asm volatile("dsb\n\tisb" ::: "memory");
}

/* For the end of a handler that clears its flag in a peripheral: the write is buffered, and the processor
 * would enter the handler again if it returned before the flag has fallen (Arm, Application Note 321,
 * section 4.9). */
static inline void cpu_finish_writes(void)
{
    __asm volatile("dsb" ::: "memory");
}

/* Keeps the compiler from moving memory accesses across; a single CPU needs no more than that. */
static inline void compiler_barrier(void)
{
    __asm volatile("" ::: "memory");
}

static inline uint32_t cpu_basepri(void)
{
    uint32_t value;
    __asm volatile("mrs %0, basepri" : "=r"(value));
    return value;
}

static inline void cpu_set_basepri(uint32_t value)
{
    __asm volatile("msr basepri, %0\n\tisb" ::"r"(value) : "memory");
}

static inline uint32_t cpu_active_exception(void)
{
    uint32_t value;
    __asm volatile("mrs %0, ipsr" : "=r"(value));
    return value & 0x1FFu;
}

#endif
