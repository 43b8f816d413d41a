/* Moves classic frames between FDCAN1 and the queues of can_queue.c, by interrupt; rejoins the bus after it
 * had to leave it.
 *
 * The three Tx buffers are a FIFO, or the frames of a message would overtake one another. The message RAM
 * takes words alone. */
#include "fdcan.h"

#include <stddef.h>

#include "can_port.h"
#include "can_queue.h"
#include "cortex.h"
#include "fdcan_timing.h"
#include "hal.h"
#include "pins.h"
#include "registers.h"

enum {
    BUFFERS = 3,
    ALL_BUFFERS = 7,
    /* INIT crosses into the controller's clock, and waits for the frame under way: 160 bits, 1.6 ms at 100
     * kbit/s. Longer than that at the fastest clock, in passes of the loop. */
    MODE_SPINS = 60000,
    UNSENT_MS = 200,  /* a frame without acknowledgment for this long is out of date */
    BUS_OFF_MS = 100, /* pause before the controller tries again: a faulty node must not load the bus */
    LEC_UNCHANGED = 7
};

static volatile bool on; /* the controller has a bit timing */
static volatile uint32_t stuck_ms;
static volatile uint32_t bus_off_ms;
static volatile uint32_t under_way; /* Tx buffers whose end has not been counted */
static uint8_t last_error;
static uint32_t clock_hz;
static bool clock_exact;

/* A node that runs from the RC oscillator would destroy the frames of all others (stm32f405/bxcan.c), so it
 * leaves its pins alone. */
void can_prepare(uint32_t controller_hz, bool exact)
{
    clock_hz = controller_hz;
    clock_exact = exact;
    if (!exact) {
        return;
    }
    pin_to_peripheral(BOARD_CAN_RX, FUNCTION_CAN, PULL_UP); /* without a transceiver the bus looks idle */
    pin_to_peripheral(BOARD_CAN_TX, FUNCTION_CAN, PULL_UP);
    NVIC_IPR(IRQ_FDCAN1_IT0) = PRIORITY_CAN;
    NVIC_ISER(0) = 1u << IRQ_FDCAN1_IT0;
}

/* Discards all waiting frames; the caller holds CAN's interrupt off. */
static void discard(void)
{
    const uint32_t waiting = FDCAN1->txbrp & ALL_BUFFERS;
    for (uint32_t b = 0; b < BUFFERS; b++) {
        can_counts.discarded += (waiting >> b) & 1u;
    }
    FDCAN1->txbcr = waiting;
    can_queue_discard();
    stuck_ms = 0;
}

static bool enter_initialization(void)
{
    FDCAN1->cccr |= FDCAN_CCCR_INIT;
    for (uint32_t i = 0; i < MODE_SPINS; i++) {
        if ((FDCAN1->cccr & FDCAN_CCCR_INIT) != 0) {
            FDCAN1->cccr = FDCAN_CCCR_INIT | FDCAN_CCCR_CCE; /* all else off: classic frames, no test */
            return true;
        }
    }
    return false;
}

/* One filter of two ids; all that it does not let in is refused. */
static void let_in(const uint16_t ids[2])
{
    FDCAN1->rxgfc = FDCAN_RXGFC_RRFE | FDCAN_RXGFC_RRFS | FDCAN_RXGFC_ANFE_NONE | FDCAN_RXGFC_ANFS_NONE |
                    FDCAN_RXGFC_LSS(1);
    FDCAN1_RAM->standard_filters[0] = FDCAN_FILTER_DUAL(ids[0], ids[1]);
}

void hal_can_start(uint32_t bits_per_s, const uint16_t ids[2])
{
    struct can_timing timing;
    on = false; /* from here on neither tick nor interrupt touch the queue to send */
    if (!clock_exact) {
        return;
    }
    const uint32_t before = cpu_basepri();
    cpu_set_basepri(PRIORITY_CAN);
    discard();
    cpu_set_basepri(before);
    if (can_timing(clock_hz, bits_per_s, &fdcan_limits, &timing) && enter_initialization()) {
        FDCAN1->nbtp = fdcan_nbtp(&timing);
        let_in(ids);
        FDCAN1->txbc = 0; /* a FIFO */
        FDCAN1->txbtie = ALL_BUFFERS;
        FDCAN1->ir = UINT32_MAX;
        FDCAN1->ie = FDCAN_IR_RF0N | FDCAN_IR_RF0L | FDCAN_IR_TC | FDCAN_IR_BO;
        FDCAN1->ils = 0; /* all on line 0 */
        FDCAN1->ile = FDCAN_ILE_EINT0;
        under_way = 0;
        bus_off_ms = 0;
        FDCAN1->cccr = 0; /* on the bus once it has been idle for 11 bits; not waited for here */
        on = true;
    }
}

/* The error code of the status register lasts until it is read. */
static uint32_t read_status(void)
{
    const uint32_t psr = FDCAN1->psr;
    if (FDCAN_PSR_LEC(psr) != LEC_UNCHANGED) {
        last_error = (uint8_t)FDCAN_PSR_LEC(psr);
    }
    return psr;
}

