/* ADC1 to ADC3: regular conversions with their times, RM0090 section 13. */
#include "machine.h"

enum { EOC = 1 << 1, STRT = 1 << 4, OVR = 1 << 5 };
enum { EOCIE = 1 << 5, SCAN = 1 << 8, ADON = 1 << 0, CONT = 1 << 1, EOCS = 1 << 10, ALIGN = 1 << 11 };
#define SWSTART      (1u << 30)
#define REFERENCE_V  3.3
#define CHANNEL_REF  17
#define CHANNEL_TEMP 16

/* Pins of channels 0 to 15 of ADC1 and ADC2, STM32F405 datasheet table 7. */
static const struct board_pin pins[16] = {{'A', 0}, {'A', 1}, {'A', 2}, {'A', 3}, {'A', 4}, {'A', 5},
                                          {'A', 6}, {'A', 7}, {'B', 0}, {'B', 1}, {'C', 0}, {'C', 1},
                                          {'C', 2}, {'C', 3}, {'C', 4}, {'C', 5}};

static uint32_t channel(const struct adc *a)
{
    uint32_t rank = a->rank;
    return a->sqr[2 - rank / 6] >> (5 * (rank % 6)) & 0x1Fu;
}

static uint32_t length(const struct adc *a)
{
    return (a->cr1 & SCAN) != 0 ? (a->sqr[0] >> 20 & 0xFu) + 1 : 1;
}

/* CPU cycles from start to end: sampling plus one cycle of the ADC's clock for each bit. */
static uint64_t conversion_cycles(const struct board *b, const struct adc *a)
{
    static const uint16_t sampling[] = {3, 15, 28, 56, 84, 112, 144, 480};
    uint32_t c = channel(a);
    uint32_t choice = c < 10 ? a->smpr[1] >> (3 * c) & 7u : a->smpr[0] >> (3 * (c - 10)) & 7u;
    uint32_t bits = 12 - 2 * (a->cr1 >> 24 & 3u);
    uint32_t prescaler = 2 * ((b->adc_ccr >> 16 & 3u) + 1);
    return (uint64_t)(sampling[choice] + bits) * prescaler * b->rcc.ppre2;
}

static double voltage(struct board *b, uint32_t c)
{
    if (c == CHANNEL_REF) {
        return (b->adc_ccr & 1u << 23) != 0 ? 1.21 : 0; /* VREFINT, datasheet table 74 */
    }
    if (c == CHANNEL_TEMP) {
        return (b->adc_ccr & 1u << 23) != 0 ? 0.76 : 0; /* 25 degrees, datasheet table 72 */
    }
    if (c > 15 || b->options.wires.pin_voltage == NULL) {
        return 0;
    }
    struct board_pin pin = pins[c];
    if ((b->gpio[pin.port - 'A'].moder >> (2 * pin.number) & 3u) != 3) {
        warn_once(b, 0xF0000090u + c, "ADC converts channel %u, but P%c%u is not in analogue mode",
                  (unsigned)c, pin.port, (unsigned)pin.number);
    }
    encoder_lines_follow(b);
    return b->options.wires.pin_voltage(b->options.wires.context, pin, time_to_ps(b, b->moment));
}

static uint32_t convert(struct board *b, const struct adc *a)
{
    uint32_t bits = 12 - 2 * (a->cr1 >> 24 & 3u);
    double steps = voltage(b, channel(a)) / REFERENCE_V * (double)(1u << bits);
    double top = (double)((1u << bits) - 1);
    uint32_t code = (uint32_t)(steps < 0 ? 0 : steps > top ? top : steps);
    return (a->cr2 & ALIGN) != 0 ? code << (16 - bits) : code;
}

static void update_line(struct board *b)
{
    bool on = false;
    for (int i = 1; i <= ADCS; i++) {
        const struct adc *a = &b->adc[i];
        on = on || ((a->sr & EOC) != 0 && (a->cr1 & EOCIE) != 0) ||
             ((a->sr & OVR) != 0 && (a->cr1 & 1u << 26) != 0);
    }
    nvic_set_line(b, IRQ_ADC, on);
}

