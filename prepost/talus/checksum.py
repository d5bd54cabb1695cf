"""The checksum of packings, meshes and checkpoints: CRC-64 of an HDF5 file, in its user block.

The first 512 bytes, which HDF5 leaves to the user, hold it; all bytes behind them are covered.
Files of other programs have none.
"""

import _lzma
import contextlib
import ctypes
import os
from collections.abc import Iterator
from pathlib import Path

import h5py

from talus.faults import FaultError

ROOM = 512  # bytes before the HDF5 file itself (h5py: userblock_size)
MARK = b"talus-checksum 1\n"
CHUNK = 1 << 20


def crc64(data: bytes, before: int = 0) -> int:
    """Return the CRC-64 (ECMA-182, as in xz) of bytes that follow others of CRC-64 `before`."""
    library = ctypes.CDLL(getattr(_lzma, "__file__", None))  # finds liblzma, which Python uses
    library.lzma_crc64.restype = ctypes.c_uint64
    library.lzma_crc64.argtypes = [ctypes.c_char_p, ctypes.c_size_t, ctypes.c_uint64]
    return int(library.lzma_crc64(data, len(data), before))


def block_of(path: Path) -> bytes:
    """Return the block that the file should begin with, from the bytes behind it."""
    total, size = 0, 0
    with path.open("rb") as file:
        file.seek(ROOM)
        while part := file.read(CHUNK):
            total = crc64(part, total)
            size += len(part)
    return (MARK + f"crc64 {total:016x}\nbytes {size}\n".encode()).ljust(ROOM, b"\0")


def write_checksum(path: Path) -> None:
    """Write the checksum of a closed file that was made with room for it."""
    block = block_of(path)
    with path.open("r+b") as file:
        file.write(block)
        file.flush()
        os.fsync(file.fileno())


def has_checksum(path: Path) -> bool:
    """Whether the file begins with a checksum."""
    with path.open("rb") as file:
        return is_block(file.read(ROOM))


def is_block(block: bytes) -> bool:
    """Whether most of the mark is there: a damaged mark is one, too."""
    return sum(a == b for a, b in zip(block, MARK, strict=False)) > len(MARK) // 2


def check_checksum(path: Path) -> None:
    """Raise a fault (E508) if the file has a checksum and is not as it was written."""
    with path.open("rb") as file:
        block = file.read(ROOM)
    if is_block(block) and block != block_of(path):
        hint = f"make it again or use an older one; a change that was meant: talus checksum {path}"
        raise FaultError("E508", f"{path} is truncated or damaged: its checksum differs", hint)


@contextlib.contextmanager
def opened(path: Path) -> Iterator[h5py.File]:
    """Yield an HDF5 file for reading that is as it was written, or has no checksum."""
    check_checksum(path)
    with h5py.File(path) as file:
        yield file


@contextlib.contextmanager
def created(path: Path) -> Iterator[h5py.File]:
    """Yield a new HDF5 file; it has its checksum in the end."""
    with h5py.File(path, "w", userblock_size=ROOM) as file:
        yield file
    write_checksum(path)


@contextlib.contextmanager
def edited(path: Path | str) -> Iterator[h5py.File]:
    """Yield an HDF5 file for changes; if it has a checksum, it is written anew in the end."""
    path = Path(path)
    check_checksum(path)
    with h5py.File(path, "r+") as file:
        yield file
    if has_checksum(path):
        write_checksum(path)
