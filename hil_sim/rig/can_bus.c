/* A CAN bus in virtual time: arbitration by id, real frame lengths, acknowledgment, damage.
 *
 * Boards run in slices that are shorter than the shortest frame. A frame that begins within a slice ends
 * after it, so that every outcome decided at the slice's end is still in each board's future. */
#include "can_bus.h"

#include "can_sampling.h"

#include <stdlib.h>
#include <string.h>

enum { BOARDS = 16, QUEUE = 1024, SLICE_US = 40, PAUSE_BITS = 3, ERROR_BITS = 17, HOST = -1 };
#define PS_PER_US 1000000ULL
#define PS_PER_NS 1e3
#define PS_PER_S  1e12
/* A sample point at seven eighths and a jump of one quantum, as adapters have it (CiA 601-3 and their
 * drivers). */
enum { HOST_BEFORE = 14, HOST_AFTER = 2, HOST_JUMP = 1 };
/* Two transceivers and some metres of cable at 5 ns each. */
#define DELAY_NS 150.0

struct queue {
    struct can_bus_frame frame[QUEUE];
    uint64_t since_ps[QUEUE];
    size_t first, count;
};

struct can_bus {
    struct rig *rig[BOARDS];
    size_t boards;
    uint64_t time_us, free_ps, damage;
    double delay_ps;
    struct board_can_timing host;
    bool shorted, host_connected;
    struct queue to_bus, to_host;
    struct can_bus_totals totals;
};

struct offer {
    struct board_can_frame frame;
    uint64_t since_ps;
    int node; /* index of a board, or HOST */
    struct board_can_timing timing;
};

struct can_bus *can_bus_create(double bit_rate)
{
    struct can_bus *bus = calloc(1, sizeof *bus);
    if (bus != NULL) {
        bus->host = (struct board_can_timing){.before = HOST_BEFORE, .after = HOST_AFTER, .jump = HOST_JUMP};
        bus->delay_ps = DELAY_NS * PS_PER_NS;
        bus->host_connected = true;
        can_bus_bit_rate(bus, bit_rate);
    }
    return bus;
}

void can_bus_destroy(struct can_bus *bus)
{
    if (bus != NULL) {
        for (size_t i = 0; i < bus->boards; i++) {
            board_can_attach(rig_board(bus->rig[i]), false);
        }
        free(bus);
    }
}

void can_bus_bit_rate(struct can_bus *bus, double bit_rate)
{
    bus->host.bit_ps = PS_PER_S / bit_rate;
}

void can_bus_bit_timing(struct can_bus *bus, uint32_t before, uint32_t after, uint32_t jump)
{
    bus->host.before = before;
    bus->host.after = after;
    bus->host.jump = jump;
}

void can_bus_delay(struct can_bus *bus, double delay_ns)
{
    bus->delay_ps = delay_ns * PS_PER_NS;
}

bool can_bus_attach(struct can_bus *bus, struct rig *rig)
{
    if (bus->boards == 0) {
        bus->time_us = rig_time_us(rig);
    }
    if (bus->boards == BOARDS || rig_time_us(rig) != bus->time_us) {
        return false;
    }
    bus->rig[bus->boards++] = rig;
    board_can_attach(rig_board(rig), true);
    return true;
}

void can_bus_detach(struct can_bus *bus, struct rig *rig)
{
    for (size_t i = 0; i < bus->boards; i++) {
        if (bus->rig[i] == rig) {
            board_can_attach(rig_board(rig), false);
            for (bus->boards--; i < bus->boards; i++) {
                bus->rig[i] = bus->rig[i + 1];
            }
            return;
        }
    }
}

static struct board_can_frame as_sent(const struct can_bus_frame *f)
{
    struct board_can_frame frame = {
        .id = f->id, .extended = f->extended != 0, .remote = f->remote != 0, .length = f->length};
    memcpy(frame.data, f->data, sizeof frame.data);
    return frame;
}

