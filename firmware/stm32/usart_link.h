/* The serial link to the host: rings between its DMA and hal_link_*. */
#ifndef USART_LINK_H
#define USART_LINK_H

#include <stdbool.h>
#include <stdint.h>

/* Where the clock does not divide to the first within 2 %, half of it, and so on. */
#define LINK_BAUD     921600u
#define LINK_BAUD_MIN 115200u

/* What went wrong on the line since start; with DMA the number of ticks that found it so, without it of
 * bytes. */
struct usart_link_errors {
    uint32_t overruns;      /* the port was not read in time */
    uint32_t ring_overflow; /* times that bytes were dropped since the ring was full */
    uint32_t framing;       /* a stop bit was missing */
    uint32_t noise;         /* the samples of a bit disagreed */
};

extern volatile struct usart_link_errors usart_link_errors;

void usart_link_start(uint32_t bus_hz);

/* True once for each time that the main loop should read: the line has gone idle after bytes, or, without
 * DMA, a frame has ended or much is waiting. */
bool usart_link_take_call(void);

/* Called by each tick: counts the line's errors; without DMA it sends what the port will take now, as a
 * second way besides the interrupt. */
void usart_link_tick(void);

/* Whether hal_link_peek would show bytes. */
bool usart_link_has_unheard(void);

/* Discards what has been received and not read. For the main loop, while no tick can come, after a time in
 * which none came: the ring may have gone round. */
void usart_link_forget(void);

/* Vectors. */
void Serial_Handler(void);
void SerialStream_Handler(void);

#endif
