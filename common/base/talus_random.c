/* Random numbers without a generator: each is a hash of what it is for, so that they depend neither
   on the order in which they are asked for nor on a state that a restart would have to keep. */
#include <stdint.h>

/* The finaliser of splitmix64 (Steele, Lea, Flood 2014, https://doi.org/10.1145/2714064.2660195). */
static uint64_t mixed(uint64_t z)
{
    z += UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return z ^ (z >> 31);
}

/* From 0 (included) to 1 (excluded), for these `count` numbers; 53 bits. */
double talus_c_uniform(const int64_t *key, int32_t count)
{
    uint64_t z = 0;
    for (int32_t k = 0; k < count; k++)
        z = mixed(z ^ (uint64_t)key[k]);
    return (double)(z >> 11) * 0x1.0p-53;
}

/* Between 0 and 1 (both excluded), of a grain's id and a seed; 53 bits. Two multiples of odd numbers and
   the same finaliser. */
double talus_c_unit_number(int64_t id, int64_t seed)
{
    uint64_t z = (uint64_t)id * UINT64_C(0x9e3779b97f4a7c15)
               + (uint64_t)seed * UINT64_C(0xd1b54a32d192ed03);
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    z ^= z >> 31;
    return ((double)(z >> 11) + 0.5) * 0x1.0p-53;
}
