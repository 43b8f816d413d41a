/* CRC-32 of IEEE 802.3 (reflected, polynomial 0x04C11DB7), as in zlib. */
#ifndef CRC32_H
#define CRC32_H

#include <stddef.h>
#include <stdint.h>

/* CRC of what came before (`crc`, 0 at the start) continued over `data`. */
uint32_t crc32_update(uint32_t crc, const uint8_t *data, size_t length);

#endif
