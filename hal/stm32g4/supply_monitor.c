#include "stm32g4/supply_monitor.h"

#include "stm32g4/core.h"
#include "stm32g4/faults.h"
#include "stm32g4/handlers.h"
#include "stm32g4/registers.h"
#include "stm32g4/valves.h"

void supply_monitor_start(void) {
    PWR->cr2 = PWR_CR2_PLS_2V9 | PWR_CR2_PVDE;
    EXTI->rtsr1 |= EXTI_LINE_PVD; /* the detector's output rises when the supply falls */
    EXTI->imr1 |= EXTI_LINE_PVD;
    core_enable_interrupt(IRQ_PVD, 0u);
}

bool supply_monitor_brown_out_is_set(void) {
    return ((FLASH->optr >> FLASH_OPTR_BOR_LEV_SHIFT) & FLASH_OPTR_BOR_LEV_MASK) == FLASH_OPTR_BOR_LEV_2V8;
}

void handler_pvd(void) {
    valves_shut();
    EXTI->pr1 = EXTI_LINE_PVD;
    if ((PWR->sr2 & PWR_SR2_PVDO) != 0u) {
        faults_stop(CRASH_SUPPLY_DIP, 0u);
    }
}
