/* Moves frames between CAN1 and two queues, by interrupt; rejoins the bus after it had to leave it.
 *
 * Each queue has one writer and one reader, the interrupts and the main loop, as in usart_link.c. What is
 * received overwrites the oldest that the main loop has not read, so that the tick sees each frame, however
 * long the main loop takes. The three mailboxes leave in the order in which they were filled (TXFP), or the
 * frames of a message would overtake one another. Where there is no such controller, its registers read as
 * zero and it stays off. */
#include "bxcan.h"

#include "bxcan_timing.h"
#include "cortex.h"
#include "hal.h"
#include "idle.h"
#include "pins.h"
#include "registers.h"

enum {
    /* Powers of two. A host sends 8 frames before it waits for flow control; of the shortest frames, 47 bits,
     * 21 arrive between two ticks at 1 Mbit/s. */
    RX_SIZE = 32,
    TX_SIZE = 32,
    MAILBOXES = 3,
    /* A mode change waits for the frame under way: 160 bits, 1.6 ms at 100 kbit/s. Longer than that at the
     * fastest clock, in passes of the loop. */
    MODE_SPINS = 60000,
    UNSENT_MS = 200,  /* a frame without acknowledgment for this long is out of date */
    BUS_OFF_MS = 100, /* pause before the controller tries again: a faulty node must not load the bus */
};

static struct hal_can_frame rx_ring[RX_SIZE];
static struct hal_can_frame tx_ring[TX_SIZE];
static volatile uint32_t rx_head;   /* written by the interrupt */
static volatile uint32_t rx_tail;   /* written by the main loop */
static volatile uint32_t rx_peeked; /* written by the tick, or with the tick held off */
static volatile uint32_t tx_head;   /* written by the main loop */
static volatile uint32_t tx_tail;   /* written with CAN's interrupts held off, or by them */
static volatile bool call;
static volatile bool on;         /* the controller is there and has a bit timing */
static volatile bool recovering; /* between initialization mode and the bus */
static volatile uint32_t stuck_ms;
static volatile uint32_t bus_off_ms;
static struct hal_can_report counts;
static uint32_t clock_hz;
static bool clock_exact;

static bool change_mode(uint32_t mcr, uint32_t inak)
{
    CAN1->mcr = mcr;
    for (uint32_t i = 0; i < MODE_SPINS; i++) {
        if ((CAN1->msr & CAN_MSR_INAK) == inak) {
            return true;
        }
    }
    return false;
}

/* A bus of 10 quanta bears 1.2 % between its nodes (sample point at 80 %; Bosch CAN 2.0, section 9). The RC
 * oscillator's 1 % at 25 C become 8 % over temperature: a node that runs from it would destroy the frames of
 * all others, so it leaves its pins alone. */
void bxcan_prepare(uint32_t bus_hz, bool exact)
{
    clock_hz = bus_hz;
    clock_exact = exact;
    if (!exact) {
        return;
    }
    pin_to_peripheral(BOARD_CAN_RX, FUNCTION_CAN1, PULL_UP); /* without a transceiver the bus looks idle */
    pin_to_peripheral(BOARD_CAN_TX, FUNCTION_CAN1, PULL_UP);
    static const uint8_t irqs[] = {IRQ_CAN1_TX, IRQ_CAN1_RX0, IRQ_CAN1_SCE};
    for (uint32_t i = 0; i < sizeof irqs; i++) {
        NVIC_IPR(irqs[i]) = PRIORITY_CAN;
        NVIC_ISER(irqs[i] / 32u) = 1u << (irqs[i] % 32u);
    }
}

/* Discards all waiting frames; the caller holds CAN's interrupts off. */
static void discard(void)
{
    for (uint32_t m = 0; m < MAILBOXES; m++) {
        if ((CAN1->tsr & CAN_TSR_TME(m)) == 0) {
            counts.discarded++;
            CAN1->tsr = CAN_TSR_ABRQ(m);
        }
    }
    counts.discarded += tx_head - tx_tail;
    tx_tail = tx_head;
    stuck_ms = 0;
}

