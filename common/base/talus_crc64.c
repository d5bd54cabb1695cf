/* CRC-64/XZ (ECMA-182 polynomial, reflected): finds every burst of up to 64 bits, and every two and
   three flipped bits of up to 1 GB (P. Koopman: Hamming distance 4 up to 8 589 606 850 bits).

   Sixteen bytes a look-up by tables; with carry-less multiplication, where the processor has it, four
   blocks of 16 bytes, or four pairs, are carried forward side by side (V. Gopal et al., Fast CRC
   computation for generic polynomials using PCLMULQDQ, Intel 2009). All give the same number. */
#include <pthread.h>
#include <stdint.h>
#include <string.h>
#if defined(__x86_64__)
#include <immintrin.h>
#endif

#define POLYNOMIAL UINT64_C(0xC96C5795D7870F42)

enum { SLICES = 16, BLOCK = 16, LANES = 4 };

uint64_t talus_crc64_bytes(const void *data, int64_t bytes, uint64_t before);
uint64_t talus_crc64_by_tables(const void *data, int64_t bytes, uint64_t before);

/* table[s][b]: remainder of the byte b with s zero bytes behind it. */
static uint64_t table[SLICES][256];
static pthread_once_t made = PTHREAD_ONCE_INIT;

static uint64_t times_x(uint64_t remainder)
{
    return (remainder >> 1) ^ ((remainder & 1) ? POLYNOMIAL : 0);
}

static void make_table(void)
{
    for (uint64_t byte = 0; byte < 256; byte++) {
        table[0][byte] = byte;
        for (int bit = 0; bit < 8; bit++)
            table[0][byte] = times_x(table[0][byte]);
    }
    for (int s = 1; s < SLICES; s++)
        for (int byte = 0; byte < 256; byte++) {
            const uint64_t last = table[s - 1][byte];
            table[s][byte] = (last >> 8) ^ table[0][last & 255];
        }
}

/* The lowest byte comes first, whatever the order of bytes in this machine. */
static uint64_t word_at(const unsigned char *p)
{
    uint64_t word = 0;
    for (int k = 0; k < 8; k++)
        word |= (uint64_t)p[k] << (8 * k);
    return word;
}

static uint64_t look_up(uint64_t word, int slice)
{
    uint64_t sum = 0;
    for (int k = 0; k < 8; k++)
        sum ^= table[slice + 7 - k][(word >> (8 * k)) & 255];
    return sum;
}

static uint64_t by_tables(const unsigned char *p, int64_t bytes, uint64_t crc)
{
    for (; bytes >= BLOCK; bytes -= BLOCK, p += BLOCK)
        crc = look_up(word_at(p) ^ crc, 8) ^ look_up(word_at(p + 8), 0);
    for (; bytes > 0; bytes--, p++)
        crc = (crc >> 8) ^ table[0][(crc ^ *p) & 255];
    return crc;
}

#if defined(__x86_64__)
/* x**power modulo the polynomial; the highest bit is x**0. */
static uint64_t power_of_x(int power)
{
    uint64_t remainder = UINT64_C(1) << 63;
    for (int k = 0; k < power; k++)
        remainder = times_x(remainder);
    return remainder;
}

static __m128i factors(int bits)
{
    return _mm_set_epi64x((long long)power_of_x(bits - 1), (long long)power_of_x(bits + 63));
}

/* A block carried forward, added to the one that it meets there. */
__attribute__((target("pclmul,sse2"))) static __m128i carry(__m128i block, __m128i by, __m128i to)
{
    const __m128i low = _mm_clmulepi64_si128(block, by, 0x00);
    const __m128i high = _mm_clmulepi64_si128(block, by, 0x11);
    return _mm_xor_si128(to, _mm_xor_si128(low, high));
}

static __m128i block_at(const unsigned char *p)
{
    return _mm_loadu_si128((const __m128i *)(const void *)p);
}

