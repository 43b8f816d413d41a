/* The registers of the STM32G474 that this firmware touches beside those that other families have as well
 * (shared_registers.h), and where those lie. Chapters are those of RM0440 (STM32G4 reference manual); every
 * offset and bit has been compared with ST's device header (stm32g474xx.h), none with a chip. */
#ifndef REGISTERS_H
#define REGISTERS_H

#include "cortex_registers.h"
#include "shared_registers.h"

/* --- Clocks and power ----------------------------------------------------------------------------- */

/* Reset and clock control, RCC. */
struct rcc {
    reg32 cr;
    reg32 icscr;
    reg32 cfgr;
    reg32 pllcfgr;
    reg32 reserved_10[2];
    reg32 cier;
    reg32 cifr;
    reg32 cicr;
    reg32 reserved_24[9];
    reg32 ahb1enr;
    reg32 ahb2enr;
    reg32 ahb3enr;
    reg32 reserved_54;
    reg32 apb1enr1;
    reg32 apb1enr2;
    reg32 apb2enr;
    reg32 reserved_64[9];
    reg32 ccipr;
    reg32 reserved_8c;
    reg32 bdcr;
    reg32 csr;
    reg32 crrcr;
};
_Static_assert(sizeof(struct rcc) == 0x9C, "RCC_CRRCR lies at 0x98");
#define RCC                   ((struct rcc *)0x40021000u)
#define RCC_CR_HSION          (1u << 8)
#define RCC_CR_HSIRDY         (1u << 10)
#define RCC_CR_HSEON          (1u << 16)
#define RCC_CR_HSERDY         (1u << 17)
#define RCC_CR_HSEBYP         (1u << 18)
#define RCC_CR_CSSON          (1u << 19)
#define RCC_CR_PLLON          (1u << 24)
#define RCC_CR_PLLRDY         (1u << 25)
#define RCC_PLLCFGR_SRC_HSI   (2u << 0)
#define RCC_PLLCFGR_SRC_HSE   (3u << 0)
#define RCC_PLLCFGR_M(m)      (((uint32_t)(m)-1u) << 4)
#define RCC_PLLCFGR_N(n)      ((uint32_t)(n) << 8)
#define RCC_PLLCFGR_REN       (1u << 24)
#define RCC_PLLCFGR_R_2       (0u << 25)
#define RCC_CFGR_SW_MASK      (3u << 0)
#define RCC_CFGR_SW_INTERNAL  (1u << 0)
#define RCC_CFGR_SW_PLL       (3u << 0)
#define RCC_CFGR_SWS_MASK     (3u << 2)
#define RCC_CFGR_SWS_INTERNAL (1u << 2)
#define RCC_CFGR_SWS_PLL      (3u << 2)
#define RCC_CFGR_HPRE_MASK    (15u << 4)
#define RCC_CFGR_HPRE_DIV2    (8u << 4)
#define RCC_CIFR_CSSF         (1u << 8)
#define RCC_CICR_CSSC         (1u << 8)
#define RCC_AHB1ENR_DMA1      (1u << 0)
#define RCC_AHB1ENR_DMAMUX1   (1u << 2)
#define RCC_AHB2ENR_GPIOA     (1u << 0)
#define RCC_AHB2ENR_GPIOB     (1u << 1)
#define RCC_AHB2ENR_GPIOC     (1u << 2)
#define RCC_AHB2ENR_ADC12     (1u << 13)
#define RCC_AHB2ENR_RNG       (1u << 26)
#define RCC_APB1ENR1_TIM2     (1u << 0)
#define RCC_APB1ENR1_TIM3     (1u << 1)
#define RCC_APB1ENR1_TIM4     (1u << 2)
#define RCC_APB1ENR1_USART2   (1u << 17)
#define RCC_APB1ENR1_FDCAN    (1u << 25)
#define RCC_APB1ENR1_PWR      (1u << 28)
#define RCC_APB2ENR_TIM1      (1u << 11)
#define RCC_APB2ENR_TIM8      (1u << 13)
#define RCC_APB2ENR_TIM17     (1u << 18)
#define RCC_CSR_RMVF          (1u << 23)
#define RCC_CRRCR_HSI48ON     (1u << 0)

