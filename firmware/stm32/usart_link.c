/* Moves bytes between the serial port and two rings by DMA: reception goes round its ring for ever,
 * transmission leaves in runs. Where the DMA does not start (QEMU has none), each byte interrupts, and the
 * tick feeds the transmitter too.
 *
 * Each ring has one writer and one reader: the port and the main loop. Indices run freely and are masked on
 * access, so that full and empty differ. The tick reads the received bytes a second time. */
#include "usart_link.h"

#include <string.h>

#include "cortex.h"
#include "hal.h"
#include "idle.h"
#include "pins.h"
#include "registers.h"
#include "usart_port.h"

/* Powers of two. The largest frame is 1041 bytes on the wire: three of them fit either way. */
enum { RX_SIZE = 4096, TX_SIZE = 4096 };

/* Room in the ring comes back when a run has left: a quarter of the ring keeps the line busy and the writer
 * fed. */
enum { TX_RUN = TX_SIZE / 4 };

/* Without DMA the main loop is called for a whole frame, not for each byte: waking would cost more than
 * reading. Bytes without a frame end (noise, a frame under way) are fetched by the poll that follows each
 * tick. */
enum { FRAME_END = 0, RX_CALL = RX_SIZE / 2 };

/* The real port takes two bytes at most; this bounds the tick where a port is always ready. */
enum { PUMP_LIMIT = 16 };

#define CR1_ON    (USART_CR1_UE | USART_CR1_TE | USART_CR1_RE)
#define CR1_BYTES (CR1_ON | USART_CR1_RXNEIE) /* without DMA, and nothing to send */

volatile struct usart_link_errors usart_link_errors;

static uint8_t rx_ring[RX_SIZE];
static uint8_t tx_ring[TX_SIZE];
static bool by_dma;           /* constant after start */
static volatile bool rx_call; /* set by the interrupt, taken by the main loop */
static volatile uint32_t
    rx_head; /* written by the tick, from the stream's counter; without DMA by the interrupt */
static volatile uint32_t rx_tail;   /* written by the main loop */
static volatile uint32_t rx_peeked; /* written by the tick, or with the tick held off */
static volatile uint32_t tx_head;   /* written by the main loop */
static volatile uint32_t tx_tail;   /* written by the interrupt, without DMA by the tick as well */
static volatile uint32_t tx_run;    /* bytes that the stream sends now; while 0, the main loop may start it */

/* The fields of a stream may be written only while it is off (RM0090 section 10.3.17), as reset leaves it. */
static bool start_reception(void)
{
    struct dma_stream *const rx = SERIAL_RX_STREAM;
    rx->par = SERIAL_RX_ADDRESS;
    rx->m0ar = (uintptr_t)rx_ring;
    rx->ndtr = RX_SIZE;
    rx->cr = SERIAL_STREAM_CR | DMA_CR_CIRC;
    rx->cr = SERIAL_STREAM_CR | DMA_CR_CIRC | DMA_CR_EN;
    return (rx->cr & DMA_CR_EN) != 0;
}

/* What divides the bus clock down to the baud rate, with sixteenfold oversampling (RM0090 section 30.3.4): to
 * 921600, or to half of that and so on where no divider comes within 2 %. A receiver bears 3.3 % in all
 * (table 140), of which the RC oscillator and the host's adapter take their share. */
static uint32_t divider(uint32_t bus_hz)
{
    enum { SMALLEST = 16, PER_CENT = 100, ERROR_PER_CENT = 2 };
    uint32_t baud = LINK_BAUD;
    for (;;) {
        const uint32_t divisor = (bus_hz + baud / 2u) / baud;
        const uint32_t made = divisor * baud; /* of a bus at which it would be exact */
        const uint32_t off = made > bus_hz ? made - bus_hz : bus_hz - made;
        if ((divisor >= SMALLEST && off <= made / PER_CENT * ERROR_PER_CENT) || baud <= LINK_BAUD_MIN) {
            return divisor;
        }
        baud /= 2u;
    }
}