static void start(struct board *b, int adc)
{
    struct adc *a = &b->adc[adc];
    a->busy = true;
    a->sr |= STRT;
    if (b->adc_dead) {
        return;
    }
    event_at_cycle(b, EVENT_ADC0 + (unsigned)adc - 1, b->moment + conversion_cycles(b, a));
}

void adc_event(struct board *b, int adc)
{
    struct adc *a = &b->adc[adc];
    if (b->adc_dead) {
        return;
    }
    a->busy = false;
    bool watched = (a->cr2 & EOCS) != 0;
    if (watched && (a->sr & EOC) != 0) {
        a->sr |= OVR; /* the last result was not read: conversions stop (RM0090 13.8.2) */
        update_line(b);
        return;
    }
    a->dr = convert(b, a);
    trace_add(b, TRACE_ADC, (uint32_t)adc << 8 | channel(a), a->dr);
    a->rank++;
    bool last = a->rank >= length(a);
    a->rank = last ? 0 : a->rank;
    if (last || watched) {
        a->sr |= EOC;
    }
    if (!last || (a->cr2 & CONT) != 0) {
        start(b, adc);
    }
    update_line(b);
}

/* A conversion that was under way at the failure takes its full time after the repair. */
void adc_set_dead(struct board *b, bool dead)
{
    const bool revives = b->adc_dead && !dead;
    b->adc_dead = dead;
    for (int i = 1; i <= ADCS && revives; i++) {
        if (b->adc[i].busy) {
            start(b, i);
        }
    }
}

void adc_reset(struct board *b)
{
    for (int i = 1; i <= ADCS; i++) {
        b->adc[i] = (struct adc){.htr = 0xFFF};
        event_cancel(b, EVENT_ADC0 + (unsigned)i - 1);
    }
    b->adc_ccr = 0;
    update_line(b);
}

static void write_cr2(struct board *b, int adc, uint32_t value)
{
    struct adc *a = &b->adc[adc];
    bool was_on = (a->cr2 & ADON) != 0;
    a->cr2 = value & ~SWSTART;
    if ((value & (3u << 28 | 3u << 20 | 1u << 22 | 1u << 8)) != 0) {
        warn_once(b, 0xF00000B0u, "ADC triggers, injected conversions and DMA are not modelled");
    }
    if ((value & ADON) == 0) {
        a->busy = false;
        a->rank = 0;
        event_cancel(b, EVENT_ADC0 + (unsigned)adc - 1);
    } else if ((value & SWSTART) != 0 && was_on && !a->busy) {
        a->rank = 0;
        start(b, adc);
    }
}

static bool access_common(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    if (offset == 0x300) {
        *value = b->adc[1].sr | b->adc[2].sr << 8 | b->adc[3].sr << 16;
        return true;
    }
    if (offset == 0x304) {
        b->adc_ccr = write ? *value : b->adc_ccr;
        *value = b->adc_ccr;
        return true;
    }
    return false;
}

bool adc_access(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    if (offset >= 0x300) {
        return access_common(b, offset, write, value);
    }
    const int adc = (int)(offset >> 8) + 1;
    struct adc *a = &b->adc[adc];
    struct {
        uint32_t offset, *store;
    } map[] = {{0x04, &a->cr1},    {0x0C, &a->smpr[0]}, {0x10, &a->smpr[1]}, {0x24, &a->htr}, {0x28, &a->ltr},
               {0x2C, &a->sqr[0]}, {0x30, &a->sqr[1]},  {0x34, &a->sqr[2]},  {0x38, &a->jsqr}};
    const uint32_t reg = offset & 0xFFu;
    switch (reg) {
    case 0x00:
        if (write) {
            a->sr &= *value;
            update_line(b);
        }
        *value = a->sr;
        return true;
    case 0x08:
        if (write) {
            write_cr2(b, adc, *value);
        }
        *value = a->cr2;
        return true;
    case 0x4C:
        *value = a->dr;
        a->sr &= write ? ~0u : ~(uint32_t)EOC;
        update_line(b);
        return true;
    default:
        break;
    }
    for (size_t i = 0; i < sizeof map / sizeof map[0]; i++) {
        if (map[i].offset == reg) {
            *map[i].store = write ? *value : *map[i].store;
            *value = *map[i].store;
            update_line(b);
            return true;
        }
    }
    return false;
}
