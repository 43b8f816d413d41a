/* CAN1 (bxCAN): modes, mailboxes, filters, receive FIFOs, error counters and interrupts, RM0090 section 32.
 */
#include "machine.h"

#include <string.h>

enum { INRQ = 1 << 0, SLEEP = 1 << 1, TXFP = 1 << 2, RFLM = 1 << 3, NART = 1 << 4, ABOM = 1 << 6 };
enum { MASTER_RESET = 1 << 15 };
enum { INAK = 1 << 0, SLAK = 1 << 1, ERRI = 1 << 2 };
enum { RQCP = 1 << 0, TXOK = 1 << 1, TERR = 1 << 3, ABRQ = 1 << 7, TME0 = 1 << 26 };
enum { FMP = 3, FULL = 1 << 3, FOVR = 1 << 4, RFOM = 1 << 5 };
enum { TMEIE = 1 << 0, EWGIE = 1 << 8, EPVIE = 1 << 9, BOFIE = 1 << 10, LECIE = 1 << 11, ERRIE = 1 << 15 };
enum { EWGF = 1 << 0, EPVF = 1 << 1, BOFF = 1 << 2 };
enum { TXRQ = 1 << 0, REMOTE = 1 << 1, EXTENDED = 1 << 2 };
enum { LEC_STUFF = 1, LEC_ACKNOWLEDGMENT = 3, LEC_BIT = 5 };
enum { DELIVERED = 8, DELIVERED_DAMAGED }; /* events besides the outcomes */
enum { IDLE_BITS = 11, RECOVERY_BITS = 128 * 11, SUSPEND_BITS = 8, PAUSE_BITS = 3 };
#define LOOPBACK (1u << 30)
#define SILENT   (1u << 31)
#define FINIT    1u

static uint64_t bit_ps(const struct board *b)
{
    uint32_t btr = b->can.btr;
    uint64_t quanta = 3u + (btr >> 16 & 0xFu) + (btr >> 20 & 7u);
    uint64_t clocks = ((btr & 0x3FFu) + 1u) * quanta * b->rcc.ppre1;
    return (uint64_t)((unsigned __int128)clocks * PS_PER_S / b->clock.hz);
}

static uint64_t now_ps(const struct board *b)
{
    return time_to_ps(b, b->moment);
}

static uint32_t error_flags(const struct can *c)
{
    uint32_t flags = c->tec >= 96 || c->rec >= 96 ? EWGF : 0;
    flags |= c->tec >= 128 || c->rec >= 128 ? EPVF : 0;
    return flags | (c->bus_off ? BOFF : 0);
}

static void update_lines(struct board *b)
{
    const struct can *c = &b->can;
    uint32_t completed = c->tsr & (RQCP | RQCP << 8 | RQCP << 16);
    nvic_set_line(b, IRQ_CAN1_TX, completed != 0 && (c->ier & TMEIE) != 0);
    for (unsigned i = 0; i < 2; i++) {
        uint32_t enabled = c->ier >> (1 + 3 * i);
        uint32_t now = ((c->rfr[i] & FMP) != 0 ? 1u : 0) | ((c->rfr[i] & FULL) != 0 ? 2u : 0) |
                       ((c->rfr[i] & FOVR) != 0 ? 4u : 0);
        nvic_set_line(b, IRQ_CAN1_TX + 1 + i, (now & enabled) != 0);
    }
    nvic_set_line(b, IRQ_CAN1_TX + 3, (c->msr & ERRI) != 0 && (c->ier & ERRIE) != 0);
}

static bool running(const struct board *b)
{
    return b->powered && (b->can.msr & (INAK | SLAK)) == 0;
}

static bool is_wired(const struct board *b)
{
    return b->can.attached && b->can_routed[0] && b->can_routed[1];
}

static struct board_can_frame frame_of(const struct can_box *box)
{
    struct board_can_frame frame = {.extended = (box->ir & EXTENDED) != 0, .remote = (box->ir & REMOTE) != 0};
    frame.id = frame.extended ? box->ir >> 3 : box->ir >> 21;
    uint32_t length = box->dtr & 0xFu;
    frame.length = (uint8_t)(length < 8 ? length : 8);
    memcpy(frame.data, &box->dlr, 4);
    memcpy(frame.data + 4, &box->dhr, 4);
    return frame;
}

static uint64_t content_of(const struct board_can_frame *frame)
{
    uint64_t content;
    memcpy(&content, frame->data, sizeof content);
    return content;
}

/* The mailbox that goes next, -1 none: by request with TXFP, else by identifier, then by number (32.7.2). The
 * identifier register holds standard and extended ones so that the smaller number is the more urgent. */
