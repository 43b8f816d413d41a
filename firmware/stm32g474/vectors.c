/* The vector table: the vectors that are in use, and a handler that stops the motors for all others. */
#include "encoders.h"
#include "fault.h"
#include "fdcan.h"
#include "supply.h"
#include "usart_link.h"
#include "vector_table.h"

/* clang-format off */
__attribute__((section(".vectors"), used)) static const struct vector_table vector_table = {
    .stack_top = {.stack = __stack_top},
    .system = SYSTEM_VECTORS,
    .interrupt = {
        [0 ... IRQ_PVD - 1] = unexpected_interrupt,
        [IRQ_PVD] = PVD_Handler,
        [IRQ_PVD + 1 ... IRQ_DMA1_CHANNEL2 - 1] = unexpected_interrupt,
        [IRQ_DMA1_CHANNEL2] = SerialStream_Handler,
        [IRQ_DMA1_CHANNEL2 + 1 ... IRQ_FDCAN1_IT0 - 1] = unexpected_interrupt,
        [IRQ_FDCAN1_IT0] = FDCAN1_IT0_Handler,
        [IRQ_FDCAN1_IT0 + 1 ... IRQ_TIM3 - 1] = unexpected_interrupt,
        [IRQ_TIM3] = TIM3_Handler,
        [IRQ_TIM4] = TIM4_Handler,
        [IRQ_TIM4 + 1 ... IRQ_USART2 - 1] = unexpected_interrupt,
        [IRQ_USART2] = Serial_Handler,
        [IRQ_USART2 + 1 ... INTERRUPTS - 1] = unexpected_interrupt,
    },
};
/* clang-format on */
