"""Files that are written whole or not at all: to a temporary name, then renamed."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

from talus.faults import FaultError


def refuse(path: Path, reason: object) -> FaultError:
    """Return the fault of a file that cannot be written, with the reason in plain words."""
    text = str(reason)
    if isinstance(reason, OSError) and reason.strerror and reason.errno:
        text = reason.strerror
    if "error message = '" in text:  # the long form of the HDF5 library
        text = text.split("error message = '")[1].split("'")[0]
    return FaultError("E501", f"cannot write {path}: {text}", exit_code=4)


@contextlib.contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """Yield a temporary name beside `path` with the same ending; rename it when all went well."""
    if path.exists() and not path.is_file():
        kind = "a folder" if path.is_dir() else "no regular file"
        raise FaultError("E501", f"cannot write {path}: it is {kind}", exit_code=4)
    temporary = path.with_name(f"{path.stem}.tmp{path.suffix}")
    try:
        yield temporary
        temporary.replace(path)
    except OSError as fault:
        raise refuse(path, fault) from fault
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_text_file(path: Path, text: str) -> None:
    """Write a text file in UTF-8."""
    with replaced(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def make_folder(path: Path) -> None:
    """Make a folder and those above it."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise refuse(path, fault) from fault
