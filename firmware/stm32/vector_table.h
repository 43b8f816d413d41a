/* The form of a vector table, and what all chips have in it. */
#ifndef VECTOR_TABLE_H
#define VECTOR_TABLE_H

#include <stdint.h>

#include "fault.h"
#include "registers.h"
#include "startup.h"

union vector {
    uint32_t *stack;
    void (*handler)(void);
};

struct vector_table {
    union vector stack_top;
    void (*system[EXCEPTION_SYSTICK])(void); /* exceptions 1 to 15 */
    void (*interrupt[INTERRUPTS])(void);
};

extern uint32_t __stack_top[];

void SysTick_Handler(void);

/* clang-format off */
#define SYSTEM_VECTORS {                                                                                     \
        Reset_Handler,        /*  1 */                                                                       \
        NMI_Handler,          /*  2: clock security system */                                                \
        fault_entry,          /*  3: HardFault */                                                            \
        fault_entry,          /*  4: MemManage */                                                            \
        fault_entry,          /*  5: BusFault */                                                             \
        fault_entry,          /*  6: UsageFault */                                                           \
        unexpected_interrupt, /*  7: reserved */                                                             \
        unexpected_interrupt, /*  8: reserved */                                                             \
        unexpected_interrupt, /*  9: reserved */                                                             \
        unexpected_interrupt, /* 10: reserved */                                                             \
        unexpected_interrupt, /* 11: SVCall */                                                               \
        unexpected_interrupt, /* 12: debug monitor */                                                        \
        unexpected_interrupt, /* 13: reserved */                                                             \
        unexpected_interrupt, /* 14: PendSV */                                                               \
        SysTick_Handler,      /* 15 */                                                                       \
    }
/* clang-format on */

#endif
