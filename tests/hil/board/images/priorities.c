/* Pre-emption, tail-chaining, masks: every step leaves its mark in the order in which it ran. */
#include "chip.h"

volatile uint32_t marks[64];
volatile uint32_t mark_count;
volatile uint32_t done;

static void mark(uint32_t value)
{
    marks[mark_count++] = value;
}

void irq0(void) /* middle */
{
    mark(100);
    pend(2); /* more urgent: runs in between */
    mark(101);
    pend(1); /* as urgent: waits its turn */
    pend(3); /* less urgent: waits longer */
    mark(102);
}

void irq1(void)
{
    mark(110);
}

void irq2(void)
{
    mark(120);
    SCB_ICSR = 1u << 28; /* PendSV, the least urgent of all */
    mark(121);
}

void irq3(void)
{
    mark(130);
}

void pendsv(void)
{
    mark(140);
}

void svc(void)
{
    mark(150);
}

int main(void)
{
    SCB_SHPR(14) = 0xF0;
    SCB_SHPR(11) = 0x00;
    enable_irq(0, 0x40);
    enable_irq(1, 0x40);
    enable_irq(2, 0x20);
    enable_irq(3, 0x80);
    mark(1);
    pend(0);
    mark(2);
    __asm volatile("svc #0" ::: "memory");
    mark(3);
    __asm volatile("cpsid i" ::: "memory");
    pend(3);
    pend(1);
    mark(4);
    __asm volatile("cpsie i\n isb" ::: "memory"); /* the more urgent one first, whichever was pended first */
    mark(5);
    __asm volatile("msr basepri, %0" ::"r"(0x60) : "memory");
    pend(3); /* 0x80 is held back by BASEPRI 0x60 */
    mark(6);
    pend(1); /* 0x40 is not */
    mark(7);
    __asm volatile("msr basepri, %0\n isb" ::"r"(0) : "memory");
    mark(8);
    SCB_AIRCR = 0x05FA0000u | 7u << 8; /* PRIGROUP 7: no bit of the priority decides on pre-emption */
    pend(0);
    mark(9);
    done = 1;
    return 0;
}
