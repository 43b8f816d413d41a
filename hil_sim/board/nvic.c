/* The nested vectored interrupt controller: which exception is pending, active and enabled, and its
 * priority. */
#include "machine.h"

enum { THREAD_PRIORITY = 256, PRIORITY_MASK = 0xF0 /* four bits are implemented, RM0090 12.1 */ };

bool nvic_bit(const uint32_t map[4], unsigned exception)
{
    return (map[exception / 32] >> (exception % 32) & 1u) != 0;
}

static void set_bit(uint32_t map[4], unsigned exception, bool on)
{
    uint32_t mask = 1u << (exception % 32);
    map[exception / 32] = on ? map[exception / 32] | mask : map[exception / 32] & ~mask;
}

/* Smaller is more urgent; reset, NMI and hard fault precede all priorities that can be set. */
static int full_priority(const struct board *b, unsigned exception)
{
    if (exception <= EXC_HARD_FAULT) {
        return (int)exception - 4;
    }
    return exception < BOARD_EXCEPTIONS ? b->nvic.priority[exception] : THREAD_PRIORITY;
}

/* The part that decides on pre-emption (PRIGROUP, PM0214 2.3.6). */
static int group_of(const struct board *b, int priority)
{
    return priority < 0 || priority == THREAD_PRIORITY ? priority
                                                       : priority & ~((2 << b->nvic.prigroup) - 1) & 0xFF;
}

int nvic_group(const struct board *b, unsigned exception)
{
    return group_of(b, full_priority(b, exception));
}

/* Finds the most urgent candidate; the lowest number wins among equals. */
void nvic_refresh(struct board *b)
{
    struct nvic *n = &b->nvic;
    n->best = 0;
    int best = THREAD_PRIORITY;
    for (unsigned word = 0; word < 4; word++) {
        for (uint32_t left = n->pending[word] & n->enabled[word] & ~n->active[word]; left != 0;
             left &= left - 1) {
            unsigned exception = word * 32 + (unsigned)__builtin_ctz(left);
            int priority = full_priority(b, exception);
            if (priority < best) {
                best = priority;
                n->best = exception;
            }
        }
    }
    n->best_priority = group_of(b, best);
    if (n->best != 0 && n->best_priority < n->active_group) {
        b->needs_check = true;
    }
    cpu_update_break(b);
}

static void refresh_active(struct board *b)
{
    struct nvic *n = &b->nvic;
    n->active_group = THREAD_PRIORITY;
    for (unsigned word = 0; word < 4; word++) {
        for (uint32_t left = n->active[word]; left != 0; left &= left - 1) {
            int group = nvic_group(b, word * 32 + (unsigned)__builtin_ctz(left));
            n->active_group = group < n->active_group ? group : n->active_group;
        }
    }
}

static bool is_asked_for(const struct board *b, unsigned exception)
{
    return nvic_bit(b->nvic.line, exception) || nvic_bit(b->stuck, exception);
}

void nvic_pend(struct board *b, unsigned exception, bool pending)
{
    set_bit(b->nvic.pending, exception, pending);
    nvic_refresh(b);
}

void nvic_set_active(struct board *b, unsigned exception, bool active)
{
    set_bit(b->nvic.active, exception, active);
    if (!active && is_asked_for(b, exception)) {
        set_bit(b->nvic.pending, exception, true); /* the peripheral still requests it */
    }
    refresh_active(b);
    nvic_refresh(b);
}

/* A peripheral's request line: a rising edge pends it; while it stays high, so does the request. */
void nvic_set_line(struct board *b, unsigned irq, bool high)
{
    unsigned exception = EXC_IRQ0 + irq;
    if (nvic_bit(b->nvic.line, exception) == high) {
        return;
    }
    set_bit(b->nvic.line, exception, high);
    if (high) {
        nvic_pend(b, exception, true);
    }
}

void nvic_set_stuck(struct board *b, unsigned irq, bool stuck)
{
    unsigned exception = EXC_IRQ0 + irq;
    set_bit(b->stuck, exception, stuck);
    if (stuck) {
        nvic_pend(b, exception, true);
    }
}

/* The execution priority: that of the running code, raised by the mask registers (PM0214 2.1.3). A sleeping
 * CPU leaves PRIMASK out: it holds the handler back, not the wake-up (PM0214 2.5.3). */
int nvic_execution_priority(struct board *b)
{
    const struct core *core = &b->core;
    const bool live = core->in_engine;
    const uint32_t primask = live ? cpu_get(b, UC_ARM_REG_PRIMASK) : core->primask;
    const uint32_t faultmask = live ? cpu_get(b, UC_ARM_REG_FAULTMASK) : core->faultmask;
    int priority = b->nvic.active_group;
    int basepri = (int)(live ? cpu_get(b, UC_ARM_REG_BASEPRI) : core->basepri) & PRIORITY_MASK;
    if (basepri != 0 && group_of(b, basepri) < priority) {
        priority = group_of(b, basepri);
    }
    if ((primask & 1u) != 0 && priority > 0 && !b->sleeping) {
        priority = 0;
    }
    if ((faultmask & 1u) != 0 && priority > -1) {
        priority = -1;
    }
    return priority;
}

/* Bits of 32 interrupts from interrupt 32 * word on, out of maps that begin with the 16 CPU exceptions. */
static uint32_t window(const uint32_t map[4], uint32_t word)
{
    uint32_t low = map[word] >> EXC_IRQ0;
    return word < 3 ? low | map[word + 1] << (32 - EXC_IRQ0) : low;
}

static void change(struct board *b, uint32_t map[4], uint32_t word, uint32_t bits, bool on)
{
    for (; bits != 0; bits &= bits - 1) {
        unsigned exception = EXC_IRQ0 + word * 32 + (unsigned)__builtin_ctz(bits);
        if (exception < BOARD_EXCEPTIONS) {
            /* A request that its peripheral still makes cannot be cleared here. */
            bool holds = map == b->nvic.pending && !on && is_asked_for(b, exception);
            set_bit(map, exception, on || holds);
        }
    }
    nvic_refresh(b);
}

/* Registers from 0xE000E100 on, PM0214 4.3. */
bool nvic_access(struct board *b, uint32_t offset, bool write, uint32_t *value, unsigned size)
{
    uint32_t word = (offset & 0x7Fu) / 4;
    if (offset >= 0x300u && offset < 0x300u + 240u) { /* IPR */
        for (unsigned i = 0; i < size; i++) {
            unsigned exception = EXC_IRQ0 + offset - 0x300u + i;
            if (exception >= BOARD_EXCEPTIONS) {
                break;
            }
            if (write) {
                b->nvic.priority[exception] = (uint8_t)(*value >> (8 * i)) & PRIORITY_MASK;
            } else {
                *value |= (uint32_t)b->nvic.priority[exception] << (8 * i);
            }
        }
        if (write) {
            nvic_refresh(b);
        }
        return true;
    }
    if (offset >= 0x280u) {
        return false;
    }
    if (word > 2) {
        return true; /* interrupts beyond the chip's last read as zero */
    }
    uint32_t *map = offset < 0x100u ? b->nvic.enabled : offset < 0x200u ? b->nvic.pending : b->nvic.active;
    if (offset >= 0x200u && write) {
        return true; /* IABR is read-only */
    }
    if (write) {
        change(b, map, word, *value, (offset & 0x80u) == 0);
    } else {
        *value = window(map, word);
    }
    return true;
}
