/* The registers of the STM32F405 and of its Cortex-M4 CPU that this firmware touches, and no others.
 *
 * Sections are those of RM0090 (STM32F405/407 reference manual) and PM0214 (Cortex-M4 programming manual). */
#ifndef REGISTERS_H
#define REGISTERS_H

#include <stdint.h>

typedef volatile uint32_t reg32;

/* --- CPU, PM0214 ---------------------------------------------------------------------------------- */

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

/* --- Clocks and power ----------------------------------------------------------------------------- */

/* Reset and clock control, section 7.3. */
struct rcc {
    reg32 cr;
    reg32 pllcfgr;
    reg32 cfgr;
    reg32 cir;
    reg32 ahb1rstr;
    reg32 ahb2rstr;
    reg32 ahb3rstr;
    reg32 reserved_1c;
    reg32 apb1rstr;
    reg32 apb2rstr;
    reg32 reserved_28[2];
    reg32 ahb1enr;
    reg32 ahb2enr;
    reg32 ahb3enr;
    reg32 reserved_3c;
    reg32 apb1enr;
    reg32 apb2enr;
    reg32 reserved_48[10];
    reg32 bdcr;
    reg32 csr;
};
_Static_assert(sizeof(struct rcc) == 0x78, "RCC_CSR lies at 0x74");
#define RCC                 ((struct rcc *)0x40023800u)
#define RCC_CR_HSION        (1u << 0)
#define RCC_CR_HSIRDY       (1u << 1)
#define RCC_CR_HSEON        (1u << 16)
#define RCC_CR_HSERDY       (1u << 17)
#define RCC_CR_HSEBYP       (1u << 18)
#define RCC_CR_CSSON        (1u << 19)
#define RCC_CR_PLLON        (1u << 24)
#define RCC_CR_PLLRDY       (1u << 25)
#define RCC_PLLCFGR_M(m)    ((uint32_t)(m))
#define RCC_PLLCFGR_N(n)    ((uint32_t)(n) << 6)
#define RCC_PLLCFGR_P_2     (0u << 16)
#define RCC_PLLCFGR_SRC_HSE (1u << 22)
#define RCC_PLLCFGR_Q(q)    ((uint32_t)(q) << 24)
#define RCC_CFGR_SW_MASK    (3u << 0)
#define RCC_CFGR_SW_PLL     (2u << 0)
#define RCC_CFGR_SWS_MASK   (3u << 2)
#define RCC_CFGR_SWS_PLL    (2u << 2)
#define RCC_CFGR_RTCPRE(d)  ((uint32_t)(d) << 16)
#define RCC_CFGR_PPRE1_DIV4 (5u << 10)
#define RCC_CFGR_PPRE2_DIV2 (4u << 13)
#define RCC_CIR_CSSF        (1u << 7)
#define RCC_CIR_CSSC        (1u << 23)
#define RCC_AHB1ENR_GPIOA   (1u << 0)
#define RCC_AHB1ENR_GPIOB   (1u << 1)
#define RCC_AHB1ENR_GPIOC   (1u << 2)
#define RCC_AHB1ENR_CCM     (1u << 20)
#define RCC_AHB1ENR_DMA1    (1u << 21)
#define RCC_AHB2ENR_RNG     (1u << 6)
#define RCC_APB1ENR_TIM2    (1u << 0)
#define RCC_APB1ENR_TIM3    (1u << 1)
#define RCC_APB1ENR_TIM4    (1u << 2)
#define RCC_APB1ENR_USART3  (1u << 18)
#define RCC_APB1ENR_CAN1    (1u << 25)
#define RCC_APB1ENR_PWR     (1u << 28)
#define RCC_APB2ENR_TIM1    (1u << 0)
#define RCC_APB2ENR_TIM8    (1u << 1)
#define RCC_APB2ENR_TIM11   (1u << 18)
#define RCC_APB2ENR_ADC1    (1u << 8)
#define RCC_CSR_RMVF        (1u << 24)

/* Power control, section 5.4.1. The F405 has one scale bit and no over-drive. */
#define PWR_CR            (*(reg32 *)0x40007000u)
#define PWR_CR_VOS        (1u << 14)
#define PWR_CR_PVDE       (1u << 4)
#define PWR_CR_PLS(level) ((level) << 5)
#define PWR_CSR           (*(reg32 *)0x40007004u)
#define PWR_CSR_PVDO      (1u << 2)

