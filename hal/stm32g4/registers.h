/* Registers of the STM32G474 and of its Cortex-M4 core: the peripherals, registers and bits that this port
 * uses, and no others. Offsets are held by assertions at the end. What a register does is in ST's reference
 * manual RM0440 and in ARM's ARMv7-M architecture manual; what they are used for is in the driver of the same
 * name. Not for host builds: reading one of these there is a wild pointer. */
#ifndef TRIBEND_STM32G4_REGISTERS_H
#define TRIBEND_STM32G4_REGISTERS_H

#include <stddef.h>
#include <stdint.h>

typedef volatile uint32_t reg32;

/* A gap of `words` words before the register at hexadecimal offset `at`. */
#define REGISTER_GAP(at, words) uint32_t gap_##at[words]

/* --- RCC: reset and clock control --- */
struct rcc_registers {
    reg32 cr;
    reg32 icscr;
    reg32 cfgr;
    reg32 pllcfgr;
    REGISTER_GAP(18, 2);
    reg32 cier;
    reg32 cifr;
    reg32 cicr;
    REGISTER_GAP(48, 9);
    reg32 ahb1enr;
    reg32 ahb2enr;
    REGISTER_GAP(58, 2);
    reg32 apb1enr1;
    reg32 apb1enr2;
    reg32 apb2enr;
    REGISTER_GAP(88, 9);
    reg32 ccipr;
    REGISTER_GAP(94, 2);
    reg32 csr;
};
#define RCC_ADDRESS 0x40021000u
#define RCC_CR_HSEON (1u << 16)
#define RCC_CR_HSERDY (1u << 17)
#define RCC_CR_CSSON (1u << 19)
#define RCC_CR_PLLON (1u << 24)
#define RCC_CR_PLLRDY (1u << 25)
#define RCC_CFGR_SW_MASK 3u
#define RCC_CFGR_SW_HSI 1u
#define RCC_CFGR_SW_PLL 3u
#define RCC_CFGR_SWS_SHIFT 2u
#define RCC_CFGR_HPRE_MASK (15u << 4)
#define RCC_CFGR_HPRE_HALF (8u << 4)
#define RCC_PLLCFGR_SRC_HSI 2u
#define RCC_PLLCFGR_SRC_HSE 3u
#define RCC_PLLCFGR_M_SHIFT 4u /* value is the divider less one */
#define RCC_PLLCFGR_N_SHIFT 8u
#define RCC_PLLCFGR_REN (1u << 24) /* R divides by 2 when its field is 0 */
#define RCC_CIFR_CSSF (1u << 8)
#define RCC_CICR_CSSC (1u << 8)
#define RCC_AHB1ENR_DMA1 (1u << 0)
#define RCC_AHB1ENR_DMAMUX1 (1u << 2)
#define RCC_AHB2ENR_GPIOA (1u << 0)
#define RCC_AHB2ENR_GPIOB (1u << 1)
#define RCC_AHB2ENR_GPIOC (1u << 2)
#define RCC_AHB2ENR_ADC12 (1u << 13)
#define RCC_APB1ENR1_TIM2 (1u << 0)
#define RCC_APB1ENR1_TIM3 (1u << 1)
#define RCC_APB1ENR1_USART3 (1u << 18)
#define RCC_APB1ENR1_FDCAN (1u << 25)
#define RCC_APB1ENR1_PWR (1u << 28)
#define RCC_APB2ENR_SYSCFG (1u << 0)
#define RCC_APB2ENR_TIM1 (1u << 11)
#define RCC_CCIPR_FDCANSEL_MASK (3u << 24)
#define RCC_CCIPR_FDCANSEL_PCLK1 (2u << 24)
#define RCC_CSR_RMVF (1u << 23)
#define RCC_CSR_BORRSTF (1u << 27)
#define RCC_CSR_IWDGRSTF (1u << 29)

/* --- PWR: regulator range and supply supervision --- */
struct pwr_registers {
    reg32 cr1;
    reg32 cr2;
    REGISTER_GAP(14, 3);
    reg32 sr2;
    REGISTER_GAP(80, 26);
    reg32 cr5;
};
#define PWR_ADDRESS 0x40007000u
#define PWR_CR2_PVDE (1u << 0)
#define PWR_CR2_PLS_2V9 (6u << 1)
#define PWR_SR2_VOSF (1u << 10)
#define PWR_SR2_PVDO (1u << 11)
#define PWR_CR5_R1MODE (1u << 8) /* clear: boost, needed over 150 MHz */

