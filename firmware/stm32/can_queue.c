/* Frames between the CAN controller's interrupts and the main loop.
 *
 * Each queue has one writer and one reader, the interrupts and the main loop, as in usart_link.c. What is
 * received overwrites the oldest that the main loop has not read, so that the tick sees each frame, however
 * long the main loop takes. */
#include "can_queue.h"

#include <stddef.h>

#include "can_port.h"
#include "cortex.h"
#include "idle.h"

/* Powers of two. A host sends 8 frames before it waits for flow control; of the shortest frames, 47 bits, 21
 * arrive between two ticks at 1 Mbit/s. */
enum { RX_SIZE = 32, TX_SIZE = 32 };

struct hal_can_report can_counts;

static struct hal_can_frame rx_ring[RX_SIZE];
static struct hal_can_frame tx_ring[TX_SIZE];
static volatile uint32_t rx_head;   /* written by the interrupt */
static volatile uint32_t rx_tail;   /* written by the main loop */
static volatile uint32_t rx_peeked; /* written by the tick, or with the tick held off */
static volatile uint32_t tx_head;   /* written by the main loop */
static volatile uint32_t tx_tail;   /* written with CAN's interrupts held off, or by them */
static volatile bool call;

static void call_main_loop(void)
{
    call = true;
    idle_end();
}

void can_queue_received(uint32_t id, uint32_t length, uint32_t low, uint32_t high)
{
    const uint32_t head = rx_head;
    struct hal_can_frame *const frame = &rx_ring[head % RX_SIZE];
    frame->id = (uint16_t)id;
    frame->length = (uint8_t)(length < sizeof frame->data ? length : sizeof frame->data);
    for (uint32_t i = 0; i < 4; i++) {
        frame->data[i] = (uint8_t)(low >> (8u * i));
        frame->data[4u + i] = (uint8_t)(high >> (8u * i));
    }
    can_counts.received++;
    can_counts.overruns += head - rx_tail >= RX_SIZE ? 1u : 0u; /* this one took the place of the oldest */
    rx_head = head + 1u;
    call_main_loop();
}

const struct hal_can_frame *can_queue_next(void)
{
    const uint32_t tail = tx_tail;
    if (tail == tx_head) {
        return NULL;
    }
    tx_tail = tail + 1u;
    return &tx_ring[tail % TX_SIZE];
}

/* The main loop refills in halves: waking it for every frame would cost too much. */
void can_queue_sent(void)
{
    if (tx_head - tx_tail == TX_SIZE / 2u || tx_head == tx_tail) {
        call_main_loop();
    }
}

void can_queue_discard(void)
{
    can_counts.discarded += tx_head - tx_tail;
    tx_tail = tx_head;
}

void can_queue_counts(struct hal_can_report *out)
{
    const uint32_t before = cpu_basepri();
    cpu_set_basepri(PRIORITY_TICK);
    *out = can_counts;
    cpu_set_basepri(before);
}

uint8_t can_state_on_bus(bool joining, bool passive, bool warning)
{
    if (joining) {
        return HAL_CAN_JOINING;
    }
    if (passive) {
        return HAL_CAN_PASSIVE;
    }
    return warning ? HAL_CAN_WARNING : HAL_CAN_ACTIVE;
}

bool can_take_call(void)
{
    const bool called = call;
    call = false;
    return called;
}

/* The next frame for a reader that has seen those before `*at`; what has been overwritten is left out. */
static bool take_frame(uint32_t *at, struct hal_can_frame *out)
{
    const uint32_t head = rx_head;
    if (head == *at) {
        return false;
    }
    if (head - *at > RX_SIZE) {
        *at = head - RX_SIZE;
    }
    *out = rx_ring[*at % RX_SIZE];
    *at = *at + 1u;
    return true;
}

bool hal_can_read(struct hal_can_frame *out)
{
    uint32_t tail = rx_tail;
    if (tail == rx_peeked) {
        return false;
    }
    const uint32_t before = cpu_basepri();
    cpu_set_basepri(PRIORITY_CAN); /* nothing is overwritten while it is copied */
    const bool taken = take_frame(&tail, out);
    rx_tail = tail;
    cpu_set_basepri(before);
    return taken;
}

bool can_has_unheard(void)
{
    return rx_peeked != rx_head;
}

/* Its callers are of one priority with the receiving interrupt. */
bool hal_can_peek(struct hal_can_frame *out)
{
    uint32_t at = rx_peeked;
    const bool taken = take_frame(&at, out);
    rx_peeked = at;
    return taken;
}

size_t hal_can_writable(void)
{
    return can_joined() ? TX_SIZE - (tx_head - tx_tail) : 0;
}

void hal_can_write(const struct hal_can_frame *frame)
{
    if (hal_can_writable() == 0) {
        return;
    }
    const uint32_t before = cpu_basepri();
    cpu_set_basepri(PRIORITY_CAN);
    tx_ring[tx_head % TX_SIZE] = *frame;
    tx_head++;
    can_feed();
    cpu_set_basepri(before);
}
