"""Checkpoints of a partner written in Python: arrays of the accepted state in one file of numpy.

The file is NAME.TAG.chk.npz, written under another name, synced and renamed; a partner that is
killed meanwhile leaves the earlier ones as they were.
"""

import os
import zipfile
from contextlib import suppress
from pathlib import Path

import numpy as np

from talus.faults import FaultError

State = dict[str, np.ndarray]
OFFSET, PRIME, WORD = 14695981039346656037, 1099511628211, 2**64 - 1  # of FNV-1a, 64 bits
CHUNK = 1 << 20  # bytes read at a time
ENDING = ".chk.npz"


def hash_of(path: Path) -> str:
    """Return the hash of a file as the manifest of a coupled run holds it: 16 digits of FNV-1a."""
    value = OFFSET
    with path.open("rb") as file:
        while chunk := file.read(CHUNK):
            for byte in chunk:
                value = ((value ^ byte) * PRIME) & WORD
    return f"{value:016X}"


def write_checkpoint(name: str, tag: str, time: float, state: State) -> Path:
    """Write the state at a time [s] and return the file; E671 where that cannot be done."""
    path = Path(f"{name}.{tag}{ENDING}" if tag else f"{name}{ENDING}").resolve()
    hidden = path.with_name(path.name + ".new")
    try:
        with hidden.open("wb") as file:
            np.savez(file, **state, talus_time=np.float64(time), talus_partner=np.array(name))
            file.flush()
            os.fsync(file.fileno())
        os.replace(hidden, path)
    except OSError as fault:
        with suppress(OSError):
            hidden.unlink()
        text = f"the checkpoint cannot be written: {fault.strerror}"
        hint = "make room, or let it be written elsewhere"
        raise FaultError("E671", text, hint, str(path), 4) from fault
    return path


def find_checkpoint(name: str, restart: str) -> Path | None:
    """Return what HELLO's `restart` names: a file, a tag, or with `auto` the newest, if any."""
    if restart == "auto":
        files = sorted(Path().glob(f"{name}*{ENDING}"), key=lambda file: file.stat().st_mtime)
        return files[-1] if files else None
    path = Path(restart)
    return path if path.is_file() else Path(f"{name}.{restart}{ENDING}")


def read_checkpoint(name: str, path: Path) -> tuple[float, State]:
    """Return time [s] and state; E670 for what is no checkpoint of this partner."""
    try:
        with np.load(path, allow_pickle=False) as file:
            state = {key: file[key] for key in file.files}
        time, whose = float(state.pop("talus_time")), str(state.pop("talus_partner"))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as fault:
        raise FaultError("E670", f"no checkpoint of {name} can be read from it: {fault}",
                         "go on from another", str(path), 4) from fault  # fmt: skip
    if whose != name:
        raise FaultError("E670", f"it is a checkpoint of {whose}, not of {name}",
                         "go on with the partner that wrote it", str(path), 4)  # fmt: skip
    return time, state