/* --- FLASH --- */
struct flash_registers {
    reg32 acr;
    REGISTER_GAP(08, 1);
    reg32 keyr;
    reg32 optkeyr;
    reg32 sr;
    reg32 cr;
    reg32 eccr;
    REGISTER_GAP(20, 1);
    reg32 optr;
};
#define FLASH_ADDRESS 0x40022000u
#define FLASH_ACR_LATENCY_MASK 15u
#define FLASH_ACR_LATENCY_170MHZ 4u
#define FLASH_ACR_PRFTEN (1u << 8)
#define FLASH_ACR_ICEN (1u << 9)
#define FLASH_ACR_DCEN (1u << 10)
#define FLASH_ACR_DCRST (1u << 12)
#define FLASH_KEY_1 0x45670123u
#define FLASH_KEY_2 0xcdef89abu
#define FLASH_SR_EOP (1u << 0)
#define FLASH_SR_ERRORS 0xc3fau /* OPERR PROGERR WRPERR PGAERR SIZERR PGSERR MISERR FASTERR RDERR OPTVERR */
#define FLASH_SR_BSY (1u << 16)
#define FLASH_CR_PG (1u << 0)
#define FLASH_CR_PER (1u << 1)
#define FLASH_CR_PNB_SHIFT 3u
#define FLASH_CR_BKER (1u << 11)
#define FLASH_CR_STRT (1u << 16)
#define FLASH_CR_LOCK (1u << 31)
#define FLASH_ECCR_ADDRESS_MASK 0x7ffffu
#define FLASH_ECCR_BK_ECC (1u << 21)
#define FLASH_ECCR_SYSF_ECC (1u << 22)
#define FLASH_ECCR_ECCD2 (1u << 29)
#define FLASH_ECCR_ECCD (1u << 31)
#define FLASH_OPTR_BOR_LEV_SHIFT 8u
#define FLASH_OPTR_BOR_LEV_MASK 7u
#define FLASH_OPTR_BOR_LEV_2V8 4u
#define FLASH_OPTR_DBANK (1u << 22)

