/* What happens when the program goes wrong: the bridges brake, the registers are kept, the chip resets. */
#ifndef FAULT_H
#define FAULT_H

#include <stdbool.h>
#include <stdint.h>

/* Registers at the last fault; survives the reset. Read it over SWD: `p last_fault`. */
struct fault_record {
    uint32_t magic;     /* FAULT_MAGIC when the rest has been written */
    uint32_t count;     /* faults since power-up */
    uint32_t exception; /* 2 NMI, 3 HardFault to 6 UsageFault, 16 + n interrupt n (PM0214 section 2.3.2) */
    uint32_t has_frame; /* 0: the stack had overflowed, the eight registers below mean nothing */
    uint32_t r0, r1, r2, r3, r12, lr, pc, xpsr;
    uint32_t cfsr, hfsr, mmfar, bfar; /* why, PM0214 section 4.4.10 and after */
    uint32_t is_new;                  /* not yet reported by a start */
};

#define FAULT_MAGIC 0xFA17EDu

extern struct fault_record last_fault;

/* True once after each fault: this start followed one. */
bool fault_take_notice(void);

/* Enables the faults that would otherwise escalate to HardFault. */
void faults_enable(void);

/* Reads a register that may not exist; false if the bus answers with an error. */
bool guarded_read(uint32_t address, uint32_t *out);

struct exception_frame;

/* Brakes, keeps the registers, resets. `frame`: those that exception entry has stacked, or NULL where they
 * are lost. */
_Noreturn void record_fault(const struct exception_frame *frame);

/* Vectors. NMI_Handler is the chip's: clock.c. */
void fault_entry(void);
void unexpected_interrupt(void);
void NMI_Handler(void);

#endif