static int next_mailbox(const struct can *c)
{
    int best = -1;
    for (int m = 0; m < CAN_MAILBOXES; m++) {
        if ((c->tx[m].ir & TXRQ) == 0) {
            continue;
        }
        bool first = best < 0;
        if (!first && (c->mcr & TXFP) != 0) {
            first = c->requested_ps[m] < c->requested_ps[best];
        } else if (!first) {
            first = c->tx[m].ir < c->tx[best].ir;
        }
        best = first ? m : best;
    }
    return best;
}

static void schedule(struct board *b)
{
    const struct can *c = &b->can;
    if (c->waiting == 0) {
        event_cancel(b, EVENT_CAN);
    } else {
        event_at_ps(b, EVENT_CAN, c->happening[c->first].at_ps);
    }
}

static void happen_at(struct board *b, uint64_t at_ps, uint8_t kind, const struct board_can_frame *frame)
{
    struct can *c = &b->can;
    if (c->waiting == CAN_HAPPENINGS) {
        return;
    }
    struct can_happening *h = &c->happening[(c->first + c->waiting++) % CAN_HAPPENINGS];
    *h = (struct can_happening){.at_ps = at_ps, .kind = kind};
    if (frame != NULL) {
        h->frame = *frame;
    }
    schedule(b);
}

/* In loopback the controller receives its own frames and not the bus's (32.5.2), with its own timing. */
static void loop_back(struct board *b)
{
    struct can *c = &b->can;
    int m = next_mailbox(c);
    if ((c->btr & LOOPBACK) == 0 || c->sending >= 0 || m < 0 || !running(b)) {
        return;
    }
    struct board_can_frame frame = frame_of(&c->tx[m]);
    c->sending = m;
    happen_at(b, now_ps(b) + board_can_bits(&frame) * bit_ps(b), BOARD_CAN_SENT, NULL);
}

static void finish_mailbox(struct can *c, int m, uint32_t result)
{
    c->tx[m].ir &= ~(uint32_t)TXRQ;
    c->tsr = (c->tsr & ~(0x8Fu << (8 * m))) | (RQCP | result) << (8 * m) | (uint32_t)TME0 << m;
}

static void enter_init(struct board *b)
{
    b->can.msr = (b->can.msr & ~(uint32_t)SLAK) | INAK;
    event_cancel(b, EVENT_CAN_JOIN);
}

static void join_later(struct board *b, uint64_t bits)
{
    if (is_wired(b) || (b->can.btr & LOOPBACK) != 0) {
        event_at_ps(b, EVENT_CAN_JOIN, now_ps(b) + bits * bit_ps(b));
    }
}

void can_join_event(struct board *b)
{
    struct can *c = &b->can;
    c->msr &= ~(uint32_t)INAK;
    if (c->bus_off) {
        c->bus_off = false;
        c->tec = c->rec = 0;
    }
    loop_back(b);
}

/* After each change of the counters: flags that rise may raise an interrupt (32.8, CAN_IER). */
static void note_error(struct board *b, uint32_t before, uint32_t code)
{
    struct can *c = &b->can;
    if (c->tec > 255 && !c->bus_off) {
        c->bus_off = true;
        if ((c->mcr & ABOM) != 0) {
            join_later(b, RECOVERY_BITS);
        }
    }
    c->esr_lec = code;
    uint32_t risen = error_flags(c) & ~before;
    bool asks = ((risen & EWGF) != 0 && (c->ier & EWGIE) != 0) ||
                ((risen & EPVF) != 0 && (c->ier & EPVIE) != 0) ||
                ((risen & BOFF) != 0 && (c->ier & BOFIE) != 0) || (c->ier & LECIE) != 0;
    c->msr |= asks ? ERRI : 0;
}

static bool filter_takes(const struct can *c, unsigned bank, const struct board_can_frame *f, uint32_t *hit)
{
    uint32_t wide = f->extended ? f->id << 3 | EXTENDED : f->id << 21;
    wide |= f->remote ? REMOTE : 0;
    uint32_t narrow =
        wide >> 21 << 5 | (f->remote ? 1u << 4 : 0) | (f->extended ? 1u << 3 | (f->id >> 15 & 7u) : 0);
    const uint32_t *r = c->filter[bank];
    bool list = (c->fm1r >> bank & 1u) != 0;
    *hit = 0;
    if ((c->fs1r >> bank & 1u) != 0) {
        if (!list) {
            return ((wide ^ r[0]) & r[1] & ~1u) == 0;
        }
        *hit = wide == (r[0] & ~1u) ? 0 : 1;
        return *hit == 0 || wide == (r[1] & ~1u);
    }
    const uint32_t half[4] = {r[0] & 0xFFFFu, r[0] >> 16, r[1] & 0xFFFFu, r[1] >> 16};
    if (list) {
        for (*hit = 0; *hit < 4 && narrow != half[*hit]; ++*hit) {
        }
        return *hit < 4;
    }
    *hit = ((narrow ^ half[0]) & half[1]) == 0 ? 0 : 1;
    return *hit == 0 || ((narrow ^ half[2]) & half[3]) == 0;
}

