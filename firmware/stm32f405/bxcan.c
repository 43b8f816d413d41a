/* Moves frames between CAN1 and the queues of can_queue.c, by interrupt; rejoins the bus after it had to
 * leave it.
 *
 * The three mailboxes leave in the order in which they were filled (TXFP), or the frames of a message would
 * overtake one another. Where there is no such controller, its registers read as zero and it stays off. */
#include "bxcan.h"

#include <stddef.h>

#include "bxcan_timing.h"
#include "can_port.h"
#include "can_queue.h"
#include "cortex.h"
#include "hal.h"
#include "pins.h"
#include "registers.h"

enum {
    MAILBOXES = 3,
    /* A mode change waits for the frame under way: 160 bits, 1.6 ms at 100 kbit/s. Longer than that at the
     * fastest clock, in passes of the loop. */
    MODE_SPINS = 60000,
    UNSENT_MS = 200,  /* a frame without acknowledgment for this long is out of date */
    BUS_OFF_MS = 100, /* pause before the controller tries again: a faulty node must not load the bus */
};

static volatile bool on;         /* the controller is there and has a bit timing */
static volatile bool recovering; /* between initialization mode and the bus */
static volatile uint32_t stuck_ms;
static volatile uint32_t bus_off_ms;
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
void can_prepare(uint32_t controller_hz, bool exact)
{
    clock_hz = controller_hz;
    clock_exact = exact;
    if (!exact) {
        return;
    }
    pin_to_peripheral(BOARD_CAN_RX, FUNCTION_CAN, PULL_UP); /* without a transceiver the bus looks idle */
    pin_to_peripheral(BOARD_CAN_TX, FUNCTION_CAN, PULL_UP);
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
            can_counts.discarded++;
            CAN1->tsr = CAN_TSR_ABRQ(m);
        }
    }
    can_queue_discard();
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
    struct can_timing timing;
    on = false; /* from here on neither tick nor interrupts touch the queue to send */
    const uint32_t before = cpu_basepri();
    cpu_set_basepri(PRIORITY_CAN);
    discard();
    cpu_set_basepri(before);
    if (clock_exact && can_timing(clock_hz, bits_per_s, &bxcan_limits, &timing) &&
        change_mode(CAN_MCR_INRQ | CAN_MCR_TXFP, CAN_MSR_INAK)) {
        CAN1->btr = bxcan_btr(&timing);
        let_in(ids);
        CAN1->ier = CAN_IER_TMEIE | CAN_IER_FMPIE0 | CAN_IER_BOFIE | CAN_IER_ERRIE;
        CAN1->mcr = CAN_MCR_TXFP; /* on the bus once it has been idle for 11 bits; not waited for here */
        recovering = false;
        bus_off_ms = 0;
        on = true;
    }
}

bool can_joined(void)
{
    return on && (CAN1->msr & CAN_MSR_INAK) == 0 && (CAN1->esr & CAN_ESR_BOFF) == 0;
}

static void fill(uint32_t m, const struct hal_can_frame *frame)
{
    CAN1->tx[m].dtr = frame->length;
    CAN1->tx[m].dlr = can_frame_word(frame, 0);
    CAN1->tx[m].dhr = can_frame_word(frame, 4);
    CAN1->tx[m].ir = (uint32_t)frame->id << CAN_IR_STID | CAN_TIR_TXRQ;
}

void can_feed(void)
{
    for (uint32_t m = 0; m < MAILBOXES; m++) {
        if ((CAN1->tsr & CAN_TSR_TME(m)) != 0) {
            const struct hal_can_frame *const frame = can_queue_next();
            if (frame == NULL) {
                return;
            }
            fill(m, frame);
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
                can_counts.sent++;
                stuck_ms = 0;
            }
        }
    }
    can_feed();
    can_queue_sent();
    cpu_finish_writes();
}

void CAN1_RX0_Handler(void)
{
    if ((CAN1->rfr[0] & CAN_RFR_FOVR) != 0) {
        can_counts.overruns++;
        CAN1->rfr[0] = CAN_RFR_FOVR;
    }
    if ((CAN1->rfr[0] & CAN_RFR_FMP) == 0) {
        cpu_finish_writes();
        return;
    }
    const uint32_t low = CAN1->rx[0].dlr;
    const uint32_t high = CAN1->rx[0].dhr;
    const uint32_t length = CAN1->rx[0].dtr & 0xFu;
    const uint32_t id = CAN1->rx[0].ir >> CAN_IR_STID;
    CAN1->rfr[0] = CAN_RFR_RFOM;
    can_queue_received(id, length, low, high);
    cpu_finish_writes();
}

void CAN1_SCE_Handler(void)
{
    CAN1->msr = CAN_MSR_ERRI;
    if ((CAN1->esr & CAN_ESR_BOFF) != 0 && bus_off_ms == 0) {
        can_counts.bus_offs++;
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
void can_tick(void)
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
    return can_state_on_bus((CAN1->msr & CAN_MSR_INAK) != 0, (esr & CAN_ESR_EPVF) != 0,
                            (esr & CAN_ESR_EWGF) != 0);
}

void hal_can_report(struct hal_can_report *out)
{
    const uint32_t esr = on ? CAN1->esr : 0;
    can_queue_counts(out);
    out->state = state(esr);
    out->transmit_errors = (uint8_t)CAN_ESR_TEC(esr);
    out->receive_errors = (uint8_t)CAN_ESR_REC(esr);
    out->last_error = (uint8_t)CAN_ESR_LEC(esr);
}