/* Flash interface, section 3.9. */
#define FLASH_ACR               (*(reg32 *)0x40023C00u)
#define FLASH_ACR_LATENCY(ws)   ((uint32_t)(ws))
#define FLASH_ACR_LATENCY_MASK  7u
#define FLASH_ACR_PRFTEN        (1u << 8)
#define FLASH_ACR_ICEN          (1u << 9)
#define FLASH_ACR_DCEN          (1u << 10)
#define FLASH_ACR_ICRST         (1u << 11)
#define FLASH_ACR_DCRST         (1u << 12)
#define FLASH_KEYR              (*(reg32 *)0x40023C04u)
#define FLASH_SR                (*(reg32 *)0x40023C0Cu)
#define FLASH_CR                (*(reg32 *)0x40023C10u)
#define FLASH_OPTCR             (*(reg32 *)0x40023C14u)
#define FLASH_OPTCR_BOR_LEV     (3u << 2)
#define FLASH_OPTCR_BOR_LEVEL_3 (0u << 2)
#define FLASH_KEY1              0x45670123u
#define FLASH_KEY2              0xCDEF89ABu
#define FLASH_SR_ERRORS         0x000000F2u /* PGSERR, PGPERR, PGAERR, WRPERR, OPERR; cleared by writing ones */
#define FLASH_SR_BSY            (1u << 16)
#define FLASH_CR_PG             (1u << 0)
#define FLASH_CR_SER            (1u << 1)
#define FLASH_CR_SNB(sector)    ((uint32_t)(sector) << 3)
#define FLASH_CR_PSIZE_32       (2u << 8) /* 32 bits at a time, at 2.7 to 3.6 V */
#define FLASH_CR_STRT           (1u << 16)
#define FLASH_CR_LOCK           (1u << 31)

/* Core-coupled memory, section 2.3.1. Other parts of the family have none. */
#define CCM_ADDRESS 0x10000000u
#define CCM_SIZE    0x10000u

/* What stops while a debugger halts the core, section 38.16; kept through every reset but power-on. */
#define DBGMCU_APB1_FZ           (*(reg32 *)DBGMCU_APB1_FZ_ADDRESS)
#define DBGMCU_APB2_FZ           (*(reg32 *)0xE004200Cu)
#define DBGMCU_APB1_FZ_ADDRESS   0xE0042008u
#define DBGMCU_APB1_FZ_IWDG_STOP (1u << 12)
#define DBGMCU_APB2_FZ_TIM1_STOP (1u << 0)
#define DBGMCU_APB2_FZ_TIM8_STOP (1u << 1)

/* Device identity, section 38.6.1, and the unique device id, section 39.1. */
#define DBGMCU_IDCODE_ADDRESS 0xE0042000u
#define UID_ADDRESS           0x1FFF7A10u

/* --- Peripherals ---------------------------------------------------------------------------------- */

/* General-purpose pins, section 8.4. */
struct gpio {
    reg32 moder;
    reg32 otyper;
    reg32 ospeedr;
    reg32 pupdr;
    reg32 idr;
    reg32 odr;
    reg32 bsrr;
    reg32 lckr;
    reg32 afr[2];
};
#define GPIO(port) ((struct gpio *)(0x40020000u + 0x400u * (port))) /* 0: port A */

/* External interrupts, section 12.3; one bit for each line. */
struct exti {
    reg32 imr;
    reg32 emr;
    reg32 rtsr;
    reg32 ftsr;
    reg32 swier;
    reg32 pr;
};
#define EXTI    ((struct exti *)0x40013C00u)
#define IRQ_PVD 1u