/* Filters of a bank: their numbers count through all banks of a FIFO, active or not (32.7.4). */
static uint32_t filters_in(const struct can *c, unsigned bank)
{
    bool wide = (c->fs1r >> bank & 1u) != 0;
    bool list = (c->fm1r >> bank & 1u) != 0;
    return (wide ? 1u : 2u) * (list ? 2u : 1u);
}

static void store(struct board *b, unsigned fifo, uint32_t match, const struct board_can_frame *f)
{
    struct can *c = &b->can;
    uint32_t depth = c->rfr[fifo] & FMP;
    uint32_t at = depth;
    if (depth == CAN_FIFO_DEPTH) {
        c->rfr[fifo] |= FOVR;
        if ((c->mcr & RFLM) != 0) {
            return;
        }
        at = CAN_FIFO_DEPTH - 1; /* the newest is overwritten (32.7.3) */
    } else {
        depth++;
    }
    struct can_box *box = &c->fifo[fifo][at];
    box->ir = (f->extended ? f->id << 3 | EXTENDED : f->id << 21) | (f->remote ? REMOTE : 0);
    box->dtr = match << 8 | f->length;
    memcpy(&box->dlr, f->data, 4);
    memcpy(&box->dhr, f->data + 4, 4);
    c->rfr[fifo] = (c->rfr[fifo] & (FOVR | FULL)) | depth | (depth == CAN_FIFO_DEPTH ? FULL : 0);
}

static void receive(struct board *b, const struct board_can_frame *f)
{
    struct can *c = &b->can;
    uint32_t numbers[2] = {0, 0};
    unsigned banks = c->fmr >> 8 & 0x3Fu; /* the others are CAN2's */
    if ((c->fmr & FINIT) != 0) {
        return;
    }
    for (unsigned bank = 0; bank < banks && bank < CAN_BANKS; bank++) {
        unsigned fifo = c->ffa1r >> bank & 1u;
        uint32_t hit;
        if ((c->fa1r >> bank & 1u) != 0 && filter_takes(c, bank, f, &hit)) {
            trace_add(b, TRACE_CAN_RX, f->id, content_of(f));
            store(b, fifo, numbers[fifo] + hit, f);
            return;
        }
        numbers[fifo] += filters_in(c, bank);
    }
}

static void conclude(struct board *b, uint8_t kind)
{
    struct can *c = &b->can;
    uint32_t before = error_flags(c);
    int m = c->sending;
    c->sending = -1;
    if (m < 0) {
        return; /* a reset came in between */
    }
    if (kind == BOARD_CAN_SENT) {
        struct board_can_frame frame = frame_of(&c->tx[m]);
        trace_add(b, TRACE_CAN_TX, frame.id, content_of(&frame));
        finish_mailbox(c, m, TXOK);
        c->tec -= c->tec > 0 ? 1 : 0;
        c->esr_lec = 0;
        if ((c->btr & LOOPBACK) != 0) {
            receive(b, &frame);
        }
    } else {
        /* A passive node that is merely alone counts no further (ISO 11898-1, fault confinement). */
        bool alone = kind == BOARD_CAN_UNACKNOWLEDGED && c->tec >= 128;
        c->tec += alone ? 0 : 8;
        note_error(b, before, kind == BOARD_CAN_UNACKNOWLEDGED ? LEC_ACKNOWLEDGMENT : LEC_BIT);
        if ((c->mcr & NART) != 0 || (c->tsr >> (8 * m) & ABRQ) != 0) {
            finish_mailbox(c, m, TERR);
        }
    }
    if ((error_flags(c) & EPVF) != 0) {
        c->silent_until_ps = now_ps(b) + (PAUSE_BITS + SUSPEND_BITS) * bit_ps(b);
    }
    if ((c->mcr & INRQ) != 0) {
        enter_init(b); /* it was asked for while the frame was on its way */
    }
}