/* Power control, PWR. */
struct pwr {
    reg32 cr1;
    reg32 cr2;
    reg32 cr3;
    reg32 cr4;
    reg32 sr1;
    reg32 sr2;
    reg32 reserved_18[26];
    reg32 cr5;
};
_Static_assert(sizeof(struct pwr) == 0x84, "PWR_CR5 lies at 0x80");
#define PWR                ((struct pwr *)0x40007000u)
#define PWR_CR1_VOS_MASK   (3u << 9)
#define PWR_CR1_VOS_RANGE1 (1u << 9)
#define PWR_CR3_UCPD_DBDIS (1u << 14) /* no pull-downs of a USB Type-C sink without supply */
#define PWR_CR5_R1MODE     (1u << 8)  /* 0: range 1 boost */

/* The voltage detector. Level 6 is 2.9 V, the highest there is: 7 compares an outside voltage. */
#define PVD_CONTROL       (PWR->cr2)
#define PVD_ENABLE        (1u << 0)
#define PVD_LEVEL(level)  ((level) << 1)
#define PVD_HIGHEST_LEVEL 6u
#define PVD_STATUS        (PWR->sr2)
#define PVD_IS_LOW        (1u << 11)

/* Flash interface, FLASH, of category 3 (512 KiB). */
struct flash {
    reg32 acr;
    reg32 pdkeyr;
    reg32 keyr;
    reg32 optkeyr;
    reg32 sr;
    reg32 cr;
    reg32 eccr;
    reg32 reserved_1c;
    reg32 optr;
};
_Static_assert(sizeof(struct flash) == 0x24, "FLASH_OPTR lies at 0x20");
#define FLASH                  ((struct flash *)0x40022000u)
#define FLASH_ACR              (FLASH->acr)
#define FLASH_ACR_LATENCY_MASK 15u
#define FLASH_ACR_PRFTEN       (1u << 8)
#define FLASH_ACR_ICEN         (1u << 9)
#define FLASH_ACR_DCEN         (1u << 10)
#define FLASH_ACR_DCRST        (1u << 12)
#define FLASH_KEY1             0x45670123u
#define FLASH_KEY2             0xCDEF89ABu
/* OPERR, PROGERR, WRPERR, PGAERR, SIZERR, PGSERR, MISERR, FASTERR, RDERR, OPTVERR; cleared by writing ones.
 */
#define FLASH_SR_ERRORS    0x0000C3FAu
#define FLASH_SR_BSY       (1u << 16)
#define FLASH_CR_PG        (1u << 0)
#define FLASH_CR_PER       (1u << 1)
#define FLASH_CR_PNB(page) ((uint32_t)(page) << 3)
#define FLASH_CR_BKER      (1u << 11) /* of bank 2 */
#define FLASH_CR_STRT      (1u << 16)
#define FLASH_CR_LOCK      (1u << 31)
#define FLASH_ECCR_ECCD    (1u << 31) /* two wrong bits: the NMI; cleared by writing 1 */
#define FLASH_OPTR_DBANK   (1u << 22)

/* The brown-out reset in the option bytes: level 4, 2.8 V. */
#define BOR_OPTIONS       (FLASH->optr)
#define BOR_LEVEL         (7u << 8)
#define BOR_HIGHEST_LEVEL (4u << 8)

/* Core-coupled memory. It is also seen behind SRAM2, where this firmware does not use it. */
#define CCM_ADDRESS 0x10000000u
#define CCM_SIZE    0x8000u

/* What stops while a debugger halts the core, chapter DBG. */
#define DBGMCU_APB1_FZ           (*(reg32 *)DBGMCU_APB1_FZ_ADDRESS)
#define DBGMCU_APB2_FZ           (*(reg32 *)0xE0042010u)
#define DBGMCU_APB1_FZ_ADDRESS   0xE0042008u
#define DBGMCU_APB1_FZ_IWDG_STOP (1u << 12)
#define DBGMCU_APB2_FZ_TIM1_STOP (1u << 11)
#define DBGMCU_APB2_FZ_TIM8_STOP (1u << 13)

/* Unique device id, chapter Device electronic signature. */
#define UID_ADDRESS 0x1FFF7590u

/* --- Peripherals ---------------------------------------------------------------------------------- */

