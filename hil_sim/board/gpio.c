/* GPIO ports and pins: levels, alternate functions, and the callbacks to the wires. */
#include "machine.h"

#include <string.h>

enum { MODE_INPUT, MODE_OUTPUT, MODE_ALTERNATE, MODE_ANALOG };

/* Alternate functions modelled, STM32F405 datasheet table 9: {port, pin, function, signal, instance,
 * channel}. */
enum signal { SIGNAL_TIMER, SIGNAL_BREAK, SIGNAL_USART_TX, SIGNAL_USART_RX, SIGNAL_CAN_RX, SIGNAL_CAN_TX };
static const struct route {
    char port;
    uint8_t pin, function, signal, instance, channel;
} routes[] = {
    {'A', 8, 1, SIGNAL_TIMER, 1, 1},     {'A', 9, 1, SIGNAL_TIMER, 1, 2},
    {'A', 10, 1, SIGNAL_TIMER, 1, 3},    {'A', 11, 1, SIGNAL_TIMER, 1, 4},
    {'E', 9, 1, SIGNAL_TIMER, 1, 1},     {'E', 11, 1, SIGNAL_TIMER, 1, 2},
    {'E', 13, 1, SIGNAL_TIMER, 1, 3},    {'E', 14, 1, SIGNAL_TIMER, 1, 4},
    {'A', 0, 1, SIGNAL_TIMER, 2, 1},     {'A', 5, 1, SIGNAL_TIMER, 2, 1},
    {'A', 15, 1, SIGNAL_TIMER, 2, 1},    {'A', 1, 1, SIGNAL_TIMER, 2, 2},
    {'B', 3, 1, SIGNAL_TIMER, 2, 2},     {'A', 6, 2, SIGNAL_TIMER, 3, 1},
    {'B', 4, 2, SIGNAL_TIMER, 3, 1},     {'C', 6, 2, SIGNAL_TIMER, 3, 1},
    {'A', 7, 2, SIGNAL_TIMER, 3, 2},     {'B', 5, 2, SIGNAL_TIMER, 3, 2},
    {'C', 7, 2, SIGNAL_TIMER, 3, 2},     {'B', 0, 2, SIGNAL_TIMER, 3, 3},
    {'B', 1, 2, SIGNAL_TIMER, 3, 4},     {'B', 6, 2, SIGNAL_TIMER, 4, 1},
    {'D', 12, 2, SIGNAL_TIMER, 4, 1},    {'B', 7, 2, SIGNAL_TIMER, 4, 2},
    {'D', 13, 2, SIGNAL_TIMER, 4, 2},    {'A', 0, 2, SIGNAL_TIMER, 5, 1},
    {'A', 1, 2, SIGNAL_TIMER, 5, 2},     {'C', 6, 3, SIGNAL_TIMER, 8, 1},
    {'C', 7, 3, SIGNAL_TIMER, 8, 2},     {'C', 8, 3, SIGNAL_TIMER, 8, 3},
    {'C', 9, 3, SIGNAL_TIMER, 8, 4},     {'A', 9, 7, SIGNAL_USART_TX, 1, 0},
    {'A', 10, 7, SIGNAL_USART_RX, 1, 0}, {'B', 6, 7, SIGNAL_USART_TX, 1, 0},
    {'B', 7, 7, SIGNAL_USART_RX, 1, 0},  {'A', 2, 7, SIGNAL_USART_TX, 2, 0},
    {'A', 3, 7, SIGNAL_USART_RX, 2, 0},  {'D', 5, 7, SIGNAL_USART_TX, 2, 0},
    {'D', 6, 7, SIGNAL_USART_RX, 2, 0},  {'B', 10, 7, SIGNAL_USART_TX, 3, 0},
    {'B', 11, 7, SIGNAL_USART_RX, 3, 0}, {'C', 10, 7, SIGNAL_USART_TX, 3, 0},
    {'C', 11, 7, SIGNAL_USART_RX, 3, 0}, {'D', 8, 7, SIGNAL_USART_TX, 3, 0},
    {'D', 9, 7, SIGNAL_USART_RX, 3, 0},  {'A', 11, 9, SIGNAL_CAN_RX, 1, 0},
    {'A', 12, 9, SIGNAL_CAN_TX, 1, 0},   {'B', 8, 9, SIGNAL_CAN_RX, 1, 0},
    {'B', 9, 9, SIGNAL_CAN_TX, 1, 0},    {'D', 0, 9, SIGNAL_CAN_RX, 1, 0},
    {'D', 1, 9, SIGNAL_CAN_TX, 1, 0},    {'A', 6, 1, SIGNAL_BREAK, 1, 0},
    {'B', 12, 1, SIGNAL_BREAK, 1, 0},    {'E', 15, 1, SIGNAL_BREAK, 1, 0},
    {'A', 6, 3, SIGNAL_BREAK, 8, 0},
};
enum { ROUTES = sizeof routes / sizeof routes[0] };

