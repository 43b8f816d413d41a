/* Sector 0 of an image that a probe writes: the loader, as it was linked by itself. */
    .section .loader, "a", %progbits
    .incbin LOADER_BIN

/* The first word of slot 1 as zeros: what an update left there must not be newer than what a probe writes. */
    .section .retired, "a", %progbits
    .word 0
