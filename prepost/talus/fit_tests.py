"""Measured element tests that a law of solids is fitted to, and the runs of a point along them."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from talus import histories
from talus.faults import FaultError

COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "zx")
MOST_ROWS = 101  # of a test, taken evenly


@dataclass
class Test:
    """A measured element test: tension positive, engineering shears, a row a time."""

    __test__ = False  # no test of pytest

    name: str
    strain: np.ndarray  # (n, 6) [-]
    stress: np.ndarray  # (n, 6) [Pa]
    own: dict[str, float | str] = field(default_factory=dict)  # constants, or names of free ones
    time: np.ndarray = field(default_factory=lambda: np.empty(0))  # (n) [s]; empty: not known


def parse_test(text: str) -> Test:
    """Read TEST.csv:NAME=VALUE,...; a value that is no number names a free constant."""
    name, _, rest = text.partition(":")
    own: dict[str, float | str] = {}
    for part in filter(None, rest.split(",")):
        key, equals, value = (word.strip() for word in part.partition("="))
        if not equals or not key or not value:
            hint = "TEST.csv:void_ratio=0.8; TEST.csv:void_ratio=LABEL with --free LABEL=0.8"
            raise FaultError("E560", f"'{part}' is no constant of a test", hint)
        try:
            own[key] = float(value)
        except ValueError:
            own[key] = value
    return read_test(Path(name), own)


def read_test(path: Path, own: dict[str, float | str]) -> Test:
    """Read a test of a cell (*_cell.csv) or with the columns of a point (*_point.csv)."""
    table = histories.read(path).columns
    if "deform_xx" in table:
        strain, stress = cell_columns(table)
    else:
        columns = [f"{what} {c}" for what in ("strain", "stress") for c in COMPONENTS]
        missing = [c for c in columns if c not in table]
        if missing:
            hint = "a test has strain xx ... zx and stress xx ... zx, or is a *_cell.csv"
            raise FaultError("E561", f"the test has no column '{missing[0]}'", hint, str(path))
        both = np.stack([table[c] for c in columns], axis=1)
        strain, stress = both[:, :6], both[:, 6:]
    if len(strain) < 3 or not np.abs(stress).max() > 0:
        hint = "a test has at least three rows and some stress"
        raise FaultError("E561", f"the test has {len(strain)} rows", hint, str(path))
    rows = np.unique(np.linspace(0, len(strain) - 1, MOST_ROWS).astype(int))
    time = table["time"][rows] if "time" in table else np.empty(0)
    return Test(path.stem, (strain - strain[0])[rows], stress[rows], own, time)


def cell_columns(table: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return logarithmic strain (n, 6) [-] and stress (n, 6) [Pa] of a cell."""
    deform = np.stack([table[f"deform_{a}{b}"] for a in "xyz" for b in "xyz"], axis=1)
    deform = deform.reshape(-1, 3, 3)
    values, axes = np.linalg.eigh(deform @ deform.transpose(0, 2, 1))
    tensor = np.einsum("nik,nk,njk->nij", axes, 0.5 * np.log(values), axes)
    stress = np.stack([table[f"stress_{a}{b}"] for a in "xyz" for b in "xyz"], axis=1)
    stress = stress.reshape(-1, 3, 3)
    stress = 0.5 * (stress + stress.transpose(0, 2, 1))
    places = [("xyz".index(c[0]), "xyz".index(c[1])) for c in COMPONENTS]
    strain = np.stack([(1 if i == j else 2) * tensor[:, i, j] for i, j in places], axis=1)
    return strain, np.stack([stress[:, i, j] for i, j in places], axis=1)


def deck_of(material: str, test: Test) -> str:
    """Return a deck that drives a point along the strain of a test."""
    rows = len(test.strain)
    times = wrapped(np.arange(rows, dtype=float))
    stress = ", ".join(repr(float(s)) for s in test.stress[0])
    lines = [f"&run title = 'fit', t_end = {rows - 1}.0 /", f"&material {material} /"]
    lines.append(f"&point steps = {rows - 1}, stress = {stress} /")
    for k, name in enumerate(COMPONENTS):
        values = wrapped(test.strain[:, k])
        lines.append(f"&curve id = '{name}', times = {times}, values = {values} /")
        row = f"component = '{name}', kind = 'strain', curve = '{name}', scale = 1.0"
        lines.append(f"&control {row} /")
    return "\n".join(lines) + "\n"


def wrapped(values: np.ndarray) -> str:
    """Return numbers for a deck, five a line."""
    texts = [repr(float(v)) for v in values]
    return ",\n  ".join(", ".join(texts[k : k + 5]) for k in range(0, len(texts), 5))


def norms(stress: np.ndarray) -> np.ndarray:
    """Return the sizes of stresses (n, 6), shears counted twice as in the tensor [Pa]."""
    return np.sqrt((stress**2) @ np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0]))


def misfit(law: np.ndarray, test: Test) -> float:
    """Return rms of the size of the difference of stresses over that of the test, first row out."""
    off, size = norms(law - test.stress)[1:], norms(test.stress)[1:]
    return float(np.sqrt((off @ off) / (size @ size)))
