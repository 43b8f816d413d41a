/* SHA-256 (FIPS 180-4). */
#ifndef SHA256_H
#define SHA256_H

#include <stddef.h>
#include <stdint.h>

enum { SHA256_SIZE = 32, SHA256_BLOCK = 64 };

struct sha256 {
    uint32_t hash[8];
    uint8_t block[SHA256_BLOCK]; /* bytes that do not make a block yet */
    uint32_t length;             /* bytes so far, less than 2^29 */
};

void sha256_begin(struct sha256 *sha);
void sha256_update(struct sha256 *sha, const uint8_t *data, size_t length);
void sha256_end(struct sha256 *sha, uint8_t digest[SHA256_SIZE]);

#endif
