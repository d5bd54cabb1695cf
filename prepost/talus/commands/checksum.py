"""`talus checksum`: accept what was changed in packings, meshes, checkpoints."""

import argparse
from pathlib import Path

import h5py

from talus.checksum import has_checksum, write_checksum
from talus.faults import FaultError


def register(commands: argparse._SubParsersAction) -> None:
    """Add `checksum`."""
    new = commands.add_parser("checksum", help="write the checksum of changed files anew")
    new.add_argument("files", type=Path, nargs="+", help="packings, meshes, checkpoints")
    new.set_defaults(run=renew)


def renew(options: argparse.Namespace) -> int:
    """Write the checksum of every file anew; one that has none needs none."""
    for path in options.files:
        if not path.is_file():
            raise FaultError("E501", f"no such file: {path}")
        if not has_checksum(path):
            print(f"{path} has no checksum and is read without one")
            continue
        try:
            h5py.File(path).close()
        except OSError as fault:
            hint = "make it again or use an older one"
            raise FaultError("E508", f"{path} is damaged: {fault}", hint) from fault
        write_checksum(path)
        print(f"{path}: checksum written")
    return 0