bool can_joined(void)
{
    return on && (FDCAN1->cccr & FDCAN_CCCR_INIT) == 0 && (read_status() & FDCAN_PSR_BO) == 0;
}

static void fill(uint32_t b, const struct hal_can_frame *frame)
{
    struct fdcan_element *const element = &FDCAN1_RAM->tx[b];
    element->id = (uint32_t)frame->id << FDCAN_ID_STANDARD;
    element->length = (uint32_t)frame->length << FDCAN_LENGTH;
    element->data[0] = can_frame_word(frame, 0);
    element->data[1] = can_frame_word(frame, 4);
    FDCAN1->txbar = 1u << b;
    under_way |= 1u << b;
}

/* A buffer whose end has not been counted is not filled again, or one of two would be. */
void can_feed(void)
{
    for (uint32_t i = 0; i < BUFFERS; i++) {
        const uint32_t status = FDCAN1->txfqs;
        const uint32_t b = FDCAN_TXFQS_PUT(status);
        const bool has_room = (status & FDCAN_TXFQS_FREE) != 0 && (under_way & 1u << b) == 0;
        const struct hal_can_frame *const frame = has_room ? can_queue_next() : NULL;
        if (frame == NULL) {
            return;
        }
        fill(b, frame);
    }
}

static void count_sent(void)
{
    const uint32_t ended = under_way & ~FDCAN1->txbrp;
    const uint32_t sent = ended & FDCAN1->txbto;
    under_way &= ~ended;
    for (uint32_t b = 0; b < BUFFERS; b++) {
        can_counts.sent += (sent >> b) & 1u;
    }
    if (sent != 0) {
        stuck_ms = 0;
    }
}

static void take_frame(uint32_t b)
{
    const struct fdcan_element *const element = &FDCAN1_RAM->rx_fifo_0[b];
    const uint32_t low = element->data[0];
    const uint32_t high = element->data[1];
    const uint32_t length = (element->length >> FDCAN_LENGTH) & 0xFu;
    const uint32_t id = (element->id >> FDCAN_ID_STANDARD) & 0x7FFu;
    FDCAN1->rxf0a = b;
    can_queue_received(id, length, low, high);
}

static void take_frames(void)
{
    for (uint32_t i = 0; i < BUFFERS; i++) {
        const uint32_t status = FDCAN1->rxf0s;
        if ((status & FDCAN_RXF0S_LEVEL) == 0) {
            return;
        }
        take_frame(FDCAN_RXF0S_GET(status));
    }
}

/* INIT is set by the controller as it leaves the bus. */
static void leave_bus(void)
{
    const bool left = (read_status() & FDCAN_PSR_BO) != 0 && (FDCAN1->cccr & FDCAN_CCCR_INIT) != 0;
    if (left && bus_off_ms == 0) {
        can_counts.bus_offs++;
        bus_off_ms = BUS_OFF_MS;
        discard();
    }
}

/* Flags first: what comes after they have been cleared raises them again. */
void FDCAN1_IT0_Handler(void)
{
    const uint32_t flags = FDCAN1->ir;
    FDCAN1->ir = flags;
    can_counts.overruns += (flags & FDCAN_IR_RF0L) != 0 ? 1u : 0u;
    take_frames();
    if ((flags & FDCAN_IR_TC) != 0) {
        count_sent();
        can_feed();
        can_queue_sent();
    }
    if ((flags & FDCAN_IR_BO) != 0) {
        leave_bus();
    }
    cpu_finish_writes();
}

/* The tick and CAN's interrupt have one priority: neither preempts the other. Once INIT has been cleared the
 * controller waits for 129 times 11 idle bits by itself. */
void can_tick(void)
{
    if (!on) {
        return;
    }
    if (bus_off_ms != 0) {
        bus_off_ms--;
        if (bus_off_ms == 0) {
            FDCAN1->cccr = 0;
        }
        return;
    }
    count_sent(); /* those that were cancelled as well */
    if (under_way == 0) {
        stuck_ms = 0;
    } else if (++stuck_ms >= UNSENT_MS) {
        discard();
    } else {
        /* it may still be acknowledged */
    }
}

static uint8_t state(uint32_t psr)
{
    if (!clock_exact) {
        return HAL_CAN_NO_CRYSTAL;
    }
    if (!on) {
        return HAL_CAN_OFF;
    }
    if (bus_off_ms != 0 || (psr & FDCAN_PSR_BO) != 0) {
        return HAL_CAN_BUS_OFF;
    }
    return can_state_on_bus((psr & FDCAN_PSR_ACT) == 0, (psr & FDCAN_PSR_EP) != 0, (psr & FDCAN_PSR_EW) != 0);
}

void hal_can_report(struct hal_can_report *out)
{
    can_queue_counts(out);
    const uint32_t psr = on ? read_status() : 0;
    const uint32_t ecr = on ? FDCAN1->ecr : 0;
    out->state = state(psr);
    out->transmit_errors = (uint8_t)FDCAN_ECR_TEC(ecr);
    out->receive_errors = (uint8_t)FDCAN_ECR_REC(ecr);
    out->last_error = last_error;
}