static uint32_t mode_of(const struct board *b, struct board_pin pin)
{
    return b->gpio[pin.port - 'A'].moder >> (2 * pin.number) & 3u;
}

static uint32_t function_of(const struct board *b, struct board_pin pin)
{
    return b->gpio[pin.port - 'A'].afr[pin.number / 8] >> (4 * (pin.number % 8)) & 0xFu;
}

static bool routed(const struct board *b, const struct route *r)
{
    struct board_pin pin = {r->port, r->pin};
    return mode_of(b, pin) == MODE_ALTERNATE && function_of(b, pin) == r->function;
}

bool pin_of_timer(const struct board *b, int timer, int channel, struct board_pin *out)
{
    for (size_t i = 0; i < ROUTES; i++) {
        const struct route *r = &routes[i];
        if (r->signal == SIGNAL_TIMER && r->instance == timer && r->channel == channel && routed(b, r)) {
            *out = (struct board_pin){r->port, r->pin};
            return true;
        }
    }
    return false;
}

static void find_timer_output(struct board *b, struct watched *w)
{
    w->timer = 0;
    for (size_t i = 0; i < ROUTES; i++) {
        const struct route *r = &routes[i];
        if (r->port == w->pin.port && r->pin == w->pin.number && r->signal == SIGNAL_TIMER && routed(b, r)) {
            w->timer = r->instance;
            w->channel = r->channel;
            return;
        }
    }
}

static void find_break_pin(struct board *b, int timer)
{
    b->break_pin[timer] = (struct board_pin){0};
    for (size_t i = 0; i < ROUTES; i++) {
        const struct route *r = &routes[i];
        if (r->signal == SIGNAL_BREAK && r->instance == timer && routed(b, r)) {
            b->break_pin[timer] = (struct board_pin){r->port, r->pin};
            return;
        }
    }
}

/* Modes and alternate functions of pins have changed. */
static void find_routes(struct board *b)
{
    for (size_t i = 0; i < b->watched_count; i++) {
        find_timer_output(b, &b->watched[i]);
    }
    find_break_pin(b, 1);
    find_break_pin(b, 8);
    memset(b->usart_routed, 0, sizeof b->usart_routed);
    memset(b->can_routed, 0, sizeof b->can_routed);
    for (size_t i = 0; i < ROUTES; i++) {
        const struct route *r = &routes[i];
        if (r->signal == SIGNAL_TIMER || r->signal == SIGNAL_BREAK || !routed(b, r)) {
            continue;
        }
        if (r->signal >= SIGNAL_CAN_RX) {
            b->can_routed[r->signal == SIGNAL_CAN_TX] = true;
        } else {
            b->usart_routed[r->signal == SIGNAL_USART_TX][r->instance] = true;
        }
    }
}

/* Fraction of time for which the chip holds the pin high; below 0: it does not drive it. */
static double drive(struct board *b, const struct watched *w)
{
    if (!b->powered) {
        return -1;
    }
    if (mode_of(b, w->pin) == MODE_OUTPUT) {
        return (b->gpio[w->pin.port - 'A'].odr >> w->pin.number & 1u) != 0 ? 1 : 0;
    }
    return w->timer != 0 ? timer_output(b, w->timer, w->channel) : -1;
}

void pins_update(struct board *b)
{
    for (size_t i = 0; i < b->watched_count; i++) {
        struct watched *w = &b->watched[i];
        double duty = drive(b, w);
        if (duty < w->duty || duty > w->duty) {
            w->duty = duty;
            uint64_t bits;
            memcpy(&bits, &duty, sizeof bits);
            trace_add(b, TRACE_PIN, (uint32_t)w->pin.port << 8 | w->pin.number, bits);
            if (b->options.wires.pin_driven != NULL) {
                encoder_lines_follow(b);
                b->options.wires.pin_driven(b->options.wires.context, w->pin, duty, time_to_ps(b, b->moment));
            }
        }
    }
}

/* Level of an encoder's phase: the four states of a quadrature period are 00, 10, 11, 01 (A, B). */
bool phase_level(int64_t position, bool is_b)
{
    uint64_t state = (uint64_t)position & 3u;
    return is_b ? state >= 2 : state == 1 || state == 2;
}

