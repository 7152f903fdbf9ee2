/* The interrupt and fault handlers, by the names that the vector table (startup.c) has them; each is in its
 * driver's file. */
#ifndef TRIBEND_STM32G4_HANDLERS_H
#define TRIBEND_STM32G4_HANDLERS_H

void handler_reset(void);
void handler_nmi(void);
void handler_fault(void);      /* hard, memory, bus and usage faults */
void handler_unexpected(void); /* every vector that is not used */
void handler_pvd(void);
void handler_tim3(void);
void handler_usart3(void);
void handler_fdcan1(void);

#endif
