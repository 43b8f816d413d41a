/* The serial link's port: USART3, and the streams of DMA1 that serve it (RM0090 table 42). */
#ifndef USART_PORT_H
#define USART_PORT_H

#include <stdint.h>

#include "registers.h"

#define SERIAL            USART3
#define SERIAL_RX_STREAM  (&DMA1->stream[1])
#define SERIAL_TX_STREAM  (&DMA1->stream[3])
#define SERIAL_RX_ADDRESS ((uintptr_t)&USART3->dr)
#define SERIAL_TX_ADDRESS ((uintptr_t)&USART3->dr)
#define SERIAL_STREAM_CR  (DMA_CR_CHANNEL(4u) | DMA_CR_MINC) /* bytes, direct mode */
#define IRQ_SERIAL        IRQ_USART3
#define IRQ_SERIAL_STREAM IRQ_DMA1_STREAM3

/* Streams have fixed requests, of which DMA_CR_CHANNEL takes one. */
static inline void usart_route(void)
{
}

static inline uint32_t usart_status(void)
{
    return USART3->sr;
}

/* Reading DR after SR also clears the error flags of `status`. */
static inline uint8_t usart_take_byte(uint32_t status)
{
    (void)status;
    return (uint8_t)USART3->dr;
}

static inline void usart_put_byte(uint8_t byte)
{
    USART3->dr = byte;
}

/* With DMA: flags go by reading SR, then DR (RM0090 section 30.6.1). A byte that waits there is the stream's,
 * whose own read completes the sequence. */
static inline void usart_clear_status(uint32_t status)
{
    if ((status & USART_SR_RXNE) == 0) {
        (void)USART3->dr;
    }
}

/* A stream does not start with a flag left (RM0090 section 10.3.17). */
static inline void usart_end_run(void)
{
    DMA1->lifcr = DMA_LIFCR_STREAM3;
}

#endif