/* Level of a pin that no encoder is wired to. */
static bool steady_level(const struct board *b, int port, uint32_t pin)
{
    const struct gpio *g = &b->gpio[port];
    uint32_t mode = g->moder >> (2 * pin) & 3u;
    uint32_t pull = g->pupdr >> (2 * pin) & 3u;
    if (mode == MODE_OUTPUT) {
        return (g->odr >> pin & 1u) != 0;
    }
    if (mode != MODE_ANALOG && b->pin_in[port][pin] != BOARD_OPEN) {
        return b->pin_in[port][pin] == BOARD_HIGH;
    }
    return pull == 1 && mode != MODE_ANALOG;
}

static uint32_t input(struct board *b, int port)
{
    uint32_t levels = 0;
    for (uint32_t i = 0; i < 16; i++) {
        levels |= (uint32_t)steady_level(b, port, i) << i;
    }
    for (int e = 0; e < ENCODERS; e++) {
        const struct wired_encoder *w = &b->encoder[e];
        if (!w->wired || (w->a.port != 'A' + port && w->b.port != 'A' + port)) {
            continue;
        }
        encoder_lines_follow(b);
        const uint8_t encoder = encoder_levels(b, e);
        for (int phase = 0; phase < 2; phase++) {
            struct board_pin pin = phase == 0 ? w->a : w->b;
            if (pin.port == 'A' + port && mode_of(b, pin) != MODE_OUTPUT) {
                uint32_t mask = 1u << pin.number;
                levels = (encoder >> phase & 1u) != 0 ? levels | mask : levels & ~mask;
            }
        }
    }
    return levels;
}

/* Level at the break input of TIM1 or TIM8: that of the pin that is routed to it, low without one. */
bool break_level(struct board *b, int timer)
{
    const struct board_pin pin = b->break_pin[timer];
    return pin.port != 0 && steady_level(b, pin.port - 'A', pin.number);
}

void board_set_pin(struct board *board, struct board_pin pin, enum board_level level)
{
    if (board->moment < board->now) {
        board->moment = board->now;
    }
    board->pin_in[pin.port - 'A'][pin.number] = (uint8_t)level;
    timer_break_update(board, 1);
    timer_break_update(board, 8);
    pins_update(board);
}

void gpio_reset(struct board *b, int port)
{
    static const struct gpio initial[2] = {{.moder = 0xA8000000u, .pupdr = 0x64000000u},
                                           {.moder = 0x00000280u, .pupdr = 0x00000100u, .ospeedr = 0xC0u}};
    b->gpio[port] = port < 2 ? initial[port] : (struct gpio){0};
    find_routes(b);
}

bool gpio_access(struct board *b, int port, uint32_t offset, bool write, uint32_t *value)
{
    struct gpio *g = &b->gpio[port];
    uint32_t *const store[] = {&g->moder, &g->otyper, &g->ospeedr, &g->pupdr, NULL,
                               &g->odr,   NULL,       &g->lckr,    g->afr,    g->afr + 1};
    if (offset == 0x10) {
        *value = write ? *value : input(b, port);
        return true;
    }
    if (offset == 0x18) { /* BSRR: set wins over reset */
        if (write) {
            g->odr = (g->odr & ~(*value >> 16)) | (*value & 0xFFFFu);
            pins_update(b);
        }
        return true;
    }
    if (offset > 0x24) {
        return false;
    }
    if (!write) {
        *value = *store[offset / 4];
        return true;
    }
    if (offset == 0x00) {
        exti_sync(b);
    }
    *store[offset / 4] = offset == 0x14 || offset == 0x04 ? *value & 0xFFFFu : *value;
    if (offset >= 0x20 || offset == 0x00) { /* a pin may have become, or ceased to be, an encoder's input */
        for (int timer = 1; timer <= TIMERS; timer++) {
            timer_route_encoder(b, timer);
        }
        find_routes(b);
        encoder_lines_schedule(b);
    }
    timer_break_update(b, 1);
    timer_break_update(b, 8);
    pins_update(b);
    return true;
}

void board_watch_pin(struct board *board, struct board_pin pin)
{
    if (board->watched_count < WATCHED_PINS) {
        struct watched *w = &board->watched[board->watched_count++];
        *w = (struct watched){.pin = pin, .duty = -1};
        find_timer_output(board, w);
    }
}

void board_wire_encoder(struct board *board, int encoder, struct board_pin a, struct board_pin b)
{
    if (encoder >= 0 && encoder < ENCODERS) {
        board->encoder[encoder] = (struct wired_encoder){.a = a, .b = b, .wired = true};
    }
}

/* Asks the wires anew, at the next event or access. */
void board_encoder_disturbed(struct board *board, int encoder, bool noisy)
{
    if (encoder >= 0 && encoder < ENCODERS) {
        board->encoder[encoder].noisy = noisy;
        board->encoder[encoder].change_ps = time_to_ps(board, board->moment);
        encoder_lines_schedule(board);
    }
}
