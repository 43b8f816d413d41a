/* A receiver of CAN, bit by bit: it counts quanta of its own clock, starts with the first edge, samples each
 * bit once, and follows later edges from recessive to dominant by its jump width at most (ISO 11898-1; bxCAN:
 * RM0090 section 32.7.7). An edge is noticed with the next quantum. Where the quanta lie at the first edge is
 * chance: both ends are tried, and both must do. */
#include "can_sampling.h"

#include <math.h>

#define SAME_CLOCK 1e-6 /* within it, edges stay within a quantum over any frame */

static double quantum_ps(const struct board_can_timing *t)
{
    return t->bit_ps / (t->before + t->after);
}

static double jump_ps(const struct board_can_timing *t, double error_ps)
{
    const double limit = t->jump * quantum_ps(t);
    return error_ps < limit ? error_ps : limit;
}

struct receiver {
    const struct can_pair *pair;
    const uint8_t *bits;
    uint32_t count;
    double begin_ps; /* of the present bit, by its own clock */
    uint8_t last;    /* sampled; 1 is recessive */
};

static uint8_t level(const struct receiver *r, double at_ps)
{
    const double place = floor((at_ps - r->pair->delay_ps) / r->pair->sender.bit_ps);
    return place < 0 || place >= r->count ? 1 : r->bits[(uint32_t)place];
}

/* When the first edge from recessive to dominant within that time is noticed; below 0: there is none. */
static double edge(const struct receiver *r, double after_ps, double until_ps)
{
    const double sent_ps = r->pair->sender.bit_ps;
    const double quantum = quantum_ps(&r->pair->receiver);
    /* From the bit before, since an edge is noticed a quantum late at most. */
    const double first = fmax(1.0, floor((after_ps - r->pair->delay_ps) / sent_ps));
    for (uint32_t k = (uint32_t)first; k < r->count; k++) {
        const double at_ps = k * sent_ps + r->pair->delay_ps;
        const double noticed = r->begin_ps + ceil((at_ps - r->begin_ps) / quantum - 1e-6) * quantum;
        if (noticed > until_ps) {
            return -1;
        }
        if (noticed > after_ps && r->bits[k] == 0 && r->bits[k - 1] == 1) {
            return noticed;
        }
    }
    return -1;
}

/* Samples the present bit and finds the beginning of the next. */
static uint8_t sample(struct receiver *r)
{
    const struct board_can_timing *own = &r->pair->receiver;
    const double to_sample = own->before * quantum_ps(own);
    double noticed = r->last == 1 ? edge(r, r->begin_ps, r->begin_ps + to_sample) : -1;
    if (noticed > 0) { /* late: the first segment is lengthened */
        r->begin_ps += jump_ps(own, noticed - r->begin_ps);
    }
    const double sampled_ps = r->begin_ps + to_sample;
    const double next_ps = r->begin_ps + own->bit_ps;
    r->last = level(r, sampled_ps);
    const bool followed = noticed > 0; /* one resynchronisation a bit */
    noticed = r->last == 1 && !followed ? edge(r, sampled_ps, next_ps - quantum_ps(own) / 2) : -1;
    r->begin_ps =
        next_ps - (noticed > 0 ? jump_ps(own, next_ps - noticed) : 0); /* early: the second shortened */
    return r->last;
}

/* The acknowledgment lasts one bit of the receiver. The sender follows its edge as it follows any other. */
static bool sees_acknowledgment(const struct can_pair *pair, uint32_t slot, double begin_ps)
{
    const struct board_can_timing *own = &pair->sender;
    const double arrives = begin_ps + pair->delay_ps;
    const double slot_ps = slot * own->bit_ps;
    const double late = ceil((arrives - slot_ps) / quantum_ps(own)) * quantum_ps(own);
    const double to_sample = own->before * quantum_ps(own);
    const double jumped = late > 0 && late <= to_sample ? jump_ps(own, late) : 0;
    const double sampled_ps = slot_ps + jumped + to_sample;
    return arrives <= sampled_ps && sampled_ps < arrives + pair->receiver.bit_ps;
}

static enum can_reading read_from(struct receiver *r)
{
    const uint32_t slot = r->count; /* the bits end before it */
    const bool same = fabs(r->pair->receiver.bit_ps / r->pair->sender.bit_ps - 1) < SAME_CLOCK;
    if (same) {
        r->begin_ps += slot * r->pair->sender.bit_ps;
    }
    for (uint32_t n = 0; n < slot && !same; n++) {
        if (sample(r) != r->bits[n]) {
            return CAN_MISREAD;
        }
    }
    return sees_acknowledgment(r->pair, slot, r->begin_ps) ? CAN_READ : CAN_ACK_TOO_LATE;
}

enum can_reading can_read(const struct can_pair *pair, const struct board_can_frame *frame)
{
    static const double chance[] = {0.0, 0.999}; /* of a quantum, by which the first edge is noticed late */
    uint8_t bits[BOARD_CAN_BITS_MAX];
    const uint32_t count = board_can_wire(frame, bits);
    enum can_reading worst = CAN_READ;
    for (int i = 0; i < 2 && worst == CAN_READ; i++) {
        struct receiver r = {pair, bits, count, pair->delay_ps + chance[i] * quantum_ps(&pair->receiver), 0};
        worst = read_from(&r);
    }
    return worst;
}
