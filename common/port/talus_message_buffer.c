/* Byte copy and checksum of port messages. */
#include <stdint.h>
#include <string.h>

void talus_copy_bytes(void *to, const void *from, int64_t bytes);
void talus_text_to_words(uint64_t *word, const char *text, int64_t bytes);
void talus_words_to_text(char *text, const uint64_t *word, int64_t bytes);
uint64_t talus_checksum(const uint64_t *word, int64_t count);

void talus_copy_bytes(void *to, const void *from, int64_t bytes)
{
    if (bytes > 0)
        memcpy(to, from, (size_t)bytes);
}

void talus_text_to_words(uint64_t *word, const char *text, int64_t bytes)
{
    talus_copy_bytes(word, text, bytes);
}

void talus_words_to_text(char *text, const uint64_t *word, int64_t bytes)
{
    talus_copy_bytes(text, word, bytes);
}

/* s1 = sum w_k, s2 = sum (k + 1) w_k, both modulo 2^64; result s1 xor (s2 turned by 32 bits).
   Sixteen lanes keep the sums independent; modular sums do not depend on the order. */
enum { LANES = 16 };

uint64_t talus_checksum(const uint64_t *word, int64_t count)
{
    uint64_t a[LANES] = {0}, b[LANES] = {0}, s1 = 0, s2 = 0;
    const uint64_t blocks = (uint64_t)count / LANES;

    for (uint64_t j = 0; j < blocks; j++)
        for (int l = 0; l < LANES; l++) {
            a[l] += word[j * LANES + (uint64_t)l];
            b[l] += a[l];
        }
    for (int l = 0; l < LANES; l++) {
        s1 += a[l];
        s2 += ((uint64_t)l + 1) * a[l] + LANES * (blocks * a[l] - b[l]);
    }
    for (uint64_t k = blocks * LANES; k < (uint64_t)count; k++) {
        s1 += word[k];
        s2 += (k + 1) * word[k];
    }
    return s1 ^ ((s2 << 32) | (s2 >> 32));
}
