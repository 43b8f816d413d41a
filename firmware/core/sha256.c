/* SHA-256 (FIPS 180-4). */
#include "sha256.h"

#include <string.h>

enum { ROUNDS = 64, WORDS = 16, LENGTH_AT = SHA256_BLOCK - 8 };

/* Section 4.2.2: the first 32 bits of the fractional parts of the cube roots of the first 64 primes. */
static const uint32_t constants[ROUNDS] = {
    0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4, 0xab1c5ed5,
    0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe, 0x9bdc06a7, 0xc19bf174,
    0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f, 0x4a7484aa, 0x5cb0a9dc, 0x76f988da,
    0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7, 0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967,
    0x27b70a85, 0x2e1b2138, 0x4d2c6dfc, 0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85,
    0xa2bfe8a1, 0xa81a664b, 0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070,
    0x19a4c116, 0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3,
    0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7, 0xc67178f2,
};

static uint32_t rotated(uint32_t x, uint32_t bits)
{
    return (x >> bits) | (x << (32u - bits));
}

static uint32_t big_endian(const uint8_t *bytes)
{
    return ((uint32_t)bytes[0] << 24) | ((uint32_t)bytes[1] << 16) | ((uint32_t)bytes[2] << 8) | bytes[3];
}

/* Section 6.2.2, step 1, of which 16 words are kept at a time. */
static uint32_t next_word(uint32_t w[WORDS], uint32_t t)
{
    const uint32_t w15 = w[(t + 1u) % WORDS];
    const uint32_t w2 = w[(t + 14u) % WORDS];
    const uint32_t s0 = rotated(w15, 7) ^ rotated(w15, 18) ^ (w15 >> 3);
    const uint32_t s1 = rotated(w2, 17) ^ rotated(w2, 19) ^ (w2 >> 10);
    w[t % WORDS] += s0 + w[(t + 9u) % WORDS] + s1;
    return w[t % WORDS];
}

/* Section 6.2.2, steps 2 to 4. */
static void take_block(uint32_t hash[8], const uint8_t *block)
{
    uint32_t w[WORDS];
    uint32_t v[8];
    memcpy(v, hash, sizeof v);
    for (uint32_t t = 0; t < ROUNDS; t++) {
        if (t < WORDS) {
            w[t] = big_endian(block + (size_t)4 * t);
        } else {
            (void)next_word(w, t);
        }
        const uint32_t s1 = rotated(v[4], 6) ^ rotated(v[4], 11) ^ rotated(v[4], 25);
        const uint32_t choice = (v[4] & v[5]) ^ (~v[4] & v[6]);
        const uint32_t t1 = v[7] + s1 + choice + constants[t] + w[t % WORDS];
        const uint32_t s0 = rotated(v[0], 2) ^ rotated(v[0], 13) ^ rotated(v[0], 22);
        const uint32_t majority = (v[0] & v[1]) ^ (v[0] & v[2]) ^ (v[1] & v[2]);
        memmove(&v[1], &v[0], 7 * sizeof v[0]);
        v[4] += t1;
        v[0] = t1 + s0 + majority;
    }
    for (uint32_t i = 0; i < 8u; i++) {
        hash[i] += v[i];
    }
}

void sha256_begin(struct sha256 *sha)
{
    /* Section 5.3.3. */
    static const uint32_t initial[8] = {0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                        0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
    memcpy(sha->hash, initial, sizeof initial);
    sha->length = 0;
}

void sha256_update(struct sha256 *sha, const uint8_t *data, size_t length)
{
    for (size_t i = 0; i < length; i++) {
        sha->block[sha->length % SHA256_BLOCK] = data[i];
        sha->length++;
        if (sha->length % SHA256_BLOCK == 0u) {
            take_block(sha->hash, sha->block);
        }
    }
}

void sha256_end(struct sha256 *sha, uint8_t digest[SHA256_SIZE])
{
    static const uint8_t padding[SHA256_BLOCK] = {0x80};
    const uint32_t bits = sha->length * 8u;
    const uint32_t used = sha->length % SHA256_BLOCK;
    const uint32_t fill = used < LENGTH_AT ? LENGTH_AT - used : SHA256_BLOCK + LENGTH_AT - used;
    uint8_t length[8] = {
        0, 0, 0, 0, (uint8_t)(bits >> 24), (uint8_t)(bits >> 16), (uint8_t)(bits >> 8), (uint8_t)bits};
    sha256_update(sha, padding, fill);
    sha256_update(sha, length, sizeof length);
    for (uint32_t i = 0; i < SHA256_SIZE; i++) {
        digest[i] = (uint8_t)(sha->hash[i / 4u] >> (24u - 8u * (i % 4u)));
    }
}
