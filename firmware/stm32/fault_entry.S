/* Entry of every fault and of every unexpected interrupt, and the one load that may fault. */
    .syntax unified
    .cpu cortex-m4
    .thumb

    .equ CFSR, 0xE000ED28               /* PM0214 section 4.4.10; HFSR is the next word */
    .equ FRAME_PC, 24                   /* place of the stacked PC, PM0214 section 2.3.7 */
    .equ FRAME_SIZE, 32
    .equ HANDLER_STACK, 256             /* what record_fault needs at most */

/* bool guarded_read(uint32_t address, uint32_t *out): false if the bus answers with an error.
 * Other parts of the family lack some of the registers that identify a device. */
    .section .text.guarded_read, "ax", %progbits
    .global guarded_read
    .type guarded_read, %function
guarded_read:
guarded_load:
    ldr     r2, [r0]
    str     r2, [r1]
    movs    r0, #1
    bx      lr
guarded_absent:
    movs    r0, #0
    bx      lr
    .size guarded_read, . - guarded_read

/* Faults: the one in guarded_read is answered with "absent", every other ends in record_fault(frame). */
    .section .text.fault_entry, "ax", %progbits
    .global fault_entry
    .type fault_entry, %function
fault_entry:
    mrs     r0, msp                     /* there is only the main stack */
    ldr     r1, =__stack_limit
    cmp     r0, r1
    blo     stack_lost
    ldr     r1, =__stack_top - FRAME_SIZE
    cmp     r0, r1
    bhi     stack_lost

    ldr     r1, [r0, #FRAME_PC]
    ldr     r2, =guarded_load
    cmp     r1, r2
    bne     fatal
    ldr     r1, =guarded_absent
    str     r1, [r0, #FRAME_PC]
    ldr     r1, =CFSR                   /* its bits, and HFSR's, clear when written as read */
    ldr     r2, [r1]
    str     r2, [r1]
    ldr     r2, [r1, #4]
    str     r2, [r1, #4]
    dsb
    bx      lr

/* A fault near the end of the stack needs another place to work: the stack's top, since nothing that lies
 * there is returned to. */
fatal:
    ldr     r1, =__stack_limit + HANDLER_STACK
    cmp     r0, r1
    bhs     record_fault
    b       move_stack
stack_lost:
    movs    r0, #0
move_stack:
    ldr     r1, =__stack_top
    mov     sp, r1
    b       record_fault
    .size fault_entry, . - fault_entry

/* Each unused vector leads here; record_fault identifies it by the active exception's number. */
    .section .text.unexpected_interrupt, "ax", %progbits
    .global unexpected_interrupt
    .type unexpected_interrupt, %function
unexpected_interrupt:
    mrs     r0, msp
    b       record_fault
    .size unexpected_interrupt, . - unexpected_interrupt
