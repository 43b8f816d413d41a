/* Reads and writes registers as the test asks, with USART3 at 921600 baud and DMA1 clocked; counts
 * interrupts. */
#include "chip.h"

#define DMA1_LISR  REG(0x40026000)
#define DMA1_LIFCR REG(0x40026008)

volatile uint32_t address, value, order; /* order 1: read, 2: write; 0 when carried out */
volatile uint32_t line_idle, received, half,
    sent; /* interrupts: idle line, end and middle of stream 1, stream 3 */
volatile uint8_t ring[16];
volatile uint8_t outbox[64];

void irq12(void)
{
    const uint32_t flags = DMA1_LISR;
    received += flags >> 11 & 1u;
    half += flags >> 10 & 1u;
    DMA1_LIFCR = flags & 0x3Du << 6;
}

void irq14(void)
{
    sent++;
    DMA1_LIFCR = 0x3Du << 22;
}

void irq39(void)
{
    line_idle += USART3_SR >> 4 & 1u;
    (void)USART3_DR;
}

int main(void)
{
    clock_168mhz();
    usart3(46);
    RCC_AHB1ENR |= 1u << 21;
    enable_irq(12, 0x40);
    enable_irq(14, 0x40);
    enable_irq(39, 0x40);
    for (;;) {
        const uint32_t asked = order;
        if (asked == 1) {
            value = REG(address);
        } else if (asked == 2) {
            REG(address) = value;
        }
        if (asked != 0) {
            order = 0;
        }
    }
}
