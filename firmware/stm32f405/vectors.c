/* The vector table: thirteen vectors are in use, all others lead to a handler that stops the motors. */
#include <stdint.h>

#include "bxcan.h"
#include "encoders.h"
#include "fault.h"
#include "registers.h"
#include "startup.h"
#include "supply.h"
#include "usart_link.h"

/* RM0090 table 61: the F405 has 82 interrupts. */
enum { INTERRUPTS = 82 };

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
__attribute__((section(".vectors"), used)) static const struct vector_table vector_table = {
    .stack_top = {.stack = __stack_top},
    .system = {
        Reset_Handler,        /*  1 */
        NMI_Handler,          /*  2: clock security system */
        fault_entry,          /*  3: HardFault */
        fault_entry,          /*  4: MemManage */
        fault_entry,          /*  5: BusFault */
        fault_entry,          /*  6: UsageFault */
        unexpected_interrupt, /*  7: reserved */
        unexpected_interrupt, /*  8: reserved */
        unexpected_interrupt, /*  9: reserved */
        unexpected_interrupt, /* 10: reserved */
        unexpected_interrupt, /* 11: SVCall */
        unexpected_interrupt, /* 12: debug monitor */
        unexpected_interrupt, /* 13: reserved */
        unexpected_interrupt, /* 14: PendSV */
        SysTick_Handler,      /* 15 */
    },
    .interrupt = {
        [0 ... IRQ_PVD - 1] = unexpected_interrupt,
        [IRQ_PVD] = PVD_Handler,
        [IRQ_PVD + 1 ... IRQ_DMA1_STREAM3 - 1] = unexpected_interrupt,
        [IRQ_DMA1_STREAM3] = DMA1_Stream3_Handler,
        [IRQ_DMA1_STREAM3 + 1 ... IRQ_CAN1_TX - 1] = unexpected_interrupt,
        [IRQ_CAN1_TX] = CAN1_TX_Handler,
        [IRQ_CAN1_RX0] = CAN1_RX0_Handler,
        [IRQ_CAN1_RX1] = unexpected_interrupt,
        [IRQ_CAN1_SCE] = CAN1_SCE_Handler,
        [IRQ_CAN1_SCE + 1 ... IRQ_TIM3 - 1] = unexpected_interrupt,
        [IRQ_TIM3] = TIM3_Handler,
        [IRQ_TIM4] = TIM4_Handler,
        [IRQ_TIM4 + 1 ... IRQ_USART3 - 1] = unexpected_interrupt,
        [IRQ_USART3] = USART3_Handler,
        [IRQ_USART3 + 1 ... INTERRUPTS - 1] = unexpected_interrupt,
    },
};
/* clang-format on */