/* One filter of four standard ids in list mode (RM0090 section 32.7.4); two ids, each twice. */
static void let_in(const uint16_t ids[2])
{
    const uint32_t pair = ((uint32_t)ids[1] << 5 << 16) | ((uint32_t)ids[0] << 5);
    CAN1->fmr |= CAN_FMR_FINIT;
    CAN1->fa1r = 0;
    CAN1->fs1r = 0;  /* 16 bits each */
    CAN1->fm1r = 1u; /* list */
    CAN1->ffa1r = 0; /* FIFO 0 */
    CAN1->filter[0][0] = pair;
    CAN1->filter[0][1] = pair;
    CAN1->fa1r = 1u;
    CAN1->fmr &= ~CAN_FMR_FINIT;
}

void hal_can_start(uint32_t bits_per_s, const uint16_t ids[2])
{
    uint32_t timing;
    on = false; /* from here on neither tick nor interrupts touch the queue to send */
    const uint32_t before = cpu_basepri();
    cpu_set_basepri(PRIORITY_CAN);
    discard();
    cpu_set_basepri(before);
    if (clock_exact && bxcan_timing(clock_hz, bits_per_s, &timing) &&
        change_mode(CAN_MCR_INRQ | CAN_MCR_TXFP, CAN_MSR_INAK)) {
        CAN1->btr = timing;
        let_in(ids);
        CAN1->ier = CAN_IER_TMEIE | CAN_IER_FMPIE0 | CAN_IER_BOFIE | CAN_IER_ERRIE;
        CAN1->mcr = CAN_MCR_TXFP; /* on the bus once it has been idle for 11 bits; not waited for here */
        recovering = false;
        bus_off_ms = 0;
        on = true;
    }
}

static bool joined(void)
{
    return on && (CAN1->msr & CAN_MSR_INAK) == 0 && (CAN1->esr & CAN_ESR_BOFF) == 0;
}

static void fill(uint32_t m, const struct hal_can_frame *frame)
{
    const uint8_t *const d = frame->data;
    CAN1->tx[m].dtr = frame->length;
    CAN1->tx[m].dlr = d[0] | (uint32_t)d[1] << 8 | (uint32_t)d[2] << 16 | (uint32_t)d[3] << 24;
    CAN1->tx[m].dhr = d[4] | (uint32_t)d[5] << 8 | (uint32_t)d[6] << 16 | (uint32_t)d[7] << 24;
    CAN1->tx[m].ir = (uint32_t)frame->id << CAN_IR_STID | CAN_TIR_TXRQ;
}

/* The caller holds CAN's interrupts off, or is one. */
static void feed_mailboxes(void)
{
    for (uint32_t m = 0; m < MAILBOXES && tx_tail != tx_head; m++) {
        if ((CAN1->tsr & CAN_TSR_TME(m)) != 0) {
            fill(m, &tx_ring[tx_tail % TX_SIZE]);
            tx_tail++;
        }
    }
}

void CAN1_TX_Handler(void)
{
    const uint32_t status = CAN1->tsr;
    for (uint32_t m = 0; m < MAILBOXES; m++) {
        if ((status & CAN_TSR_RQCP(m)) != 0) {
            CAN1->tsr = CAN_TSR_RQCP(m);
            if ((status & CAN_TSR_TXOK(m)) != 0) {
                counts.sent++;
                stuck_ms = 0;
            }
        }
    }
    feed_mailboxes();
    /* The main loop refills in halves: waking it for every frame would cost too much. */
    if (tx_head - tx_tail == TX_SIZE / 2u || tx_head == tx_tail) {
        call = true;
        idle_end();
    }
    cpu_finish_writes();
}

