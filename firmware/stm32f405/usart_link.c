/* Moves bytes between USART3 and two rings, by interrupt; the tick feeds the transmitter as well.
 *
 * Each ring has one writer and one reader: the interrupt and the main loop. Indices run freely and are masked
 * on access, so that full and empty differ. The transmit ring has a second reader, the tick, which masks the
 * interrupt for the few instructions that it takes. */
#include "usart_link.h"

#include <string.h>

#include "cortex.h"
#include "hal.h"
#include "idle.h"
#include "pins.h"
#include "registers.h"

/* Powers of two. The largest frame is 1041 bytes on the wire: three of them fit either way. */
enum { RX_SIZE = 4096, TX_SIZE = 4096, PIN_FUNCTION_USART3 = 7 };

/* The main loop is called for a whole frame, not for each byte: waking would cost more than reading. Bytes
 * without a frame end (noise, a frame under way) are fetched by the poll that follows each tick. */
enum { FRAME_END = 0, RX_CALL = RX_SIZE / 2 };

/* The real port takes two bytes at most; this bounds the tick where a port is always ready. */
enum { PUMP_LIMIT = 16 };

#define CR1_IDLE (USART_CR1_UE | USART_CR1_TE | USART_CR1_RE | USART_CR1_RXNEIE)

volatile struct usart_link_errors usart_link_errors;

static uint8_t rx_ring[RX_SIZE];
static uint8_t tx_ring[TX_SIZE];
static volatile bool rx_call;     /* set by the interrupt, taken by the main loop */
static volatile uint32_t rx_head; /* written by the interrupt */
static volatile uint32_t rx_tail; /* written by the main loop */
static uint32_t rx_peeked;        /* the tick's own */
static volatile uint32_t tx_head; /* written by the main loop */
static volatile uint32_t tx_tail; /* written by the interrupt or the tick */

void usart_link_start(uint32_t bus_hz)
{
    pin_to_peripheral(GPIOB, 10, PIN_FUNCTION_USART3, PULL_UP);
    pin_to_peripheral(GPIOB, 11, PIN_FUNCTION_USART3, PULL_UP); /* an open line idles */
    USART3->cr1 = 0;
    USART3->cr2 = 0; /* one stop bit */
    USART3->cr3 = 0;
    USART3->brr = (bus_hz + LINK_BAUD / 2u) / LINK_BAUD; /* sixteenfold oversampling, RM0090 section 30.3.4 */
    USART3->cr1 = CR1_IDLE;
    NVIC_IPR(IRQ_USART3) = PRIORITY_USART3;
    NVIC_ISER(IRQ_USART3 / 32u) = 1u << (IRQ_USART3 % 32u);
}

static void receive(uint32_t status)
{
    const uint8_t byte = (uint8_t)USART3->dr; /* also clears the error flags of `status` */
    if ((status & USART_SR_ORE) != 0) {
        usart_link_errors.overruns++;
    }
    if ((status & USART_SR_RXNE) == 0) {
        return;
    }
    if ((status & USART_SR_FE) != 0) {
        usart_link_errors.framing++;
        return;
    }
    if ((status & USART_SR_NE) != 0) {
        usart_link_errors.noise++;
    }
    const uint32_t head = rx_head;
    if (head - rx_tail == RX_SIZE) {
        usart_link_errors.ring_overflow++;
        return;
    }
    rx_ring[head % RX_SIZE] = byte;
    compiler_barrier();
    rx_head = head + 1u;
    if (byte == FRAME_END || head - rx_tail >= RX_CALL) {
        rx_call = true;
        idle_end();
    }
}

/* Sends up to `limit` bytes while the port takes them. The caller excludes the other feeder. */
static void transmit(uint32_t limit)
{
    uint32_t tail = tx_tail;
    while (limit-- > 0 && tail != tx_head && (USART3->sr & USART_SR_TXE) != 0) {
        USART3->dr = tx_ring[tail % TX_SIZE];
        tail++;
    }
    tx_tail = tail;
    if (tail == tx_head) {
        USART3->cr1 = CR1_IDLE;
    }
}

void USART3_Handler(void)
{
    const uint32_t status = USART3->sr;
    if ((status & (USART_SR_RXNE | USART_SR_ORE)) != 0) {
        receive(status);
    }
    if ((status & USART_SR_TXE) != 0 && (USART3->cr1 & USART_CR1_TXEIE) != 0) {
        transmit(1);
    }
}

void usart_link_pump(void)
{
    if (tx_tail == tx_head) {
        return;
    }
    cpu_interrupts_off();
    transmit(PUMP_LIMIT);
    cpu_interrupts_on();
}

bool usart_link_take_call(void)
{
    const bool call = rx_call;
    rx_call = false;
    return call;
}

size_t hal_link_read(uint8_t *out, size_t capacity)
{
    uint32_t tail = rx_tail;
    const uint32_t waiting = rx_head - tail;
    if (waiting > RX_SIZE) { /* its indices have been overwritten: old requests must not come round again */
        usart_link_errors.ring_overflow++;
        rx_tail = tail + waiting;
        return 0;
    }
    const size_t count = waiting < capacity ? waiting : capacity;
    compiler_barrier();
    for (size_t i = 0; i < count; i++) {
        out[i] = rx_ring[tail % RX_SIZE];
        tail++;
    }
    compiler_barrier();
    rx_tail = tail;
    return count;
}

/* For the tick alone, which the receiving interrupt preempts. Bytes that it missed are gone for it, and a
 * frame they were part of is none. */
size_t hal_link_peek(uint8_t *out, size_t capacity)
{
    const uint32_t head = rx_head;
    if (head - rx_peeked > RX_SIZE) {
        rx_peeked = head;
    }
    const uint32_t at = rx_peeked % RX_SIZE;
    const size_t waiting = head - rx_peeked;
    const size_t together = waiting < RX_SIZE - at ? waiting : RX_SIZE - at;
    const size_t count = together < capacity ? together : capacity;
    memcpy(out, rx_ring + at, count);
    rx_peeked += (uint32_t)count;
    return count;
}

size_t hal_link_write(const uint8_t *data, size_t length)
{
    const size_t room = TX_SIZE - (tx_head - tx_tail);
    const size_t count = length < room ? length : room;
    uint32_t head = tx_head;
    for (size_t i = 0; i < count; i++) {
        tx_ring[head % TX_SIZE] = data[i];
        head++;
    }
    compiler_barrier();
    tx_head = head;
    if (count > 0) {
        /* After the head: an interrupt in between may have found the ring empty and switched itself off. */
        USART3->cr1 = CR1_IDLE | USART_CR1_TXEIE;
    }
    return count;
}
