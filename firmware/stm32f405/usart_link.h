/* The serial link to the host on USART3: rings between the interrupt and hal_link_*. */
#ifndef USART_LINK_H
#define USART_LINK_H

#include <stdbool.h>
#include <stdint.h>

#define LINK_BAUD 921600u

/* What went wrong on the line since start. */
struct usart_link_errors {
    uint32_t overruns;      /* the port was not read in time */
    uint32_t ring_overflow; /* bytes dropped since the ring was full */
    uint32_t framing;       /* bytes dropped for a missing stop bit */
    uint32_t noise;         /* bytes kept though the samples disagreed */
};

extern volatile struct usart_link_errors usart_link_errors;

void usart_link_start(uint32_t bus_hz);

/* True once for each time that the main loop should read: a frame has ended, or much is waiting. */
bool usart_link_take_call(void);

/* Sends what the port will take now; called by the tick, as a second way besides the interrupt. */
void usart_link_pump(void);

/* Vector. */
void USART3_Handler(void);

#endif
