/* Vectors of CAN1. */
#ifndef BXCAN_H
#define BXCAN_H

void CAN1_TX_Handler(void);
void CAN1_RX0_Handler(void);
void CAN1_SCE_Handler(void);

#endif
