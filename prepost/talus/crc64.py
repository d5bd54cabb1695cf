"""CRC-64/XZ of words, as in messages of the port (manual/port.md)."""

from functools import cache

import numpy as np

POLYNOMIAL = 0xC96C5795D7870F42  # ECMA-182, lowest bit first
ONES = np.uint64(2**64 - 1)
Table = np.ndarray  # (8, 256): what byte b at place k of a remainder becomes


def apply(table: Table, value: np.ndarray) -> np.ndarray:
    """Return the remainders (n), each multiplied by the power of x that the table stands for."""
    result = np.zeros_like(value)
    for k in range(8):
        result ^= table[k][(value >> np.uint64(8 * k)) & np.uint64(255)]
    return result


@cache
def shift(level: int) -> Table:
    """Return the table of x to the power of 64 * 2**level."""
    values = np.arange(256, dtype="u8")
    places = np.array([values << np.uint64(8 * k) for k in range(8)])
    if level > 0:
        half = shift(level - 1)
        return np.array([apply(half, apply(half, row)) for row in places])
    for _ in range(64):
        odd = (places & np.uint64(1)).astype(bool)
        places = (places >> np.uint64(1)) ^ np.where(odd, np.uint64(POLYNOMIAL), np.uint64(0))
    return places


def crc64(words: np.ndarray) -> int:
    """Return the CRC-64/XZ of 64-bit words (n), lowest byte first.

    Neighbours are joined in pairs, pairs of pairs and so on, so that each level is one operation on
    arrays; zeros before the first word change nothing.
    """
    value = np.ascontiguousarray(words).view("<u8").astype("u8")
    if value.size == 0:
        return 0
    value[0] ^= ONES
    level = 0
    while value.size > 1:
        if value.size % 2:
            value = np.concatenate([np.zeros(1, dtype="u8"), value])
        value = apply(shift(level), value[0::2]) ^ value[1::2]
        level += 1
    return int(apply(shift(0), value)[0] ^ ONES)
