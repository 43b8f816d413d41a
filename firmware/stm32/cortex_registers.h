/* The registers of the Cortex-M4 CPU that this firmware touches. Sections are those of PM0214 (Cortex-M4
 * programming manual). */
#ifndef CORTEX_REGISTERS_H
#define CORTEX_REGISTERS_H

#include <stdint.h>

typedef volatile uint32_t reg32;

/* SysTick timer, PM0214 section 4.5. */
struct systick {
    reg32 ctrl;
    reg32 load;
    reg32 val;
};
#define SYSTICK                ((struct systick *)0xE000E010u)
#define SYSTICK_CTRL_ENABLE    (1u << 0)
#define SYSTICK_CTRL_TICKINT   (1u << 1)
#define SYSTICK_CTRL_CLKSOURCE (1u << 2) /* the processor clock itself, not an eighth of it */
#define SYSTICK_MAX            0x00FFFFFFu

/* Interrupt controller, PM0214 section 4.3: set-enable words and one priority byte for each interrupt. */
#define NVIC_ISER(word) (*(reg32 *)(0xE000E100u + 4u * (word)))
#define NVIC_IPR(irq)   (*(volatile uint8_t *)(0xE000E400u + (irq)))

/* System control block, PM0214 section 4.4. */
#define SCB_ICSR          (*(reg32 *)0xE000ED04u)
#define SCB_VTOR          (*(reg32 *)0xE000ED08u)
#define SCB_AIRCR         (*(reg32 *)0xE000ED0Cu)
#define SCB_SCR           (*(reg32 *)0xE000ED10u)
#define SCB_SHPR(exc)     (*(volatile uint8_t *)(0xE000ED14u + (exc))) /* system exceptions 4 to 15 */
#define SCB_SHCSR         (*(reg32 *)0xE000ED24u)
#define SCB_CFSR          (*(reg32 *)0xE000ED28u)
#define SCB_HFSR          (*(reg32 *)0xE000ED2Cu)
#define SCB_MMFAR         (*(reg32 *)0xE000ED34u)
#define SCB_BFAR          (*(reg32 *)0xE000ED38u)
#define SCB_CPACR         (*(reg32 *)0xE000ED88u) /* section 4.6.1 */
#define SCB_DEMCR         (*(reg32 *)0xE000EDFCu) /* ARMv7-M manual, section C1.6.5 */
#define DEMCR_TRCENA      (1u << 24)
#define ICSR_PENDSTSET    (1u << 26)
#define SCR_SLEEPONEXIT   (1u << 1)
#define ICSR_PENDSTCLR    (1u << 25)
#define AIRCR_VECTKEY     (0x05FAu << 16)
#define AIRCR_SYSRESETREQ (1u << 2)
#define SHCSR_MEMFAULTENA (1u << 16)
#define SHCSR_BUSFAULTENA (1u << 17)
#define SHCSR_USGFAULTENA (1u << 18)
#define CPACR_FPU_FULL    (0xFu << 20)
#define EXCEPTION_SYSTICK 15u

/* Cycle counter, ARMv7-M manual, section C1.8. */
#define DWT_CTRL           (*(reg32 *)0xE0001000u)
#define DWT_CYCCNT         (*(reg32 *)0xE0001004u)
#define DWT_CTRL_CYCCNTENA (1u << 0)

#endif