void usart_link_start(uint32_t bus_hz)
{
    pin_to_peripheral(BOARD_SERIAL_TX, FUNCTION_SERIAL, PULL_UP);
    pin_to_peripheral(BOARD_SERIAL_RX, FUNCTION_SERIAL, PULL_UP); /* an open line idles */
    SERIAL->cr1 = 0;
    SERIAL->cr2 = 0; /* one stop bit */
    SERIAL->brr = divider(bus_hz);
    usart_route();
    by_dma = start_reception();
    if (by_dma) {
        SERIAL_TX_STREAM->par = SERIAL_TX_ADDRESS;
        NVIC_IPR(IRQ_SERIAL_STREAM) = PRIORITY_SERIAL;
        NVIC_ISER(IRQ_SERIAL_STREAM / 32u) = 1u << (IRQ_SERIAL_STREAM % 32u);
    }
    SERIAL->cr3 = by_dma ? USART_CR3_DMAR | USART_CR3_DMAT : 0;
    SERIAL->cr1 = by_dma ? CR1_ON | USART_CR1_IDLEIE : CR1_BYTES;
    NVIC_IPR(IRQ_SERIAL) = PRIORITY_SERIAL;
    NVIC_ISER(IRQ_SERIAL / 32u) = 1u << (IRQ_SERIAL % 32u);
}

static void note_errors(uint32_t status)
{
    usart_link_errors.overruns += (status & USART_SR_ORE) != 0 ? 1u : 0u;
    usart_link_errors.framing += (status & USART_SR_FE) != 0 ? 1u : 0u;
    usart_link_errors.noise += (status & USART_SR_NE) != 0 ? 1u : 0u;
}

static void call_main_loop(void)
{
    rx_call = true;
    idle_end();
}

/* Without DMA: one byte. */
static void receive(uint32_t status)
{
    const uint8_t byte = usart_take_byte(status);
    note_errors(status);
    if ((status & USART_SR_RXNE) == 0 || (status & USART_SR_FE) != 0) {
        return;
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
        call_main_loop();
    }
}

/* Without DMA: sends up to `limit` bytes while the port takes them. The caller excludes the other feeder. */
static void transmit(uint32_t limit)
{
    uint32_t tail = tx_tail;
    while (limit-- > 0 && tail != tx_head && (usart_status() & USART_SR_TXE) != 0) {
        usart_put_byte(tx_ring[tail % TX_SIZE]);
        tail++;
    }
    tx_tail = tail;
    if (tail == tx_head) {
        SERIAL->cr1 = CR1_BYTES;
    }
}

/* With DMA. */
static void clear_status(uint32_t status)
{
    note_errors(status);
    usart_clear_status(status);
}

/* With DMA: the line has been idle for a byte's time; whole frames may wait. */
void Serial_Handler(void)
{
    const uint32_t status = usart_status();
    if (by_dma) {
        clear_status(status);
        call_main_loop();
        cpu_finish_writes();
        return;
    }
    if ((status & (USART_SR_RXNE | USART_SR_ORE)) != 0) {
        receive(status);
    }
    if ((status & USART_SR_TXE) != 0 && (SERIAL->cr1 & USART_CR1_TXEIE) != 0) {
        transmit(1);
    }
    cpu_finish_writes();
}

/* Gives the stream what waits, up to the end of the ring. For the owner of the stream: its interrupt, or the
 * main loop while no run is under way. */
static void start_run(void)
{
    struct dma_stream *const tx = SERIAL_TX_STREAM;
    const uint32_t at = tx_tail % TX_SIZE;
    uint32_t run = tx_head - tx_tail;
    run = run < TX_RUN ? run : TX_RUN;
    run = run < TX_SIZE - at ? run : TX_SIZE - at;
    tx_run = run;
    if (run > 0) {
        tx->m0ar = (uintptr_t)(tx_ring + at);
        tx->ndtr = run;
        cpu_barrier(); /* the ring's bytes are in memory before the stream reads them */
        tx->cr = SERIAL_STREAM_CR | DMA_CR_TO_PERIPHERAL | DMA_CR_TCIE | DMA_CR_EN;
    }
}

