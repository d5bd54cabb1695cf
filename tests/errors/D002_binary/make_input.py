"""Write a deck that is no text: the head of an HDF5 file."""

from pathlib import Path

Path("deck.nml").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(64))
