"""CSV histories: columns `name [unit]`, read with their units."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from talus.faults import FaultError

LABEL = "test"  # title of a first column of words


@dataclass
class History:
    """Columns of a history by name, and their units."""

    path: Path
    columns: dict[str, np.ndarray]
    units: dict[str, str]

    def __getitem__(self, name: str) -> np.ndarray:
        """Return a column, or raise a fault that names those there are."""
        if name not in self.columns:
            raise FaultError(
                "E546", f"{self.path} has no column '{name}'", f"it has: {', '.join(self.columns)}"
            )
        return self.columns[name]

    def of_unit(self, unit: str) -> list[str]:
        """Names of the columns with a unit."""
        return [name for name, own in self.units.items() if own == unit]


def without_labels(rows: list[list[str]]) -> list[list[str]]:
    """Return the rows without a first column of words, as in the curves of element tests."""
    if rows and rows[0][:1] == [LABEL]:
        return [row[1:] for row in rows]
    return rows


def read(path: Path) -> History:
    """Read a history, or a table of `talus plot specimen --csv` with one test.

    A row that a stopped program left unfinished is skipped.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.reader(file))
    except OSError as fault:
        raise FaultError("E545", f"cannot read {path}: {fault.strerror}") from fault
    except (UnicodeDecodeError, csv.Error) as fault:
        raise FaultError("E545", f"{path} is no history: {fault}") from fault
    rows = without_labels(rows)
    if not rows or not rows[0] or "[" not in rows[0][0]:
        raise FaultError("E545", f"{path} is no history", "its first line must be: time [s], ...")
    titles = [title.strip() for title in rows[0]]
    names = [title.split("[")[0].strip() for title in titles]
    units = {n: t.partition("[")[2].rstrip("]") for n, t in zip(names, titles, strict=True)}
    values = []
    for number, row in enumerate(rows[1:], 2):
        last = number == len(rows)
        try:
            numbers = [float(cell) for cell in row]
        except ValueError as fault:
            if last:
                continue
            raise FaultError(
                "E545", f"a row is unreadable: {fault}", place=f"{path}:{number}"
            ) from fault
        if len(numbers) == len(names):
            values.append(numbers)
        elif not last:
            text = f"a row has {len(numbers)} values instead of {len(names)}"
            raise FaultError("E545", text, place=f"{path}:{number}")
    table = np.array(values).reshape(-1, len(names))
    if len(table) and not np.isfinite(table[:, 1:]).any():
        hint = "see the end of the run's log"
        raise FaultError("E545", f"{path} holds no finite number", hint)
    back = np.flatnonzero(np.diff(table[:, 0]) < 0.0)
    if back.size and names[0] == "time":
        raise FaultError(
            "E545",
            f"the time runs back from {table[back[0], 0]:g} to {table[back[0] + 1, 0]:g} s",
            "two runs wrote this file at once: run one of them again",
            f"{path}:{back[0] + 3}",
        )
    return History(path, {name: table[:, k] for k, name in enumerate(names)}, units)