void can_event(struct board *b)
{
    struct can *c = &b->can;
    struct can_happening h = c->happening[c->first];
    c->first = (c->first + 1) % CAN_HAPPENINGS;
    c->waiting--;
    schedule(b);
    uint32_t before = error_flags(c);
    if (h.kind < DELIVERED) {
        conclude(b, h.kind);
    } else if (running(b) && !c->bus_off && h.kind == DELIVERED) {
        c->rec = c->rec > 127 ? 119 : c->rec - (c->rec > 0 ? 1 : 0);
        c->esr_lec = 0;
        receive(b, &h.frame);
    } else if (running(b) && !c->bus_off) {
        c->rec += c->rec < 255 ? 1 : 0;
        note_error(b, before, LEC_STUFF);
    }
    loop_back(b);
    update_lines(b);
}

void board_can_attach(struct board *board, bool attached)
{
    struct can *c = &board->can;
    c->attached = attached;
    if (attached && board->powered && (c->msr & INAK) != 0 && (c->mcr & (INRQ | SLEEP)) == 0) {
        join_later(board, IDLE_BITS);
    }
}

bool board_can_offer(const struct board *board, struct board_can_frame *frame, uint64_t *since_ps)
{
    const struct can *c = &board->can;
    int m = next_mailbox(c);
    if (m < 0 || c->sending >= 0 || c->bus_off || !running(board) || !is_wired(board) ||
        (c->btr & (LOOPBACK | SILENT)) != 0) {
        return false;
    }
    *frame = frame_of(&c->tx[m]);
    *since_ps = c->requested_ps[m] > c->silent_until_ps ? c->requested_ps[m] : c->silent_until_ps;
    return true;
}

bool board_can_timing(const struct board *board, struct board_can_timing *timing, bool *acknowledges)
{
    const struct can *c = &board->can;
    bool hears = running(board) && is_wired(board) && !c->bus_off && (c->btr & LOOPBACK) == 0;
    *acknowledges = hears && (c->btr & SILENT) == 0;
    timing->before = 2u + (c->btr >> 16 & 0xFu); /* the synchronisation segment and TS1 */
    timing->after = 1u + (c->btr >> 20 & 7u);
    timing->jump = 1u + (c->btr >> 24 & 3u);
    timing->bit_ps = (double)bit_ps(board);
    return hears;
}

void board_can_conclude(struct board *board, enum board_can_outcome outcome, uint64_t end_ps)
{
    board->can.sending = next_mailbox(&board->can);
    happen_at(board, end_ps, (uint8_t)outcome, NULL);
}

void board_can_deliver(struct board *board, const struct board_can_frame *frame, bool damaged,
                       uint64_t end_ps)
{
    happen_at(board, end_ps, damaged ? DELIVERED_DAMAGED : DELIVERED, frame);
}

void can_reset(struct board *b)
{
    bool attached = b->can.attached;
    b->can = (struct can){.mcr = 0x00010002u,
                          .msr = 0x00000C02u,
                          .tsr = 0x1C000000u,
                          .btr = 0x01230000u,
                          .fmr = 0x2A1C0E01u,
                          .sending = -1,
                          .attached = attached};
    event_cancel(b, EVENT_CAN);
    event_cancel(b, EVENT_CAN_JOIN);
    update_lines(b);
}

static void write_mcr(struct board *b, uint32_t value)
{
    struct can *c = &b->can;
    if ((value & MASTER_RESET) != 0) {
        can_reset(b);
        return;
    }
    c->mcr = value & 0x000100FFu;
    if ((value & INRQ) != 0) {
        if (c->sending < 0) {
            enter_init(b);
        }
    } else if ((value & SLEEP) != 0) {
        c->msr = (c->msr & ~(uint32_t)INAK) | (c->sending < 0 ? SLAK : 0);
        event_cancel(b, EVENT_CAN_JOIN);
    } else if ((c->msr & (INAK | SLAK)) != 0 && b->events[EVENT_CAN_JOIN].at == NEVER) {
        c->msr = (c->msr & ~(uint32_t)SLAK) | INAK;
        join_later(b, c->bus_off ? RECOVERY_BITS : IDLE_BITS);
    }
}

static void write_tsr(struct can *c, uint32_t value)
{
    for (int m = 0; m < CAN_MAILBOXES; m++) {
        uint32_t lane = value >> (8 * m);
        if ((lane & RQCP) != 0) {
            c->tsr &= ~(0xFu << (8 * m)); /* takes TXOK, ALST and TERR along */
        }
        if ((lane & ABRQ) != 0 && (c->tx[m].ir & TXRQ) != 0) {
            if (c->sending == m) {
                c->tsr |= (uint32_t)ABRQ << (8 * m); /* it may still be sent */
            } else {
                finish_mailbox(c, m, 0);
            }
        }
    }
}