/* The bits of the arbitration field as they come, as one number; the smaller wins. */
static uint64_t urgency(const struct board_can_frame *f)
{
    if (!f->extended) {
        return (uint64_t)f->id << 21 | (uint64_t)f->remote << 20;
    }
    return (uint64_t)(f->id >> 18) << 21 | 3ULL << 19 | (uint64_t)(f->id & 0x3FFFFu) << 1 | f->remote;
}

static size_t collect(const struct can_bus *bus, struct offer out[BOARDS + 1])
{
    size_t count = 0;
    for (size_t i = 0; i < bus->boards; i++) {
        const struct board *board = rig_board(bus->rig[i]);
        bool acknowledges;
        if (board_can_offer(board, &out[count].frame, &out[count].since_ps)) {
            out[count].node = (int)i;
            board_can_timing(board, &out[count].timing, &acknowledges);
            count++;
        }
    }
    if (bus->to_bus.count > 0 && bus->host_connected) {
        out[count].frame = as_sent(&bus->to_bus.frame[bus->to_bus.first]);
        out[count].since_ps = bus->to_bus.since_ps[bus->to_bus.first];
        out[count].node = HOST;
        out[count].timing = bus->host;
        count++;
    }
    return count;
}

/* What becomes of a frame at its other nodes. */
struct reception {
    bool acknowledged, destroyed;
};

static void receive(const struct can_bus *bus, const struct offer *sent,
                    const struct board_can_timing *receiver, struct reception *out)
{
    const struct can_pair pair = {sent->timing, *receiver, bus->delay_ps};
    const enum can_reading reading = can_read(&pair, &sent->frame);
    out->acknowledged = out->acknowledged || reading == CAN_READ;
    out->destroyed = out->destroyed || reading == CAN_MISREAD;
}

static struct reception ask_others(const struct can_bus *bus, const struct offer *sent)
{
    struct reception found = {false, false};
    if (sent->node != HOST && bus->host_connected) {
        receive(bus, sent, &bus->host, &found);
    }
    for (size_t i = 0; i < bus->boards; i++) {
        bool acknowledges;
        struct board_can_timing timing;
        board_can_timing(rig_board(bus->rig[i]), &timing, &acknowledges);
        if ((int)i != sent->node && acknowledges) {
            receive(bus, sent, &timing, &found);
        }
    }
    return found;
}

static void hear_host(struct can_bus *bus, const struct board_can_frame *f, uint64_t end_ps)
{
    struct queue *q = &bus->to_host;
    if (q->count == QUEUE) { /* the oldest is lost, as in an adapter that is not read */
        q->first = (q->first + 1) % QUEUE;
        q->count--;
    }
    size_t at = (q->first + q->count++) % QUEUE;
    q->frame[at] = (struct can_bus_frame){.time_us = end_ps / PS_PER_US,
                                          .id = f->id,
                                          .extended = f->extended,
                                          .remote = f->remote,
                                          .length = f->length};
    memcpy(q->frame[at].data, f->data, sizeof f->data);
    q->since_ps[at] = end_ps;
}

static void tell_everybody(struct can_bus *bus, const struct offer *sent, enum board_can_outcome outcome,
                           uint64_t end_ps)
{
    bool heard = !bus->shorted && outcome != BOARD_CAN_UNACKNOWLEDGED;
    for (size_t i = 0; i < bus->boards; i++) {
        struct board *board = rig_board(bus->rig[i]);
        bool acknowledges;
        struct board_can_timing timing;
        if ((int)i == sent->node) {
            board_can_conclude(board, outcome, end_ps);
        } else if (heard && board_can_timing(board, &timing, &acknowledges)) {
            board_can_deliver(board, &sent->frame, outcome == BOARD_CAN_DAMAGED, end_ps);
        }
    }
    if (outcome != BOARD_CAN_SENT) {
        return;
    }
    if (sent->node == HOST) {
        bus->to_bus.first = (bus->to_bus.first + 1) % QUEUE;
        bus->to_bus.count--;
    } else if (bus->host_connected) {
        hear_host(bus, &sent->frame, end_ps);
    }
}

