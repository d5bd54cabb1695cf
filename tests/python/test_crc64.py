"""The checksum of messages: published values, and the bits of the plain definition."""

import numpy as np
import pytest

from talus.crc64 import crc64


def plain(data: bytes) -> int:
    """Return the CRC-64/XZ, bit by bit."""
    crc = 2**64 - 1
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0xC96C5795D7870F42 if crc & 1 else 0)
    return crc ^ (2**64 - 1)


def test_plain_definition_has_the_published_value() -> None:
    """Check value of the catalogue of CRCs."""
    assert plain(b"123456789") == 0x995DC9BBDF1939FA


@pytest.mark.parametrize("count", [0, 1, 2, 3, 7, 16, 100])
def test_words_give_the_plain_definition(count: int) -> None:
    """Any number of words."""
    words = np.random.default_rng(count).integers(0, 2**64, count, dtype="u8")
    assert crc64(words) == plain(words.tobytes())


def test_words_of_zeros() -> None:
    """Leading zeros count."""
    assert crc64(np.zeros(3, dtype="<i8")) == plain(bytes(24)) != plain(bytes(16))
