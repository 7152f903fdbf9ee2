/* Exception entry and return by hand, as ARMv7-M B1.5.6 to B1.5.8 say: basic and extended frames, the two
 * stacks, EXC_RETURN; and what becomes of faults. */
#ifndef TRIBEND_EMULATOR_EXCEPTIONS_H
#define TRIBEND_EMULATOR_EXCEPTIONS_H

#include "emulator/core.h"

struct nvic_masks exceptions_masks(const struct core *core);
/* Take the exception that is to run next, if there is one. */
void exceptions_take(struct core *core);
/* Pending with priority enough to end WFI, whatever PRIMASK says. */
bool exceptions_wake(const struct core *core);
/* PC holds this EXC_RETURN value. */
void exceptions_return(struct core *core, uint32_t value);
/* A synchronous fault at `pc`. */
void exceptions_fault(struct core *core, uint32_t exception, uint32_t status, uint32_t pc);
/* SVC: PC is behind it. */
void exceptions_supervisor_call(struct core *core);

#endif
