/* The serial link's port: USART2, on the pins that the board's ST-LINK takes for its virtual COM port, and
 * channels 1 and 2 of DMA1 that serve it (streams 0 and 1 here). */
#ifndef USART_PORT_H
#define USART_PORT_H

#include <stdint.h>

#include "registers.h"

#define SERIAL            USART2
#define SERIAL_RX_STREAM  (&DMA1->stream[0])
#define SERIAL_TX_STREAM  (&DMA1->stream[1])
#define SERIAL_RX_ADDRESS ((uintptr_t)&USART2->rdr)
#define SERIAL_TX_ADDRESS ((uintptr_t)&USART2->tdr)
#define SERIAL_STREAM_CR  DMA_CR_MINC /* bytes */
#define IRQ_SERIAL        IRQ_USART2
#define IRQ_SERIAL_STREAM IRQ_DMA1_CHANNEL2

/* The request that each stream serves. */
static inline void usart_route(void)
{
    DMAMUX1_CR(0u) = DMAMUX_USART2_RX;
    DMAMUX1_CR(1u) = DMAMUX_USART2_TX;
}

static inline uint32_t usart_status(void)
{
    return USART2->isr;
}

/* Each flag goes by writing its bit to ICR. */
static inline void usart_clear_status(uint32_t status)
{
    USART2->icr = status & (USART_SR_FE | USART_SR_NE | USART_SR_ORE | USART_SR_IDLE);
}

static inline uint8_t usart_take_byte(uint32_t status)
{
    usart_clear_status(status);
    return (uint8_t)USART2->rdr;
}

static inline void usart_put_byte(uint8_t byte)
{
    USART2->tdr = byte;
}

/* A stream stays enabled at the end of its run, and takes new settings only while it is not. */
static inline void usart_end_run(void)
{
    DMA1->ifcr = DMA_IFCR_ALL(1u);
    DMA1->stream[1].cr = SERIAL_STREAM_CR;
}

#endif