void CAN1_RX0_Handler(void)
{
    if ((CAN1->rfr[0] & CAN_RFR_FOVR) != 0) {
        counts.overruns++;
        CAN1->rfr[0] = CAN_RFR_FOVR;
    }
    if ((CAN1->rfr[0] & CAN_RFR_FMP) == 0) {
        cpu_finish_writes();
        return;
    }
    const uint32_t head = rx_head;
    struct hal_can_frame *const frame = &rx_ring[head % RX_SIZE];
    const uint32_t low = CAN1->rx[0].dlr;
    const uint32_t high = CAN1->rx[0].dhr;
    const uint32_t length = CAN1->rx[0].dtr & 0xFu;
    frame->id = (uint16_t)(CAN1->rx[0].ir >> CAN_IR_STID);
    frame->length = (uint8_t)(length < sizeof frame->data ? length : sizeof frame->data);
    for (uint32_t i = 0; i < 4; i++) {
        frame->data[i] = (uint8_t)(low >> (8u * i));
        frame->data[4u + i] = (uint8_t)(high >> (8u * i));
    }
    counts.received++;
    counts.overruns += head - rx_tail >= RX_SIZE ? 1u : 0u; /* this one took the place of the oldest */
    rx_head = head + 1u;
    CAN1->rfr[0] = CAN_RFR_RFOM;
    call = true;
    idle_end();
    cpu_finish_writes();
}

void CAN1_SCE_Handler(void)
{
    CAN1->msr = CAN_MSR_ERRI;
    if ((CAN1->esr & CAN_ESR_BOFF) != 0 && bus_off_ms == 0) {
        counts.bus_offs++;
        bus_off_ms = BUS_OFF_MS;
        discard();
    }
    cpu_finish_writes();
}

/* RM0090 section 32.7.6: the software lets the controller recover by way of initialization mode; it then
 * waits for 128 times 11 idle bits by itself. */
static void recover(void)
{
    if (bus_off_ms > 1) {
        bus_off_ms--;
    } else if (!recovering) {
        CAN1->mcr = CAN_MCR_INRQ | CAN_MCR_TXFP;
        recovering = true;
    } else if ((CAN1->msr & CAN_MSR_INAK) != 0) {
        CAN1->mcr = CAN_MCR_TXFP;
        recovering = false;
        bus_off_ms = 0;
    }
}

/* The tick and CAN's interrupts have one priority: none preempts another. */
void bxcan_tick(void)
{
    if (!on) {
        return;
    }
    if (bus_off_ms != 0) {
        recover();
        return;
    }
    const uint32_t all_free = CAN_TSR_TME(0) | CAN_TSR_TME(1) | CAN_TSR_TME(2);
    if ((CAN1->tsr & all_free) == all_free) {
        stuck_ms = 0;
    } else if (++stuck_ms >= UNSENT_MS) {
        discard();
    }
}

bool bxcan_take_call(void)
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

bool bxcan_has_unheard(void)
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
    return joined() ? TX_SIZE - (tx_head - tx_tail) : 0;
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
    feed_mailboxes();
    cpu_set_basepri(before);
}

static uint8_t state(uint32_t esr)
{
    if (!clock_exact) {
        return HAL_CAN_NO_CRYSTAL;
    }
    if (!on) {
        return HAL_CAN_OFF;
    }
    if (bus_off_ms != 0 || (esr & CAN_ESR_BOFF) != 0) {
        return HAL_CAN_BUS_OFF;
    }
    if ((CAN1->msr & CAN_MSR_INAK) != 0) {
        return HAL_CAN_JOINING;
    }
    if ((esr & CAN_ESR_EPVF) != 0) {
        return HAL_CAN_PASSIVE;
    }
    return (esr & CAN_ESR_EWGF) != 0 ? HAL_CAN_WARNING : HAL_CAN_ACTIVE;
}

void hal_can_report(struct hal_can_report *out)
{
    const uint32_t esr = on ? CAN1->esr : 0;
    const uint32_t before = cpu_basepri();
    cpu_set_basepri(PRIORITY_TICK);
    *out = counts;
    cpu_set_basepri(before);
    out->state = state(esr);
    out->transmit_errors = (uint8_t)CAN_ESR_TEC(esr);
    out->receive_errors = (uint8_t)CAN_ESR_REC(esr);
    out->last_error = (uint8_t)CAN_ESR_LEC(esr);
}
