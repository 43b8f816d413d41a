/* The registers of the STM32F405 that this firmware touches beside those that other families have as well
 * (shared_registers.h), and where those lie. Sections are those of RM0090 (STM32F405/407 reference manual).
 */
#ifndef REGISTERS_H
#define REGISTERS_H

#include "cortex_registers.h"
#include "shared_registers.h"

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
#define RCC                   ((struct rcc *)0x40023800u)
#define RCC_CR_HSION          (1u << 0)
#define RCC_CR_HSIRDY         (1u << 1)
#define RCC_CR_HSEON          (1u << 16)
#define RCC_CR_HSERDY         (1u << 17)
#define RCC_CR_HSEBYP         (1u << 18)
#define RCC_CR_CSSON          (1u << 19)
#define RCC_CR_PLLON          (1u << 24)
#define RCC_CR_PLLRDY         (1u << 25)
#define RCC_PLLCFGR_M(m)      ((uint32_t)(m))
#define RCC_PLLCFGR_N(n)      ((uint32_t)(n) << 6)
#define RCC_PLLCFGR_P_2       (0u << 16)
#define RCC_PLLCFGR_SRC_HSE   (1u << 22)
#define RCC_PLLCFGR_Q(q)      ((uint32_t)(q) << 24)
#define RCC_CFGR_SW_MASK      (3u << 0)
#define RCC_CFGR_SW_PLL       (2u << 0)
#define RCC_CFGR_SW_INTERNAL  0u
#define RCC_CFGR_SWS_MASK     (3u << 2)
#define RCC_CFGR_SWS_PLL      (2u << 2)
#define RCC_CFGR_SWS_INTERNAL 0u
#define RCC_CFGR_RTCPRE(d)    ((uint32_t)(d) << 16)
#define RCC_CFGR_PPRE1_DIV4   (5u << 10)
#define RCC_CFGR_PPRE2_DIV2   (4u << 13)
#define RCC_CIR_CSSF          (1u << 7)
#define RCC_CIR_CSSC          (1u << 23)
#define RCC_AHB1ENR_GPIOA     (1u << 0)
#define RCC_AHB1ENR_GPIOB     (1u << 1)
#define RCC_AHB1ENR_GPIOC     (1u << 2)
#define RCC_AHB1ENR_CCM       (1u << 20)
#define RCC_AHB1ENR_DMA1      (1u << 21)
#define RCC_AHB2ENR_RNG       (1u << 6)
#define RCC_APB1ENR_TIM2      (1u << 0)
#define RCC_APB1ENR_TIM3      (1u << 1)
#define RCC_APB1ENR_TIM4      (1u << 2)
#define RCC_APB1ENR_USART3    (1u << 18)
#define RCC_APB1ENR_CAN1      (1u << 25)
#define RCC_APB1ENR_PWR       (1u << 28)
#define RCC_APB2ENR_TIM1      (1u << 0)
#define RCC_APB2ENR_TIM8      (1u << 1)
#define RCC_APB2ENR_TIM11     (1u << 18)
#define RCC_APB2ENR_ADC1      (1u << 8)
#define RCC_CSR_RMVF          (1u << 24)

/* Power control, section 5.4.1. The F405 has one scale bit and no over-drive. */
#define PWR_CR     (*(reg32 *)0x40007000u)
#define PWR_CR_VOS (1u << 14)

/* The voltage detector in PWR_CR and PWR_CSR. Level 6 is 2.93 V (2.85 to 2.99 V, recovered at 2.96 to 3.10 V;
 * datasheet table 19): before the brown-out reset (2.75 to 2.88 V), and before 2.7 V, where flash is too slow
 * for 168 MHz at 5 wait states (RM0090 table 10). Level 7 would reach up to 3.09 V, and recover at 3.21 V at
 * the latest: too near to a regulator's 3.3 V less 3 %. */
#define PVD_CONTROL       PWR_CR
#define PVD_ENABLE        (1u << 4)
#define PVD_LEVEL(level)  ((level) << 5)
#define PVD_HIGHEST_LEVEL 6u
#define PVD_STATUS        (*(reg32 *)0x40007004u)
#define PVD_IS_LOW        (1u << 2)

/* The brown-out reset in the option bytes, FLASH_OPTCR: level 3. */
#define BOR_OPTIONS       (*(reg32 *)0x40023C14u)
#define BOR_LEVEL         (3u << 2)
#define BOR_HIGHEST_LEVEL (0u << 2)

/* Flash interface, section 3.9. */
#define FLASH_ACR              (*(reg32 *)0x40023C00u)
#define FLASH_ACR_LATENCY(ws)  ((uint32_t)(ws))
#define FLASH_ACR_LATENCY_MASK 7u
#define FLASH_ACR_PRFTEN       (1u << 8)
#define FLASH_ACR_ICEN         (1u << 9)
#define FLASH_ACR_DCEN         (1u << 10)
#define FLASH_ACR_ICRST        (1u << 11)
#define FLASH_ACR_DCRST        (1u << 12)
#define FLASH_KEYR             (*(reg32 *)0x40023C04u)
#define FLASH_SR               (*(reg32 *)0x40023C0Cu)
#define FLASH_CR               (*(reg32 *)0x40023C10u)
#define FLASH_KEY1             0x45670123u
#define FLASH_KEY2             0xCDEF89ABu
#define FLASH_SR_ERRORS        0x000000F2u /* PGSERR, PGPERR, PGAERR, WRPERR, OPERR; cleared by writing ones */
#define FLASH_SR_BSY           (1u << 16)
#define FLASH_CR_PG            (1u << 0)
#define FLASH_CR_SER           (1u << 1)
#define FLASH_CR_SNB(sector)   ((uint32_t)(sector) << 3)
#define FLASH_CR_PSIZE_32      (2u << 8) /* 32 bits at a time, at 2.7 to 3.6 V */
#define FLASH_CR_STRT          (1u << 16)
#define FLASH_CR_LOCK          (1u << 31)

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

/* Peripherals of shared_registers.h. */
#define GPIO(port)       ((struct gpio *)(0x40020000u + 0x400u * (port))) /* 0: port A */
#define EXTI             ((struct exti *)0x40013C00u)
#define TIM1             ((struct timer *)0x40010000u)
#define TIM8             ((struct timer *)0x40010400u) /* as TIM1 */
#define TIM11            ((struct timer *)0x40014800u) /* one channel, no BDTR */
#define TIM2             ((struct timer *)0x40000000u)
#define TIM3             ((struct timer *)0x40000400u)
#define TIM4             ((struct timer *)0x40000800u)
#define IWDG             ((struct iwdg *)0x40003000u)
#define TIM11_OR_HSE_RTC (2u << 0) /* channel 1 is the crystal over RTCPRE */
#define INTERRUPTS       82u       /* section 12.2, table 61 */
#define IRQ_PVD          1u
#define IRQ_TIM3         29u
#define IRQ_TIM4         30u

/* Random number generator, section 24.4. Addresses, since it is only read through a guarded load. */
#define RNG_CR         (*(reg32 *)0x50060800u)
#define RNG_SR_ADDRESS 0x50060804u
#define RNG_DR_ADDRESS 0x50060808u

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

#endif
