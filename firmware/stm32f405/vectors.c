/* The vector table: the vectors that are in use, and a handler that stops the motors for all others. */
#include "bxcan.h"
#include "encoders.h"
#include "fault.h"
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
        [IRQ_PVD + 1 ... IRQ_DMA1_STREAM3 - 1] = unexpected_interrupt,
        [IRQ_DMA1_STREAM3] = SerialStream_Handler,
        [IRQ_DMA1_STREAM3 + 1 ... IRQ_CAN1_TX - 1] = unexpected_interrupt,
        [IRQ_CAN1_TX] = CAN1_TX_Handler,
        [IRQ_CAN1_RX0] = CAN1_RX0_Handler,
        [IRQ_CAN1_RX1] = unexpected_interrupt,
        [IRQ_CAN1_SCE] = CAN1_SCE_Handler,
        [IRQ_CAN1_SCE + 1 ... IRQ_TIM3 - 1] = unexpected_interrupt,
        [IRQ_TIM3] = TIM3_Handler,
        [IRQ_TIM4] = TIM4_Handler,
        [IRQ_TIM4 + 1 ... IRQ_USART3 - 1] = unexpected_interrupt,
        [IRQ_USART3] = Serial_Handler,
        [IRQ_USART3 + 1 ... INTERRUPTS - 1] = unexpected_interrupt,
    },
};
/* clang-format on */
