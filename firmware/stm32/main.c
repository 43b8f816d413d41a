/* The program of the board: starts the drivers, runs the controller's tick each millisecond and its poll
 * between. */
#include "battery.h"
#include "can_port.h"
#include "clock.h"
#include "controller.h"
#include "cortex.h"
#include "debugger.h"
#include "driver_enable.h"
#include "encoders.h"
#include "hal.h"
#include "identity.h"
#include "idle.h"
#include "log_memory.h"
#include "motors.h"
#include "pins.h"
#include "registers.h"
#include "supply.h"
#include "usart_link.h"
#include "watchdog.h"

enum { TICK_HZ = 1000, LED_MS = 500, LED_FALLBACK_MS = 125 };

/* Processor cycles from the moment a tick was due to its end; what the README's budget is read from. */
struct tick_cost {
    uint32_t last_cycles;
    uint32_t max_cycles;
};

volatile struct tick_cost tick_cost;

static struct controller controller;
static uint32_t led_half_period_ms;

void SysTick_Handler(void);

/* The board's LED shows that ticks come: 1 Hz on the crystal, 4 Hz without it. */
static void blink(void)
{
    static uint32_t elapsed_ms;
    if (++elapsed_ms >= led_half_period_ms) {
        elapsed_ms = 0;
        pin_port(BOARD_LED)->odr ^= 1u << pin_number(BOARD_LED);
    }
}

/* SysTick is pending again: the tick took more than its millisecond, and the counter has wrapped. */
static bool tick_overran(void)
{
    return (SCB_ICSR & ICSR_PENDSTSET) != 0;
}

static void record_cost(bool overran)
{
    const uint32_t cycles = overran ? SYSTICK->load : SYSTICK->load - SYSTICK->val;
    tick_cost.last_cycles = cycles;
    if (cycles > tick_cost.max_cycles) {
        tick_cost.max_cycles = cycles;
    }
}

void SysTick_Handler(void)
{
    encoders_update();
    battery_update();
    controller_tick(&controller);
    usart_link_tick();
    can_tick();
    blink();
    supply_settle();
    const bool overran = tick_overran();
    record_cost(overran);
    if (overran) {
        controller_note_overrun(&controller);
    }
    idle_end(); /* the main loop reads the line, and shows that it gets on */
}

void hal_sense(struct hal_sample *out)
{
    encoders_read(out);
    out->emergency_stop = motors_emergency_stop();
    out->supply_dip = supply_dipped();
    out->battery_valid = battery_read(&out->battery_mv);
}

bool hal_has_unheard(void)
{
    return usart_link_has_unheard() || can_has_unheard();
}

uint32_t hal_now_us(void)
{
    return encoders_now_us();
}

/* Only the tick is held off: the controller shares nothing with the serial interrupt but the link's rings,
 * and these need no lock. So no length of critical section can make the port overrun. */
uint32_t hal_critical_enter(void)
{
    const uint32_t before = cpu_basepri();
    cpu_set_basepri(PRIORITY_TICK);
    return before;
}

void hal_critical_exit(uint32_t state)
{
    cpu_set_basepri(state);
}

static void start_tick(uint32_t cpu_hz)
{
    SCB_SHPR(EXCEPTION_SYSTICK) = PRIORITY_TICK;
    SYSTICK->load = cpu_hz / TICK_HZ - 1u;
    /* A tick is a whole number of PWM periods: begun with one, it hands its efforts over well before the
     * next, however long the start took. Half a period off, busy ticks would miss it and quiet ones not. */
    motors_await_period();
    SYSTICK->val = 0;
    SYSTICK->ctrl = SYSTICK_CTRL_CLKSOURCE | SYSTICK_CTRL_TICKINT | SYSTICK_CTRL_ENABLE;
}

int main(void)
{
    struct clock clock;
    watchdog_start();
    clock_peripherals();
    driver_enable_start();
    motors_start(CLOCK_RESET_HZ); /* brakes: a robot that restarts at speed must not wait for the crystal */
    debugger_brakes();
    clock_start(&clock);
    motors_start(clock.timer_apb2_hz);
    encoders_start(clock.timer_apb1_hz);
    battery_start();
    supply_start();
    pin_to_output(BOARD_LED);
    led_half_period_ms = clock.source == CLOCK_CRYSTAL_PLL ? LED_MS : LED_FALLBACK_MS;
    identity_start(&clock);
    log_memory_start();
    controller_init(&controller);
    usart_link_start(clock.apb1_hz); /* late, or what arrives before interrupts are on would overrun */
    can_prepare(clock.can_hz, clock.source == CLOCK_CRYSTAL_PLL);
    watchdog_shorten();
    start_tick(clock.cpu_hz);
    cpu_interrupts_on();

    for (;;) {
        controller_poll(&controller);
        /* Asked with interrupts off, or a frame that ends in between would wait for the next tick. */
        cpu_interrupts_off();
        const bool serial_calls = usart_link_take_call();
        const bool can_calls = can_take_call();
        if (!serial_calls && !can_calls) {
            idle_begin();
            cpu_wait_for_interrupt();
        }
        cpu_interrupts_on();
    }
}