/* Timers: TIM1 in section 17.4, TIM2 to TIM4 in section 18.4 (these lack RCR and BDTR; TIM2 has 32 bits). */
struct timer {
    reg32 cr1;
    reg32 cr2;
    reg32 smcr;
    reg32 dier;
    reg32 sr;
    reg32 egr;
    reg32 ccmr1;
    reg32 ccmr2;
    reg32 ccer;
    reg32 cnt;
    reg32 psc;
    reg32 arr;
    reg32 rcr;
    reg32 ccr[4];
    reg32 bdtr;
    reg32 reserved_48[2];
    reg32 option; /* TIM2, TIM5 and TIM11 */
};
_Static_assert(sizeof(struct timer) == 0x54, "TIM11_OR lies at 0x50");
#define TIM1                ((struct timer *)0x40010000u)
#define TIM8                ((struct timer *)0x40010400u) /* as TIM1 */
#define TIM11               ((struct timer *)0x40014800u) /* section 19.5: one channel, no BDTR */
#define TIM2                ((struct timer *)0x40000000u)
#define TIM3                ((struct timer *)0x40000400u)
#define TIM4                ((struct timer *)0x40000800u)
#define TIM_CR1_CEN         (1u << 0)
#define TIM_CR1_ARPE        (1u << 7)
#define TIM_CR1_CKD_DIV4    (2u << 8)
#define TIM_CR2_OIS(ch)     (1u << (8u + 2u * (ch))) /* idle level of channel 0..3 */
#define TIM_SMCR_ENCODER_X4 3u
#define TIM_EGR_UG          (1u << 0)
#define TIM_CCMR_PWM1       (6u << 4) /* low byte of CCMR1/2; the high byte is the next channel */
#define TIM_CCMR_ACTIVE     (5u << 4)
#define TIM_CCMR_INACTIVE   (4u << 4)
#define TIM_CC_FLAG(ch)     (2u << (ch)) /* CCxIF in SR, CCxIE in DIER, of channel 0..3 */
#define TIM_CCMR_PRELOAD    (1u << 3)
#define TIM_CCMR_INPUT      (1u << 0) /* channel is an input from its own pin */
#define TIM_CCMR_FILTER(f)  ((uint32_t)(f) << 4)
#define TIM_CCER_ENABLE(ch) (1u << (4u * (ch)))
#define TIM_CCER_INVERT(ch) (2u << (4u * (ch)))
#define TIM_BDTR_OSSI       (1u << 10)
#define TIM_BDTR_BKE        (1u << 12)
#define TIM_BDTR_BKP        (1u << 13) /* a break while the input is high */
#define TIM_BDTR_MOE        (1u << 15)
#define TIM_CCMR_EACH_8     (3u << 2) /* each eighth edge is captured */
#define TIM_SR_CC1IF        (1u << 1)
#define TIM_SR_CC1OF        (1u << 9) /* a capture came while the last one was not read */
#define TIM11_OR_HSE_RTC    (2u << 0) /* channel 1 is the crystal over RTCPRE */
#define IRQ_TIM3            29u       /* section 12.2, table 62 */
#define IRQ_TIM4            30u
#define TIM_SR_BIF          (1u << 7) /* there was a break; cleared by writing 0 once the input is quiet */

/* Serial port, section 30.6. */
struct usart {
    reg32 sr;
    reg32 dr;
    reg32 brr;
    reg32 cr1;
    reg32 cr2;
    reg32 cr3;
};
#define USART3           ((struct usart *)0x40004800u)
#define USART_SR_FE      (1u << 1)
#define USART_SR_NE      (1u << 2)
#define USART_SR_ORE     (1u << 3)
#define USART_SR_RXNE    (1u << 5)
#define USART_SR_TXE     (1u << 7)
#define USART_CR1_RE     (1u << 2)
#define USART_CR1_TE     (1u << 3)
#define USART_CR1_IDLEIE (1u << 4)
#define USART_CR1_RXNEIE (1u << 5)
#define USART_CR1_TXEIE  (1u << 7)
#define USART_CR1_UE     (1u << 13)
#define USART_CR3_DMAR   (1u << 6)
#define USART_CR3_DMAT   (1u << 7)
#define IRQ_USART3       39u /* section 12.2, table 61 */

/* Direct memory access, section 10.5. */
struct dma_stream {
    reg32 cr;
    reg32 ndtr;
    reg32 par;
    reg32 m0ar;
    reg32 m1ar;
    reg32 fcr;
};
struct dma {
    reg32 lisr;
    reg32 hisr;
    reg32 lifcr;
    reg32 hifcr;
    struct dma_stream stream[8];
};
#define DMA1                 ((struct dma *)0x40026000u)
#define DMA_CR_EN            (1u << 0)
#define DMA_CR_TCIE          (1u << 4)
#define DMA_CR_TO_PERIPHERAL (1u << 6)
#define DMA_CR_CIRC          (1u << 8)
#define DMA_CR_MINC          (1u << 10)
#define DMA_CR_CHANNEL(c)    ((c) << 25)
#define DMA_LIFCR_STREAM3    (0x3Du << 22)
#define IRQ_DMA1_STREAM3     14u