void SerialStream_Handler(void)
{
    usart_end_run();
    tx_tail = tx_tail + tx_run;
    start_run();
    cpu_finish_writes();
}

void usart_link_tick(void)
{
    if (by_dma) {
        const uint32_t status = usart_status();
        if ((status & (USART_SR_ORE | USART_SR_FE | USART_SR_NE)) != 0) {
            clear_status(status);
        }
    } else if (tx_tail != tx_head) {
        cpu_interrupts_off();
        transmit(PUMP_LIMIT);
        cpu_interrupts_on();
    } else {
        /* nothing to send */
    }
}

bool usart_link_take_call(void)
{
    const bool call = rx_call;
    rx_call = false;
    return call;
}

/* Bytes received since start. The stream counts within its ring only; since the tick follows it, no round of
 * 44 ms goes unnoticed. */
static uint32_t received(void)
{
    const uint32_t head = rx_head;
    if (!by_dma) {
        return head;
    }
    const uint32_t at = RX_SIZE - SERIAL_RX_STREAM->ndtr;
    return head + ((at - head) % RX_SIZE);
}

/* How many of the bytes from `index` to `head` lie in the ring without a turn in between. */
static uint32_t together(uint32_t index, uint32_t head)
{
    const uint32_t to_end = RX_SIZE - index % RX_SIZE;
    return head - index < to_end ? head - index : to_end;
}

/* What has been overwritten before it was read is discarded with all that waits: no byte is read twice. */
static bool overwritten(uint32_t tail, uint32_t head)
{
    if (head - tail <= RX_SIZE) {
        return false;
    }
    usart_link_errors.ring_overflow++;
    rx_tail = rx_peeked;
    return true;
}

size_t hal_link_read(uint8_t *out, size_t capacity)
{
    const uint32_t tail = rx_tail;
    const uint32_t head = rx_peeked;
    if (head == tail || overwritten(tail, received())) {
        return 0;
    }
    const size_t waiting = together(tail, head);
    const size_t count = waiting < capacity ? waiting : capacity;
    memcpy(out, rx_ring + tail % RX_SIZE, count);
    compiler_barrier();
    if (overwritten(tail, received())) { /* while it was copied */
        return 0;
    }
    rx_tail = tail + (uint32_t)count;
    return count;
}

/* What has not been looked at for a whole round is gone. */
size_t hal_link_peek(const uint8_t **bytes)
{
    const uint32_t head = received();
    if (by_dma) {
        rx_head = head;
    }
    if (head - rx_peeked > RX_SIZE) {
        rx_peeked = head;
    }
    const uint32_t count = together(rx_peeked, head);
    *bytes = rx_ring + rx_peeked % RX_SIZE;
    rx_peeked += count;
    return count;
}

bool usart_link_has_unheard(void)
{
    return received() != rx_peeked;
}

void usart_link_forget(void)
{
    rx_tail = received();
    rx_peeked = rx_tail;
}

size_t hal_link_write(const uint8_t *data, size_t length)
{
    const uint32_t head = tx_head;
    const size_t room = TX_SIZE - (head - tx_tail);
    const size_t count = length < room ? length : room;
    const size_t to_end = TX_SIZE - head % TX_SIZE;
    const size_t first = count < to_end ? count : to_end;
    memcpy(tx_ring + head % TX_SIZE, data, first);
    memcpy(tx_ring, data + first, count - first);
    compiler_barrier();
    tx_head = head + (uint32_t)count;
    if (by_dma) {
        if (tx_run == 0) { /* otherwise the end of the run goes on with these bytes */
            start_run();
        }
    } else if (count > 0) {
        /* After the head: an interrupt in between may have found the ring empty and switched itself off. */
        SERIAL->cr1 = CR1_BYTES | USART_CR1_TXEIE;
    } else {
        /* the ring is full: the transmitter is on */
    }
    return count;
}