/* --- GPIO --- */
struct gpio_registers {
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
#define GPIOA_ADDRESS 0x48000000u
#define GPIOB_ADDRESS 0x48000400u
#define GPIOC_ADDRESS 0x48000800u
#define GPIO_MODE_OUTPUT 1u
#define GPIO_MODE_ALTERNATE 2u
#define GPIO_MODE_ANALOG 3u
#define GPIO_PULL_UP 1u
#define GPIO_PULL_DOWN 2u

/* --- TIM1 (advanced), TIM2 (32 bits), TIM3 (general) --- */
struct tim_registers {
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
    REGISTER_GAP(60, 6);
    reg32 af1;
};
#define TIM1_ADDRESS 0x40012c00u
#define TIM2_ADDRESS 0x40000000u
#define TIM3_ADDRESS 0x40000400u
#define TIM_CR1_CEN (1u << 0)
#define TIM_CR1_URS (1u << 2)
#define TIM_CR1_ARPE (1u << 7)
#define TIM_CR2_MMS_OC4REF (7u << 4)
#define TIM_DIER_UIE (1u << 0)
#define TIM_SR_UIF (1u << 0)
#define TIM_EGR_UG (1u << 0)
#define TIM_CCMR_LOW_PWM1 0x0068u  /* channel 1 or 3: PWM mode 1 (on below the compare value), preloaded */
#define TIM_CCMR_HIGH_PWM1 0x6800u /* channel 2 or 4 */
#define TIM_CCMR_HIGH_PWM2 0x7800u /* channel 4: on from the compare value on */
#define TIM_CCMR_PRELOADS 0x0808u
#define TIM_CCER_CC1E (1u << 0)
#define TIM_CCER_CC2E (1u << 4)
#define TIM_CCER_CC3E (1u << 8)
#define TIM_BDTR_OSSI (1u << 10) /* outputs are driven to their idle level, low, while MOE is off */
#define TIM_BDTR_OSSR (1u << 11)
#define TIM_BDTR_BKE (1u << 12)
#define TIM_BDTR_BKP (1u << 13)
#define TIM_BDTR_MOE (1u << 15)

/* --- ADC1 --- */
struct adc_registers {
    reg32 isr;
    reg32 ier;
    reg32 cr;
    reg32 cfgr;
    reg32 cfgr2;
    reg32 smpr1;
    reg32 smpr2;
    REGISTER_GAP(30, 5);
    reg32 sqr1;
    reg32 sqr2;
    REGISTER_GAP(40, 2);
    reg32 dr;
};
struct adc_common_registers {
    REGISTER_GAP(08, 2);
    reg32 ccr;
};
#define ADC1_ADDRESS 0x50000000u
#define ADC12_COMMON_ADDRESS 0x50000300u
#define ADC_ISR_ADRDY (1u << 0)
#define ADC_CR_ADEN (1u << 0)
#define ADC_CR_ADSTART (1u << 2)
#define ADC_CR_ADSTP (1u << 4)
#define ADC_CR_ADVREGEN (1u << 28)
#define ADC_CR_ADCAL (1u << 31)
#define ADC_CFGR_DMAEN (1u << 0)
#define ADC_CFGR_DMACFG_CIRCULAR (1u << 1)
#define ADC_CFGR_EXTSEL_TIM3_TRGO (4u << 5)
#define ADC_CFGR_EXTEN_RISING (1u << 10)
#define ADC_CFGR_OVRMOD (1u << 12)
#define ADC_CFGR2_ROVSE (1u << 0)
#define ADC_CFGR2_OVSR_16 (3u << 2)
#define ADC_SAMPLE_47_5 4u
#define ADC_SAMPLE_247_5 6u
#define ADC_CCR_CKMODE_QUARTER (3u << 16)
#define ADC_CCR_VREFEN (1u << 22)

/* Factory reading of the internal reference, 12 bits, at a reference voltage of 3.0 V and 30 degrees C. */
#define VREFINT_CALIBRATION_ADDRESS 0x1fff75aau

/* --- DMA1 channel 1 and its request multiplexer --- */
struct dma_registers {
    reg32 isr;
    reg32 ifcr;
    reg32 ccr1;
    reg32 cndtr1;
    reg32 cpar1;
    reg32 cmar1;
};
#define DMA1_ADDRESS 0x40020000u
#define DMAMUX1_CHANNEL0_ADDRESS 0x40020800u
#define DMA_ISR_TCIF1 (1u << 1)
#define DMA_ISR_HTIF1 (1u << 2)
#define DMA_ISR_TEIF1 (1u << 3)
#define DMA_CCR_EN (1u << 0)
#define DMA_CCR_CIRC (1u << 5)
#define DMA_CCR_MINC (1u << 7)
#define DMA_CCR_PSIZE_16 (1u << 8)
#define DMA_CCR_MSIZE_16 (1u << 10)
#define DMA_CCR_PL_HIGH (2u << 12)
#define DMAMUX_REQUEST_ADC1 5u

/* --- USART3 --- */
struct usart_registers {
    reg32 cr1;
    reg32 cr2;
    reg32 cr3;
    reg32 brr;
    REGISTER_GAP(1c, 3);
    reg32 isr;
    reg32 icr;
    reg32 rdr;
};
#define USART3_ADDRESS 0x40004800u
#define USART_CR1_UE (1u << 0)
#define USART_CR1_RE (1u << 2)
#define USART_CR1_RXNEIE (1u << 5)
#define USART_CR3_EIE (1u << 0)
#define USART_ISR_FE (1u << 1)
#define USART_ISR_NE (1u << 2)
#define USART_ISR_ORE (1u << 3)
#define USART_ISR_RXNE (1u << 5)
#define USART_ICR_ERRORS 0x0fu /* parity, framing, noise, overrun */

/* --- FDCAN1 and its part of the message memory --- */
struct fdcan_registers {
    REGISTER_GAP(00c, 3);
    reg32 dbtp;
    REGISTER_GAP(018, 2);
    reg32 cccr;
    reg32 nbtp;
    REGISTER_GAP(040, 8);
    reg32 ecr;
    reg32 psr;
    reg32 tdcr;
    REGISTER_GAP(050, 1);
    reg32 ir;
    reg32 ie;
    reg32 ils;
    reg32 ile;
    REGISTER_GAP(080, 8);
    reg32 rxgfc;
    REGISTER_GAP(090, 3);
    reg32 rxf0s;
    reg32 rxf0a;
    REGISTER_GAP(0c0, 10);
    reg32 txbc;
    reg32 txfqs;
    reg32 txbrp;
    reg32 txbar;
    reg32 txbcr;
    reg32 txbto;
    reg32 txbcf;
    reg32 txbtie;
};
#define FDCAN1_ADDRESS 0x40006400u
#define FDCAN_CCCR_INIT (1u << 0)
#define FDCAN_CCCR_CCE (1u << 1)
#define FDCAN_CCCR_FDOE (1u << 8)
#define FDCAN_CCCR_BRSE (1u << 9)
#define FDCAN_DBTP_TDC (1u << 23)
#define FDCAN_DBTP_DBRP_SHIFT 16u
#define FDCAN_DBTP_DTSEG1_SHIFT 8u
#define FDCAN_DBTP_DTSEG2_SHIFT 4u
#define FDCAN_NBTP_NSJW_SHIFT 25u
#define FDCAN_NBTP_NBRP_SHIFT 16u
#define FDCAN_NBTP_NTSEG1_SHIFT 8u
#define FDCAN_TDCR_TDCO_SHIFT 8u
#define FDCAN_ECR_TEC_MASK 0xffu
#define FDCAN_ECR_REC_SHIFT 8u
#define FDCAN_ECR_REC_MASK 0x7fu
#define FDCAN_PSR_EP (1u << 5)
#define FDCAN_PSR_BO (1u << 7)
#define FDCAN_IR_RF0N (1u << 0)
#define FDCAN_IR_RF0L (1u << 2)
#define FDCAN_IR_TC (1u << 7)
#define FDCAN_IR_BO (1u << 19)
#define FDCAN_IR_ALL 0x00ffffffu
#define FDCAN_ILE_EINT0 (1u << 0)
#define FDCAN_RXGFC_RRFE (1u << 0)
#define FDCAN_RXGFC_RRFS (1u << 1)
#define FDCAN_RXGFC_ANFE_REJECT (2u << 2)
#define FDCAN_RXGFC_ANFS_REJECT (2u << 4)
#define FDCAN_RXGFC_LSS_SHIFT 16u
#define FDCAN_RXF0S_FILL_MASK 0xfu
#define FDCAN_RXF0S_GET_SHIFT 8u
#define FDCAN_TXFQS_FREE_MASK 7u
#define FDCAN_TXFQS_PUT_SHIFT 16u
#define FDCAN_INDEX_MASK 3u

#define FDCAN_STANDARD_FILTERS 28u
#define FDCAN_EXTENDED_FILTERS 8u
#define FDCAN_BUFFERS 3u
#define FDCAN_DATA_WORDS 16u
struct fdcan_element {
    reg32 id;      /* bits 30 extended, 29 remote; a standard id stands at bit 18 */
    reg32 control; /* bits 21 FD format, 20 rate switch, 19..16 length code */
    reg32 data[FDCAN_DATA_WORDS];
};
struct fdcan_memory {
    reg32 standard_filter[FDCAN_STANDARD_FILTERS];
    reg32 extended_filter[FDCAN_EXTENDED_FILTERS][2];
    struct fdcan_element receive[2][FDCAN_BUFFERS];
    reg32 transmit_event[FDCAN_BUFFERS][2];
    struct fdcan_element transmit[FDCAN_BUFFERS];
};
#define FDCAN1_MEMORY_ADDRESS 0x4000a400u
#define FDCAN_ID_EXTENDED (1u << 30)
#define FDCAN_ID_REMOTE (1u << 29)
#define FDCAN_ID_STANDARD_SHIFT 18u
#define FDCAN_CONTROL_FD (1u << 21)
#define FDCAN_CONTROL_RATE_SWITCH (1u << 20)
#define FDCAN_CONTROL_LENGTH_SHIFT 16u
#define FDCAN_CONTROL_LENGTH_MASK 15u
#define FDCAN_FILTER_CLASSIC (2u << 30) /* id and mask */
#define FDCAN_FILTER_TO_FIFO0 (1u << 27)
#define FDCAN_FILTER_ID_SHIFT 16u

/* --- IWDG: the independent watchdog, on the 32 kHz oscillator --- */
struct iwdg_registers {
    reg32 kr;
    reg32 pr;
    reg32 rlr;
    reg32 sr;
};
#define IWDG_ADDRESS 0x40003000u
#define IWDG_KEY_START 0xccccu
#define IWDG_KEY_WRITE 0x5555u
#define IWDG_KEY_FEED 0xaaaau
#define IWDG_PR_DIVIDE_4 0u
#define IWDG_SR_UPDATING 3u

/* --- SYSCFG, EXTI, DBGMCU: what else can switch the valves off --- */
struct syscfg_registers {
    REGISTER_GAP(1c, 7);
    reg32 cfgr2;
};
#define SYSCFG_ADDRESS 0x40010000u
#define SYSCFG_CFGR2_CLL (1u << 0)  /* a core that is locked up breaks TIM1 */
#define SYSCFG_CFGR2_PVDL (1u << 2) /* so does a supply under the detector's level */

struct exti_registers {
    reg32 imr1;
    reg32 emr1;
    reg32 rtsr1;
    reg32 ftsr1;
    reg32 swier1;
    reg32 pr1;
};
#define EXTI_ADDRESS 0x40010400u
#define EXTI_LINE_PVD (1u << 16)

struct dbgmcu_registers {
    REGISTER_GAP(08, 2);
    reg32 apb1fzr1;
    REGISTER_GAP(10, 1);
    reg32 apb2fz;
};
#define DBGMCU_ADDRESS 0xe0042000u
#define DBGMCU_APB1FZR1_TIM2 (1u << 0)
#define DBGMCU_APB1FZR1_TIM3 (1u << 1)
#define DBGMCU_APB1FZR1_IWDG (1u << 12)
#define DBGMCU_APB2FZ_TIM1 (1u << 11)

/* --- the core: system control block, interrupt controller --- */
struct scb_registers {
    reg32 cpuid;
    reg32 icsr;
    reg32 vtor;
    reg32 aircr;
    reg32 scr;
    reg32 ccr;
    reg32 shpr[3];
    reg32 shcsr;
    reg32 cfsr;
    reg32 hfsr;
    reg32 dfsr;
    reg32 mmfar;
    reg32 bfar;
    REGISTER_GAP(88, 19);
    reg32 cpacr;
};
#define SCB_ADDRESS 0xe000ed00u
#define SCB_AIRCR_RESET 0x05fa0004u
#define SCB_CCR_DIV_0_TRP (1u << 4)
#define SCB_SHCSR_FAULTS (7u << 16) /* memory, bus and usage faults of their own */
#define SCB_CPACR_FPU (15u << 20)

struct nvic_registers {
    reg32 iser[8];
    REGISTER_GAP(080, 24);
    reg32 icer[8];
};
#define NVIC_ADDRESS 0xe000e100u
#define NVIC_PRIORITY_ADDRESS 0xe000e400u /* a byte an interrupt, the upper four bits count */
#define NVIC_PRIORITY_SHIFT 4u

#define IRQ_PVD 1u
#define IRQ_FDCAN1_IT0 21u
#define IRQ_TIM3 29u
#define IRQ_USART3 39u
#define IRQ_COUNT 40u /* vectors up to the last that is used */

#define RCC ((struct rcc_registers *)RCC_ADDRESS)
#define PWR ((struct pwr_registers *)PWR_ADDRESS)
#define FLASH ((struct flash_registers *)FLASH_ADDRESS)
#define GPIOA ((struct gpio_registers *)GPIOA_ADDRESS)
#define GPIOB ((struct gpio_registers *)GPIOB_ADDRESS)
#define GPIOC ((struct gpio_registers *)GPIOC_ADDRESS)
#define TIM1 ((struct tim_registers *)TIM1_ADDRESS)
#define TIM2 ((struct tim_registers *)TIM2_ADDRESS)
#define TIM3 ((struct tim_registers *)TIM3_ADDRESS)
#define ADC1 ((struct adc_registers *)ADC1_ADDRESS)
#define ADC12_COMMON ((struct adc_common_registers *)ADC12_COMMON_ADDRESS)
#define DMA1 ((struct dma_registers *)DMA1_ADDRESS)
#define DMAMUX1_CHANNEL0 ((reg32 *)DMAMUX1_CHANNEL0_ADDRESS)
#define USART3 ((struct usart_registers *)USART3_ADDRESS)
#define FDCAN1 ((struct fdcan_registers *)FDCAN1_ADDRESS)
#define FDCAN1_MEMORY ((struct fdcan_memory *)FDCAN1_MEMORY_ADDRESS)
#define IWDG ((struct iwdg_registers *)IWDG_ADDRESS)
#define SYSCFG ((struct syscfg_registers *)SYSCFG_ADDRESS)
#define EXTI ((struct exti_registers *)EXTI_ADDRESS)
#define DBGMCU ((struct dbgmcu_registers *)DBGMCU_ADDRESS)
#define SCB ((struct scb_registers *)SCB_ADDRESS)
#define NVIC ((struct nvic_registers *)NVIC_ADDRESS)
#define NVIC_PRIORITY ((volatile uint8_t *)NVIC_PRIORITY_ADDRESS)

#define REGISTER_AT(block, name, offset)                                                                     \
    _Static_assert(offsetof(struct block, name) == (offset), #block "." #name " is misplaced")
REGISTER_AT(rcc_registers, cier, 0x18u);
REGISTER_AT(rcc_registers, ahb1enr, 0x48u);
REGISTER_AT(rcc_registers, apb2enr, 0x60u);
REGISTER_AT(rcc_registers, ccipr, 0x88u);
REGISTER_AT(rcc_registers, csr, 0x94u);
REGISTER_AT(pwr_registers, sr2, 0x14u);
REGISTER_AT(pwr_registers, cr5, 0x80u);
REGISTER_AT(flash_registers, keyr, 0x08u);
REGISTER_AT(flash_registers, optr, 0x20u);
REGISTER_AT(gpio_registers, afr, 0x20u);
REGISTER_AT(tim_registers, ccr, 0x34u);
REGISTER_AT(tim_registers, af1, 0x60u);
REGISTER_AT(adc_registers, sqr1, 0x30u);
REGISTER_AT(adc_registers, dr, 0x40u);
REGISTER_AT(adc_common_registers, ccr, 0x08u);
REGISTER_AT(dma_registers, cmar1, 0x14u);
REGISTER_AT(usart_registers, isr, 0x1cu);
REGISTER_AT(usart_registers, rdr, 0x24u);
REGISTER_AT(fdcan_registers, dbtp, 0x0cu);
REGISTER_AT(fdcan_registers, cccr, 0x18u);
REGISTER_AT(fdcan_registers, ecr, 0x40u);
REGISTER_AT(fdcan_registers, ir, 0x50u);
REGISTER_AT(fdcan_registers, rxgfc, 0x80u);
REGISTER_AT(fdcan_registers, rxf0s, 0x90u);
REGISTER_AT(fdcan_registers, txbc, 0xc0u);
REGISTER_AT(fdcan_registers, txbtie, 0xdcu);
REGISTER_AT(fdcan_memory, extended_filter, 0x70u);
REGISTER_AT(fdcan_memory, receive, 0xb0u);
REGISTER_AT(fdcan_memory, transmit_event, 0x260u);
REGISTER_AT(fdcan_memory, transmit, 0x278u);
REGISTER_AT(syscfg_registers, cfgr2, 0x1cu);
REGISTER_AT(exti_registers, pr1, 0x14u);
REGISTER_AT(dbgmcu_registers, apb2fz, 0x10u);
REGISTER_AT(scb_registers, shcsr, 0x24u);
REGISTER_AT(scb_registers, bfar, 0x38u);
REGISTER_AT(scb_registers, cpacr, 0x88u);
REGISTER_AT(nvic_registers, icer, 0x80u);

#endif