static void write_mailbox(struct board *b, int m, uint32_t word, uint32_t value)
{
    struct can *c = &b->can;
    struct can_box *box = &c->tx[m];
    uint32_t *const words[] = {&box->ir, &box->dtr, &box->dlr, &box->dhr};
    if ((c->tsr & (uint32_t)TME0 << m) == 0) {
        warn_once(b, 0xF0000090u, "CAN1: a mailbox is written while it is full: ignored");
        return;
    }
    *words[word] = value;
    if (word == 0 && (value & TXRQ) != 0) {
        c->tsr &= ~((uint32_t)TME0 << m | 0xFu << (8 * m));
        c->requested_ps[m] = now_ps(b);
        loop_back(b);
    }
}

static void release(struct can *c, unsigned fifo)
{
    uint32_t depth = c->rfr[fifo] & FMP;
    if (depth > 0) {
        memmove(&c->fifo[fifo][0], &c->fifo[fifo][1], (CAN_FIFO_DEPTH - 1) * sizeof c->fifo[0][0]);
        c->rfr[fifo] = (c->rfr[fifo] & FOVR) | (depth - 1);
    }
}

static void write_control(struct board *b, uint32_t offset, uint32_t value)
{
    struct can *c = &b->can;
    switch (offset) {
    case 0x00:
        write_mcr(b, value);
        break;
    case 0x04:
        c->msr &= ~(value & 0x1Cu);
        break;
    case 0x08:
        write_tsr(c, value);
        break;
    case 0x0C:
    case 0x10:
        c->rfr[offset / 4 - 3] &= ~(value & (FULL | FOVR));
        if ((value & RFOM) != 0) {
            release(c, offset / 4 - 3);
        }
        break;
    case 0x14:
        c->ier = value;
        break;
    case 0x18:
        c->esr_lec = value >> 4 & 7u;
        break;
    default:
        if ((c->msr & INAK) == 0) {
            warn_once(b, 0xF0000091u, "CAN1: bit timing written outside of initialization: ignored");
        } else {
            c->btr = value;
        }
    }
}

static uint32_t read_control(const struct can *c, uint32_t offset)
{
    uint32_t code = 0;
    while (code < 2 && (c->tsr & (uint32_t)TME0 << code) == 0) {
        code++;
    }
    const uint32_t tec = c->tec < 255 ? c->tec : 255;
    const uint32_t esr = error_flags(c) | c->esr_lec << 4 | tec << 16 | c->rec << 24;
    const uint32_t tsr = (c->tsr & ~0x03000000u) | code << 24;
    const uint32_t values[] = {c->mcr, c->msr, tsr, c->rfr[0], c->rfr[1], c->ier, esr, c->btr};
    return values[offset / 4];
}

static uint32_t *filter_register(struct can *c, uint32_t offset)
{
    switch (offset) {
    case 0x200:
        return &c->fmr;
    case 0x204:
        return &c->fm1r;
    case 0x20C:
        return &c->fs1r;
    case 0x214:
        return &c->ffa1r;
    case 0x21C:
        return &c->fa1r;
    default:
        return offset >= 0x240 && offset < 0x240 + CAN_BANKS * 8
                   ? &c->filter[(offset - 0x240) / 8][offset / 4 & 1u]
                   : NULL;
    }
}

static bool access_filters(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    struct can *c = &b->can;
    uint32_t *word = filter_register(c, offset);
    if (word == NULL) {
        return false;
    }
    if (!write) {
        *value = *word;
    } else if ((c->fmr & FINIT) == 0 && word != &c->fmr && word != &c->fa1r) {
        warn_once(b, 0xF0000092u, "CAN1: a filter is written outside of its initialization: ignored");
    } else {
        *word = *value;
    }
    return true;
}

bool can_access(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    struct can *c = &b->can;
    bool known = true;
    if ((offset & 3u) != 0) {
        return false;
    }
    if (offset < 0x20 && write) {
        write_control(b, offset, *value);
    } else if (offset < 0x20) {
        *value = read_control(c, offset);
    } else if (offset >= 0x180 && offset < 0x1D0) {
        uint32_t box = (offset - 0x180) / 16;
        uint32_t word = offset / 4 & 3u;
        if (box < CAN_MAILBOXES && write) {
            write_mailbox(b, (int)box, word, *value);
        } else if (!write) {
            const struct can_box *from = box < CAN_MAILBOXES ? &c->tx[box] : &c->fifo[box - CAN_MAILBOXES][0];
            const uint32_t words[] = {from->ir, from->dtr, from->dlr, from->dhr};
            *value = words[word];
        }
    } else {
        known = access_filters(b, offset, write, value);
    }
    update_lines(b);
    return known;
}
