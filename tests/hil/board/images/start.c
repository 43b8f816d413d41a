/* Start-up of the test images: vector table with weak handlers, data and bss, then main. */
#include <stdint.h>

extern uint32_t stack_top, data_start, data_end, data_load, bss_start, bss_end;
int main(void);
void reset(void);

volatile uint32_t stray; /* number of the exception that nobody handles, plus 1000 */

void hang(void)
{
    uint32_t ipsr;
    __asm volatile("mrs %0, ipsr" : "=r"(ipsr));
    stray = 1000u + ipsr;
    for (;;) {
    }
}

void nmi(void) __attribute__((weak, alias("hang")));
void hard_fault(void) __attribute__((weak, alias("hang")));
void bus_fault(void) __attribute__((weak, alias("hang")));
void usage_fault(void) __attribute__((weak, alias("hang")));
void svc(void) __attribute__((weak, alias("hang")));
void pendsv(void) __attribute__((weak, alias("hang")));
void systick(void) __attribute__((weak, alias("hang")));
void irq0(void) __attribute__((weak, alias("hang")));
void irq1(void) __attribute__((weak, alias("hang")));
void irq2(void) __attribute__((weak, alias("hang")));
void irq3(void) __attribute__((weak, alias("hang")));
void irq10(void) __attribute__((weak, alias("hang")));
void irq12(void) __attribute__((weak, alias("hang")));
void irq14(void) __attribute__((weak, alias("hang")));
void irq25(void) __attribute__((weak, alias("hang")));
void irq29(void) __attribute__((weak, alias("hang")));
void irq39(void) __attribute__((weak, alias("hang")));

__attribute__((section(".vectors"), used)) static void (*const vectors[16 + 82])(void) = {
    (void (*)(void))(uintptr_t)&stack_top,
    reset,
    nmi,
    hard_fault,
    hang,
    bus_fault,
    usage_fault,
    0,
    0,
    0,
    0,
    svc,
    hang,
    0,
    pendsv,
    systick,
    [16] = irq0,
    irq1,
    irq2,
    irq3,
    [16 + 10] = irq10,
    [16 + 12] = irq12,
    [16 + 14] = irq14,
    [16 + 25] = irq25,
    [16 + 29] = irq29,
    [16 + 39] = irq39,
};

void reset(void)
{
    for (uint32_t *from = &data_load, *to = &data_start; to < &data_end;) {
        *to++ = *from++;
    }
    for (uint32_t *to = &bss_start; to < &bss_end;) {
        *to++ = 0;
    }
    main();
    for (;;) {
        __asm volatile("wfi");
    }
}
