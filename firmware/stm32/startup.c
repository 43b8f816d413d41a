/* From reset to main: FPU on, vectors in flash, memory filled as C expects it. */
#include "startup.h"

#include "cortex.h"
#include "fault.h"
#include "registers.h"

/* Places of the linker script; only their addresses mean anything. */
extern uint32_t __vectors[], __stack_limit[], __stack_paint_end[];
extern uint32_t __data_start[], __data_end[], __bss_start[], __bss_end[];
extern const uint32_t __data_load[];

int main(void);

/* What an untouched word of the stack holds: shows a debugger the deepest stack so far. */
#define STACK_PAINT 0xC5C5C5C5u

/* Words between two places of the linker script. */
static uint32_t words_between(const uint32_t *from, const uint32_t *to)
{
    return (uint32_t)(((uintptr_t)to - (uintptr_t)from) / sizeof(uint32_t));
}

static void fill(volatile uint32_t *at, uint32_t words, uint32_t value)
{
    for (uint32_t i = 0; i < words; i++) {
        at[i] = value;
    }
}

/* Apart from Reset_Handler, so that the compiler uses no FPU register before the FPU is on. */
static _Noreturn __attribute__((noinline)) void start_program(void)
{
    fill(__stack_limit, words_between(__stack_limit, __stack_paint_end), STACK_PAINT);
    const uint32_t data_words = words_between(__data_start, __data_end);
    for (uint32_t i = 0; i < data_words; i++) {
        __data_start[i] = __data_load[i];
    }
    fill(__bss_start, words_between(__bss_start, __bss_end), 0);
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
