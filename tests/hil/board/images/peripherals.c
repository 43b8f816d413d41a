/* PWM, encoders, link and battery at 168 MHz; the test writes settings into `set` and reads `get`. */
#include "chip.h"

volatile struct {
    uint32_t compare[4], period, polarity, outputs_on, pins_to_timer, encoder_start[2], brr, tick_cycles;
} set = {.period = 8400, .outputs_on = 1, .pins_to_timer = 1, .brr = 46, .tick_cycles = 168000};
volatile struct {
    uint32_t ticks, tick_at, tick_worst_us, encoder[2], battery, adc_cycles, received, overruns, errors,
        noises;
} get;
volatile uint32_t send_count;
volatile uint8_t inbox[4096];
static uint32_t last_at;

void systick(void)
{
    uint32_t now = DWT_CYCCNT;
    get.tick_at = now - last_at;
    last_at = now;
    get.ticks++;
    get.encoder[0] = TIM3(0x24);
    get.encoder[1] = TIM4(0x24);
}

void irq39(void)
{
    uint32_t sr = USART3_SR;
    if ((sr & 1u << 5) != 0) {
        uint32_t byte = USART3_DR;
        inbox[get.received++ % sizeof inbox] = (uint8_t)byte;
        get.errors += (sr & 2u) != 0;
        get.noises += (sr & 4u) != 0;
    }
    if ((sr & 1u << 3) != 0) {
        get.overruns++;
    }
    if ((sr & USART3_CR1 & 1u << 7) != 0) {
        if (send_count > 0) {
            send_count--;
            USART3_DR = send_count & 0xFFu;
        } else {
            USART3_CR1 &= ~(1u << 7);
        }
    }
}

static void encoder(uint32_t timer, uint32_t start)
{
    REG(timer + 0x08) = 3;
    REG(timer + 0x18) = 0x0101;
    REG(timer + 0x2C) = 0xFFFF;
    REG(timer + 0x24) = start;
    REG(timer + 0x00) = 1;
}

static uint32_t convert(void)
{
    uint32_t from = DWT_CYCCNT;
    ADC1(0x08) = 1u | 1u << 30;
    while ((ADC1(0x00) & 2u) == 0) {
    }
    get.adc_cycles = DWT_CYCCNT - from;
    return ADC1(0x4C);
}

int main(void)
{
    clock_168mhz();
    DEMCR |= 1u << 24;
    DWT_CTRL |= 1u;
    RCC_AHB1ENR |= 7u;
    RCC_APB1ENR |= 6u;
    RCC_APB2ENR |= 1u | 1u << 8;
    /* PA4 analogue, PA8..PA11 timer 1, PB4..PB7 timers 3 and 4 */
    GPIO_MODER(0) |= 3u << 8;
    GPIO_AFRH(0) = 0x1111u;
    GPIO_MODER(1) = (GPIO_MODER(1) & ~(0xFFu << 8)) | 0xAAu << 8;
    GPIO_AFRL(1) = 0x22220000u;
    encoder(0x40000400u, set.encoder_start[0]);
    encoder(0x40000800u, set.encoder_start[1]);
    ADC1(0x10) = 3u << 12; /* channel 4: 56 cycles */
    ADC1(0x34) = 4;
    ADC1(0x08) = 1;
    REG(0x40012304) = 1u << 16; /* ADC clock 84 MHz / 4 */
    for (int i = 0; i < 2; i++) {
        TIM1(0x18 + 4 * i) = 0x6868; /* PWM mode 1, preloaded */
    }
    TIM1(0x2C) = set.period - 1;
    TIM1(0x14) = 1;
    TIM1(0x00) = 0x81;
    usart3(set.brr);
    USART3_CR1 |= 1u << 5;
    enable_irq(39, 0x40);
    SYST_RVR = set.tick_cycles - 1;
    SYST_CVR = 0;
    SYST_CSR = 7;
    for (;;) {
        GPIO_MODER(0) = (GPIO_MODER(0) & ~(0xFFu << 16)) | (set.pins_to_timer ? 0xAAu << 16 : 0);
        TIM1(0x20) = set.polarity ? 0x3333u : 0x1111u;
        TIM1(0x44) = set.outputs_on ? 1u << 15 : 0;
        for (unsigned i = 0; i < 4; i++) {
            TIM1(0x34 + 4 * i) = set.compare[i];
        }
        get.battery = convert();
        if (send_count > 0) {
            USART3_CR1 |= 1u << 7;
        }
        __asm volatile("wfi");
    }
}
