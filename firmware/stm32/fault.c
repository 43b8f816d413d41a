/* Brakes the bridges and keeps the registers of a fault in memory that survives the reset. */
#include "fault.h"

#include <stddef.h>

#include "cortex.h"
#include "hal.h"
#include "motors.h"
#include "registers.h"

/* Eight words that exception entry stacks, PM0214 section 2.3.7. */
struct exception_frame {
    uint32_t r0, r1, r2, r3, r12, lr, pc, xpsr;
};

__attribute__((section(".noinit"), used)) struct fault_record last_fault;

void faults_enable(void)
{
    SCB_SHCSR |= SHCSR_MEMFAULTENA | SHCSR_BUSFAULTENA | SHCSR_USGFAULTENA;
}

bool fault_take_notice(void)
{
    const bool is_new = last_fault.magic == FAULT_MAGIC && last_fault.is_new != 0;
    last_fault.is_new = 0;
    return is_new;
}

bool hal_fault_record(struct hal_fault_record *out)
{
    if (last_fault.magic != FAULT_MAGIC) {
        return false;
    }
    *out = (struct hal_fault_record){
        .count = last_fault.count,
        .exception = last_fault.exception,
        .has_frame = last_fault.has_frame,
        .r0 = last_fault.r0,
        .r1 = last_fault.r1,
        .r2 = last_fault.r2,
        .r3 = last_fault.r3,
        .r12 = last_fault.r12,
        .lr = last_fault.lr,
        .pc = last_fault.pc,
        .xpsr = last_fault.xpsr,
        .cfsr = last_fault.cfsr,
        .hfsr = last_fault.hfsr,
        .mmfar = last_fault.mmfar,
        .bfar = last_fault.bfar,
    };
    return true;
}

/* Called from fault_entry.S with the stacked registers, or NULL when the stack itself is lost. */
_Noreturn void record_fault(const struct exception_frame *frame)
{
    motors_stop();
    if (last_fault.magic != FAULT_MAGIC) {
        last_fault.count = 0;
    }
    last_fault.magic = 0;
    last_fault.count++;
    last_fault.exception = cpu_active_exception();
    last_fault.has_frame = frame != NULL;
    if (frame != NULL) {
        last_fault.r0 = frame->r0;
        last_fault.r1 = frame->r1;
        last_fault.r2 = frame->r2;
        last_fault.r3 = frame->r3;
        last_fault.r12 = frame->r12;
        last_fault.lr = frame->lr;
        last_fault.pc = frame->pc;
        last_fault.xpsr = frame->xpsr;
    }
    last_fault.cfsr = SCB_CFSR;
    last_fault.hfsr = SCB_HFSR;
    last_fault.mmfar = SCB_MMFAR;
    last_fault.bfar = SCB_BFAR;
    last_fault.is_new = 1;
    compiler_barrier();
    last_fault.magic = FAULT_MAGIC;
    cpu_barrier();
    SCB_AIRCR = AIRCR_VECTKEY | AIRCR_SYSRESETREQ;
    cpu_barrier();
    for (;;) {
    }
}