/* Peripherals of shared_registers.h. */
#define GPIO(port)         ((struct gpio *)(0x48000000u + 0x400u * (port))) /* 0: port A */
#define EXTI               ((struct exti *)0x40010400u)
#define TIM1               ((struct timer *)0x40012C00u)
#define TIM8               ((struct timer *)0x40013400u) /* as TIM1 */
#define TIM17              ((struct timer *)0x40014800u) /* one channel */
#define TIM2               ((struct timer *)0x40000000u)
#define TIM3               ((struct timer *)0x40000400u)
#define TIM4               ((struct timer *)0x40000800u)
#define IWDG               ((struct iwdg *)0x40003000u)
#define TIM_AF1_BKINE      (1u << 0) /* the break comes from the pin */
#define TIM17_TISEL_HSE_32 3u        /* channel 1 is the crystal over 32 */
#define INTERRUPTS         102u      /* chapter NVIC, vector table */
#define IRQ_PVD            1u
#define IRQ_TIM3           29u
#define IRQ_TIM4           30u

/* Random number generator. Addresses, since it is only read through a guarded load. */
#define RNG_CR         (*(reg32 *)0x50060800u)
#define RNG_SR_ADDRESS 0x50060804u
#define RNG_DR_ADDRESS 0x50060808u

/* Serial port, USART. */
struct usart {
    reg32 cr1;
    reg32 cr2;
    reg32 cr3;
    reg32 brr;
    reg32 gtpr;
    reg32 rtor;
    reg32 rqr;
    reg32 isr;
    reg32 icr;
    reg32 rdr;
    reg32 tdr;
};
_Static_assert(sizeof(struct usart) == 0x2C, "USART_TDR lies at 0x28");
#define USART2           ((struct usart *)0x40004400u)
#define USART_SR_FE      (1u << 1) /* of ISR, and what clears it of ICR; so NE, ORE and IDLE */
#define USART_SR_NE      (1u << 2)
#define USART_SR_ORE     (1u << 3)
#define USART_SR_IDLE    (1u << 4)
#define USART_SR_RXNE    (1u << 5)
#define USART_SR_TXE     (1u << 7)
#define USART_CR1_UE     (1u << 0)
#define USART_CR1_RE     (1u << 2)
#define USART_CR1_TE     (1u << 3)
#define USART_CR1_IDLEIE (1u << 4)
#define USART_CR1_RXNEIE (1u << 5)
#define USART_CR1_TXEIE  (1u << 7)
#define USART_CR3_DMAR   (1u << 6)
#define USART_CR3_DMAT   (1u << 7)
#define IRQ_USART2       38u

/* Direct memory access, DMA and DMAMUX. What RM0440 calls a channel is called a stream here, as for the
 * STM32F405, and its registers CCR, CNDTR, CPAR and CMAR likewise. */
struct dma_stream {
    reg32 cr;
    reg32 ndtr;
    reg32 par;
    reg32 m0ar;
    reg32 reserved_10;
};
struct dma {
    reg32 isr;
    reg32 ifcr;
    struct dma_stream stream[8];
};
#define DMA1                 ((struct dma *)0x40020000u)
#define DMA_CR_EN            (1u << 0)
#define DMA_CR_TCIE          (1u << 1)
#define DMA_CR_TO_PERIPHERAL (1u << 4)
#define DMA_CR_CIRC          (1u << 5)
#define DMA_CR_MINC          (1u << 7)
#define DMA_IFCR_ALL(stream) (1u << (4u * (stream)))
#define DMAMUX1_CR(stream)   (*(reg32 *)(0x40020800u + 4u * (stream)))
#define DMAMUX_USART2_RX     26u
#define DMAMUX_USART2_TX     27u
#define IRQ_DMA1_CHANNEL2    12u /* stream 1 */

/* Analogue-to-digital converter, ADC. */
struct adc {
    reg32 isr;
    reg32 ier;
    reg32 cr;
    reg32 cfgr;
    reg32 cfgr2;
    reg32 smpr1;
    reg32 smpr2;
    reg32 reserved_1c[5];
    reg32 sqr1;
    reg32 sqr2;
    reg32 sqr3;
    reg32 sqr4;
    reg32 dr;
};
_Static_assert(sizeof(struct adc) == 0x44, "ADC_DR lies at 0x40");
#define ADC1              ((struct adc *)0x50000000u)
#define ADC_CCR           (*(reg32 *)0x50000308u) /* of ADC1 and ADC2 */
#define ADC_ISR_ADRDY     (1u << 0)
#define ADC_ISR_EOC       (1u << 2)
#define ADC_CR_ADEN       (1u << 0)
#define ADC_CR_ADSTART    (1u << 2)
#define ADC_CR_ADVREGEN   (1u << 28)
#define ADC_CR_ADCAL      (1u << 31)
#define ADC_CFGR_OVRMOD   (1u << 12) /* a new conversion overwrites one that was not read */
#define ADC_SQR1_FIRST(c) ((uint32_t)(c) << 6)
#define ADC_CCR_HCLK_DIV4 (3u << 16)

