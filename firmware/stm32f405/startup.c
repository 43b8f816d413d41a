/* From reset to main: FPU on, vectors in flash, memory filled as C expects it. */
#include "startup.h"

#include "cortex.h"
#include "fault.h"
#include "registers.h"

extern uint32_t __vectors[], __stack_limit[], __stack_paint_end[], __stack_top[];
extern uint32_t __data_start[], __data_end[], __bss_start[], __bss_end[];
extern const uint32_t __data_load[];

int main(void);

/* What an untouched word of the stack holds: a debugger sees how deep the stack has ever been. */
#define STACK_PAINT 0xC5C5C5C5u

/* Apart from Reset_Handler, so that nothing the compiler does with FPU registers comes before the FPU. */
static _Noreturn __attribute__((noinline)) void start_program(void)
{
    for (uint32_t *word = __stack_limit; word < __stack_paint_end; word++) {
        *(volatile uint32_t *)word = STACK_PAINT;
    }
    const uint32_t *from = __data_load;
    for (uint32_t *to = __data_start; to < __data_end; to++) {
        *to = *from++;
    }
    for (uint32_t *to = __bss_start; to < __bss_end; to++) {
        *to = 0;
    }
    faults_enable();
    (void)main();
    for (;;) { /* main does not return */
    }
}

_Noreturn void Reset_Handler(void)
{
    /* The ROM loader's Go command arrives here too, with its own vectors and timer settings. */
    cpu_interrupts_off();
    SYSTICK->ctrl = 0;
    SCB_VTOR = (uint32_t)(uintptr_t)__vectors;
    SCB_CPACR |= CPACR_FPU_FULL;
    cpu_barrier();
    start_program();
}