/* Analogue-to-digital converter, section 13.13. */
struct adc {
    reg32 sr;
    reg32 cr1;
    reg32 cr2;
    reg32 smpr1;
    reg32 smpr2;
    reg32 jofr[4];
    reg32 htr;
    reg32 ltr;
    reg32 sqr1;
    reg32 sqr2;
    reg32 sqr3;
    reg32 jsqr;
    reg32 jdr[4];
    reg32 dr;
};
#define ADC1              ((struct adc *)0x40012000u)
#define ADC_CCR           (*(reg32 *)0x40012304u)
#define ADC_SR_EOC        (1u << 1)
#define ADC_CR2_ADON      (1u << 0)
#define ADC_CR2_SWSTART   (1u << 30)
#define ADC_CCR_PCLK_DIV4 (1u << 16)

/* Basic extended CAN, section 32.9. The filters are shared with CAN2 and belong to CAN1's addresses. */
struct can_mailbox {
    reg32 ir;
    reg32 dtr;
    reg32 dlr;
    reg32 dhr;
};
struct can {
    reg32 mcr;
    reg32 msr;
    reg32 tsr;
    reg32 rfr[2];
    reg32 ier;
    reg32 esr;
    reg32 btr;
    reg32 reserved_20[88];
    struct can_mailbox tx[3];
    struct can_mailbox rx[2];
    reg32 reserved_1d0[12];
    reg32 fmr;
    reg32 fm1r;
    reg32 reserved_208;
    reg32 fs1r;
    reg32 reserved_210;
    reg32 ffa1r;
    reg32 reserved_218;
    reg32 fa1r;
    reg32 reserved_220[8];
    reg32 filter[28][2];
};
_Static_assert(sizeof(struct can) == 0x320, "the last filter ends at 0x31F");
#define CAN1             ((struct can *)0x40006400u)
#define CAN_MCR_INRQ     (1u << 0)
#define CAN_MCR_TXFP     (1u << 2) /* mailboxes leave in the order of their requests */
#define CAN_MSR_INAK     (1u << 0)
#define CAN_MSR_ERRI     (1u << 2)
#define CAN_TSR_RQCP(m)  (1u << (8u * (m)))
#define CAN_TSR_TXOK(m)  (1u << (8u * (m) + 1u))
#define CAN_TSR_ABRQ(m)  (1u << (8u * (m) + 7u))
#define CAN_TSR_TME(m)   (1u << (26u + (m)))
#define CAN_RFR_FMP      3u
#define CAN_RFR_FOVR     (1u << 4)
#define CAN_RFR_RFOM     (1u << 5)
#define CAN_IER_TMEIE    (1u << 0)
#define CAN_IER_FMPIE0   (1u << 1)
#define CAN_IER_BOFIE    (1u << 10)
#define CAN_IER_ERRIE    (1u << 15)
#define CAN_ESR_EWGF     (1u << 0)
#define CAN_ESR_EPVF     (1u << 1)
#define CAN_ESR_BOFF     (1u << 2)
#define CAN_ESR_LEC(esr) (((esr) >> 4) & 7u)
#define CAN_ESR_TEC(esr) (((esr) >> 16) & 0xFFu)
#define CAN_ESR_REC(esr) ((esr) >> 24)
#define CAN_TIR_TXRQ     (1u << 0)
#define CAN_IR_STID      21u
#define CAN_FMR_FINIT    (1u << 0)
#define IRQ_CAN1_TX      19u
#define IRQ_CAN1_RX0     20u
#define IRQ_CAN1_RX1     21u
#define IRQ_CAN1_SCE     22u

/* Random number generator, section 24.4. Addresses, since it is only read through a guarded load. */
#define RNG_CR         (*(reg32 *)0x50060800u)
#define RNG_SR_ADDRESS 0x50060804u
#define RNG_DR_ADDRESS 0x50060808u
#define RNG_CR_RNGEN   (1u << 2)
#define RNG_SR_DRDY    (1u << 0)
#define RNG_SR_CECS    (1u << 1)
#define RNG_SR_SECS    (1u << 2)

/* Independent watchdog, section 21.4. */
struct iwdg {
    reg32 kr;
    reg32 pr;
    reg32 rlr;
    reg32 sr;
};
#define IWDG            ((struct iwdg *)0x40003000u)
#define IWDG_KEY_RELOAD 0xAAAAu
#define IWDG_KEY_ACCESS 0x5555u
#define IWDG_KEY_START  0xCCCCu
#define IWDG_PR_DIV4    0u
#define IWDG_PR_DIV32   3u
#define IWDG_SR_PVU     (1u << 0) /* a new prescaler is under way */
#define IWDG_SR_RVU     (1u << 1) /* a new reload value is under way */

#endif