/* CAN with flexible data rate, FDCAN. */
struct fdcan {
    reg32 reserved_00[6];
    reg32 cccr;
    reg32 nbtp;
    reg32 reserved_20[8];
    reg32 ecr;
    reg32 psr;
    reg32 reserved_48[2];
    reg32 ir;
    reg32 ie;
    reg32 ils;
    reg32 ile;
    reg32 reserved_60[8];
    reg32 rxgfc;
    reg32 reserved_84[3];
    reg32 rxf0s;
    reg32 rxf0a;
    reg32 reserved_98[10];
    reg32 txbc;
    reg32 txfqs;
    reg32 txbrp;
    reg32 txbar;
    reg32 txbcr;
    reg32 txbto;
    reg32 txbcf;
    reg32 txbtie;
};
_Static_assert(sizeof(struct fdcan) == 0xE0, "FDCAN_TXBTIE lies at 0xDC");
#define FDCAN1                ((struct fdcan *)0x40006400u)
#define FDCAN_CCCR_INIT       (1u << 0)
#define FDCAN_CCCR_CCE        (1u << 1)
#define FDCAN_ECR_TEC(ecr)    ((ecr)&0xFFu)
#define FDCAN_ECR_REC(ecr)    (((ecr) >> 8) & 0x7Fu)
#define FDCAN_PSR_LEC(psr)    ((psr)&7u)
#define FDCAN_PSR_ACT         (3u << 3) /* 0: waits for idle bits */
#define FDCAN_PSR_EP          (1u << 5)
#define FDCAN_PSR_EW          (1u << 6)
#define FDCAN_PSR_BO          (1u << 7)
#define FDCAN_IR_RF0N         (1u << 0) /* a frame came into Rx FIFO 0; IE has the same bits */
#define FDCAN_IR_RF0L         (1u << 2) /* one was lost, as it was full */
#define FDCAN_IR_TC           (1u << 7) /* a frame was sent */
#define FDCAN_IR_BO           (1u << 19)
#define FDCAN_ILE_EINT0       (1u << 0)
#define FDCAN_RXGFC_RRFE      (1u << 0) /* refuses remote frames, extended and standard */
#define FDCAN_RXGFC_RRFS      (1u << 1)
#define FDCAN_RXGFC_ANFE_NONE (2u << 2) /* refuses what no filter lets in, extended and standard */
#define FDCAN_RXGFC_ANFS_NONE (2u << 4)
#define FDCAN_RXGFC_LSS(n)    ((uint32_t)(n) << 16) /* standard filters */
#define FDCAN_RXF0S_LEVEL     15u
#define FDCAN_RXF0S_GET(s)    (((s) >> 8) & 3u)
#define FDCAN_TXFQS_FREE      7u
#define FDCAN_TXFQS_PUT(s)    (((s) >> 16) & 3u)
#define IRQ_FDCAN1_IT0        21u

/* FDCAN1's part of the message RAM: each element of Rx and Tx has room for 64 bytes. */
struct fdcan_element {
    reg32 id;
    reg32 length;
    reg32 data[16];
};
struct fdcan_ram {
    reg32 standard_filters[28];
    reg32 extended_filters[8][2];
    struct fdcan_element rx_fifo_0[3];
    struct fdcan_element rx_fifo_1[3];
    reg32 tx_events[3][2];
    struct fdcan_element tx[3];
};
_Static_assert(sizeof(struct fdcan_ram) == 0x350, "FDCAN2's part begins at 0x350");
#define FDCAN1_RAM ((struct fdcan_ram *)0x4000A400u)
#define FDCAN_FILTER_DUAL(a, b)                                                                              \
    (1u << 30 | 1u << 27 | (uint32_t)(a) << 16 | (uint32_t)(b)) /* into FIFO 0                               \
                                                                 */
#define FDCAN_ID_STANDARD 18u
#define FDCAN_LENGTH      16u

#endif