static void put_on_wire(struct can_bus *bus, const struct offer *sent, uint64_t start_ps)
{
    const double bit_ps = sent->timing.bit_ps;
    const struct reception found = ask_others(bus, sent);
    uint32_t bits = board_can_bits(&sent->frame);
    enum board_can_outcome outcome = BOARD_CAN_SENT;
    if (bus->shorted) {
        outcome = BOARD_CAN_DAMAGED;
        bits = 1 + ERROR_BITS; /* the first dominant bit already reads back wrong */
    } else if (found.destroyed || bus->damage > 0) {
        outcome = BOARD_CAN_DAMAGED;
        bits += ERROR_BITS;
        bus->damage -= bus->damage > 0 ? 1 : 0;
    } else if (!found.acknowledged) {
        outcome = BOARD_CAN_UNACKNOWLEDGED;
        bits += ERROR_BITS;
    }
    uint64_t end_ps = start_ps + (uint64_t)(bits * bit_ps);
    uint64_t now_ps = bus->time_us * PS_PER_US;
    bus->free_ps = end_ps + (uint64_t)(PAUSE_BITS * bit_ps);
    bus->totals.frames += outcome == BOARD_CAN_SENT ? 1 : 0;
    bus->totals.bits += bits + PAUSE_BITS;
    bus->totals.damaged += outcome == BOARD_CAN_DAMAGED ? 1 : 0;
    bus->totals.unacknowledged += outcome == BOARD_CAN_UNACKNOWLEDGED ? 1 : 0;
    tell_everybody(bus, sent, outcome, end_ps > now_ps ? end_ps : now_ps);
}

/* Settles all frames that began before the present time. */
static void settle(struct can_bus *bus)
{
    uint64_t now_ps = bus->time_us * PS_PER_US;
    for (;;) {
        struct offer offers[BOARDS + 1];
        size_t count = collect(bus, offers);
        uint64_t start = UINT64_MAX;
        for (size_t i = 0; i < count; i++) {
            start = offers[i].since_ps < start ? offers[i].since_ps : start;
        }
        start = start > bus->free_ps ? start : bus->free_ps;
        if (count == 0 || start >= now_ps) {
            return;
        }
        const struct offer *winner = NULL;
        for (size_t i = 0; i < count; i++) {
            if (offers[i].since_ps <= start &&
                (winner == NULL || urgency(&offers[i].frame) < urgency(&winner->frame))) {
                winner = &offers[i];
            }
        }
        if (winner == NULL) {
            return;
        }
        put_on_wire(bus, winner, start);
    }
}

void can_bus_run_us(struct can_bus *bus, uint64_t span_us)
{
    uint64_t until = bus->time_us + span_us;
    while (bus->time_us < until) {
        uint64_t slice = until - bus->time_us < SLICE_US ? until - bus->time_us : SLICE_US;
        for (size_t i = 0; i < bus->boards; i++) {
            rig_run_us(bus->rig[i], slice);
        }
        bus->time_us += slice;
        settle(bus);
    }
}

bool can_bus_write(struct can_bus *bus, const struct can_bus_frame *frame)
{
    struct queue *q = &bus->to_bus;
    if (q->count == QUEUE || frame->length > 8) {
        return false;
    }
    size_t at = (q->first + q->count++) % QUEUE;
    q->frame[at] = *frame;
    q->since_ps[at] = bus->time_us * PS_PER_US;
    return true;
}

bool can_bus_read(struct can_bus *bus, struct can_bus_frame *out)
{
    struct queue *q = &bus->to_host;
    if (q->count == 0 || q->since_ps[q->first] > bus->time_us * PS_PER_US) {
        return false; /* none, or still on the wire */
    }
    *out = q->frame[q->first];
    q->first = (q->first + 1) % QUEUE;
    q->count--;
    return true;
}

void can_bus_connect_host(struct can_bus *bus, bool connected)
{
    bus->host_connected = connected;
}

void can_bus_short(struct can_bus *bus, bool shorted)
{
    bus->shorted = shorted;
}

void can_bus_damage(struct can_bus *bus, uint64_t frames)
{
    bus->damage = frames;
}

void can_bus_totals(const struct can_bus *bus, struct can_bus_totals *out)
{
    *out = bus->totals;
}
