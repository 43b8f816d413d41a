/* Vector of FDCAN1. */
#ifndef FDCAN_H
#define FDCAN_H

void FDCAN1_IT0_Handler(void);

#endif