/* Of at least LANES blocks; bytes behind the last whole block are left: *done says how many. */
__attribute__((target("pclmul,sse2"))) static uint64_t by_products(const unsigned char *p,
                                                                   int64_t bytes, uint64_t crc,
                                                                   const __m128i factor[2],
                                                                   int64_t *done)
{
    __m128i lane[LANES];
    unsigned char rest[BLOCK];
    int64_t k = LANES * BLOCK;

    for (int l = 0; l < LANES; l++)
        lane[l] = block_at(p + l * BLOCK);
    lane[0] = _mm_xor_si128(lane[0], _mm_set_epi64x(0, (long long)crc));
    for (; k + LANES * BLOCK <= bytes; k += LANES * BLOCK)
        for (int l = 0; l < LANES; l++)
            lane[l] = carry(lane[l], factor[0], block_at(p + k + l * BLOCK));
    for (int l = 1; l < LANES; l++)
        lane[0] = carry(lane[0], factor[1], lane[l]);
    for (; k + BLOCK <= bytes; k += BLOCK)
        lane[0] = carry(lane[0], factor[1], block_at(p + k));
    _mm_storeu_si128((__m128i *)(void *)rest, lane[0]);
    *done = k;
    return by_tables(rest, BLOCK, 0);
}

#define WIDE __attribute__((target("vpclmulqdq,avx2")))

WIDE static __m256i carry_two(__m256i blocks, __m256i by, __m256i to)
{
    const __m256i low = _mm256_clmulepi64_epi128(blocks, by, 0x00);
    const __m256i high = _mm256_clmulepi64_epi128(blocks, by, 0x11);
    return _mm256_xor_si256(to, _mm256_xor_si256(low, high));
}

/* Two blocks a lane. What is left of `bytes`, a multiple of the step, has their remainder. */
WIDE static void by_wide_products(const unsigned char *p, int64_t bytes, uint64_t crc, __m128i factor,
                                  unsigned char left[2 * LANES * BLOCK])
{
    const __m256i by = _mm256_broadcastsi128_si256(factor);
    __m256i lane[LANES];

    for (int l = 0; l < LANES; l++)
        lane[l] = _mm256_loadu_si256((const __m256i *)(const void *)(p + 2 * l * BLOCK));
    lane[0] = _mm256_xor_si256(lane[0], _mm256_set_epi64x(0, 0, 0, (long long)crc));
    for (int64_t k = 2 * LANES * BLOCK; k < bytes; k += 2 * LANES * BLOCK)
        for (int l = 0; l < LANES; l++)
            lane[l] = carry_two(lane[l], by, _mm256_loadu_si256(
                (const __m256i *)(const void *)(p + k + 2 * l * BLOCK)));
    for (int l = 0; l < LANES; l++)
        _mm256_storeu_si256((__m256i *)(void *)(left + 2 * l * BLOCK), lane[l]);
}

static __m128i factor[3];    /* over all lanes, over one block, over all lanes of two blocks */
static int products, widely; /* whether the processor has carry-less multiplication */

static uint64_t in_blocks(const unsigned char *p, int64_t bytes, uint64_t crc, int64_t *done)
{
    enum { STEP = 2 * LANES * BLOCK };
    unsigned char left[STEP];

    if (widely && bytes >= 4 * STEP) {
        const int64_t whole = bytes / STEP * STEP;
        by_wide_products(p, whole, crc, factor[2], left);
        crc = by_products(left, STEP, 0, factor, done);
        *done = whole;
        return crc;
    }
    if (products && bytes >= STEP)
        crc = by_products(p, bytes, crc, factor, done);
    return crc;
}

static void prepare(void)
{
    make_table();
    products = __builtin_cpu_supports("pclmul") != 0;
    factor[0] = factors(8 * LANES * BLOCK);
    factor[1] = factors(8 * BLOCK);
    factor[2] = factors(8 * 2 * LANES * BLOCK);
    widely = products && __builtin_cpu_supports("vpclmulqdq") && __builtin_cpu_supports("avx2");
}
#else
static void prepare(void)
{
    make_table();
}
#endif

/* The CRC of the bytes behind those whose CRC is `before`, which is 0 at the start. */
uint64_t talus_crc64_bytes(const void *data, int64_t bytes, uint64_t before)
{
    const unsigned char *p = data;
    uint64_t crc = ~before;
    int64_t done = 0;

    pthread_once(&made, prepare);
#if defined(__x86_64__)
    crc = in_blocks(p, bytes, crc, &done);
#endif
    return ~by_tables(p + done, bytes - done, crc);
}

/* The same by tables alone, as on processors without carry-less multiplication. */
uint64_t talus_crc64_by_tables(const void *data, int64_t bytes, uint64_t before)
{
    pthread_once(&made, prepare);
    return ~by_tables(data, bytes, ~before);
}
