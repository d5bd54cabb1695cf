"""Constants of a law of solids from element tests, by least squares of the stress.

The law is talus-fem's own (`--point`), driven along the strain of each test from its first stress.
Nothing is assumed of a test but that its material is uniform: drained or not, any direction.
Levenberg and Marquardt's method in the constants over their starts; uncertainties are those of the
linear model about the best fit, with the scatter of the residuals.
"""

import re
import subprocess
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from talus import histories
from talus.faults import FaultError
from talus.programs import find_program

COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "zx")
MATERIAL = re.compile(r"&material\b(.*?)(?<!\S)/", re.I | re.S)
MOST_ROWS = 101  # of a test, taken evenly
PROBE = 1.0e-4  # of a constant, for differences
MOST_STEPS = 40
STILL = 1.0e-7  # of the constants, in a step
MOST_DAMPING = 1.0e10
DIM = 1.0e-10  # of the largest influence, below which a constant has none


@dataclass
class Test:
    """A measured element test: tension positive, engineering shears, a row a time."""

    __test__ = False  # no test of pytest

    name: str
    strain: np.ndarray  # (n, 6) [-]
    stress: np.ndarray  # (n, 6) [Pa]
    own: dict[str, float] = field(default_factory=dict)  # constants of this test alone


@dataclass
class Fit:
    """The best constants with their standard deviations and what is left."""

    names: list[str]
    values: np.ndarray
    deviations: np.ndarray
    correlation: np.ndarray
    residual: float  # rms over the largest stress of each test
    steps: int
    points: int


def read_test(path: Path, own: dict[str, float]) -> Test:
    """Read a test of a cell (*_cell.csv) or with the columns of a point (*_point.csv)."""
    table = histories.read(path).columns
    if "deform_xx" in table:
        deform = np.stack([table[f"deform_{a}{b}"] for a in "xyz" for b in "xyz"], axis=1)
        deform = deform.reshape(-1, 3, 3)
        values, axes = np.linalg.eigh(deform @ deform.transpose(0, 2, 1))
        tensor = np.einsum("nik,nk,njk->nij", axes, 0.5 * np.log(values), axes)
        stress = np.stack([table[f"stress_{a}{b}"] for a in "xyz" for b in "xyz"], axis=1)
        stress = stress.reshape(-1, 3, 3)
        stress = 0.5 * (stress + stress.transpose(0, 2, 1))
        places = [("xyz".index(c[0]), "xyz".index(c[1])) for c in COMPONENTS]
        strain = np.stack([(1 if i == j else 2) * tensor[:, i, j] for i, j in places], axis=1)
        stress = np.stack([stress[:, i, j] for i, j in places], axis=1)
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
    return Test(path.stem, (strain - strain[0])[rows], stress[rows], own)


def number_pattern(name: str) -> re.Pattern:
    """Match a constant of one number in a group: its key with `=`, and the number."""
    return re.compile(rf"(?<![\w])({name}\s*=\s*)([-+]?[\d.]+(?:[eEdD][-+]?\d+)?)", re.I)


def read_deck(deck: Path) -> str:
    """Return the text of a deck."""
    try:
        return deck.read_text()
    except OSError as fault:
        raise FaultError(
            "E560", f"cannot read the deck: {fault.strerror}", place=str(deck)
        ) from fault


def read_material(deck: Path) -> str:
    """Return the first &material of a deck, without comments."""
    text = read_deck(deck)
    found = MATERIAL.search("\n".join(line.split("!")[0] for line in text.splitlines()))
    if not found:
        hint = "its constants are where the fit begins"
        raise FaultError("E560", "the deck has no &material", hint, str(deck))
    return found.group(1)


def start_value(material: str, name: str, deck: Path) -> float:
    """Return a constant of the material, where the fit begins."""
    found = number_pattern(re.escape(name)).search(material)
    if not found:
        hint = "constants to be fitted need a number to begin with"
        raise FaultError("E560", f"&material has no number '{name}'", hint, str(deck))
    return float(re.sub("[dD]", "e", found.group(2)))


def with_constants(material: str, constants: dict[str, float]) -> str:
    """Put constants into the text of a material; what is not there is added."""
    for name, value in constants.items():
        pattern = number_pattern(re.escape(name))
        if pattern.search(material):
            material = pattern.sub(lambda m, v=value: f"{m.group(1)}{v!r}", material)
        else:
            material = f"{material.rstrip().rstrip(',')}, {name} = {value!r}"
    return material


def fitted_deck(deck: Path, constants: dict[str, float]) -> str:
    """Return the text of a deck with constants in its first &material, comments kept."""
    lines = read_deck(deck).splitlines(keepends=True)
    bare = "".join(line.split("!")[0].rstrip("\n") + "\n" for line in lines)
    begin = MATERIAL.search(bare).start()
    first = bare[:begin].count("\n")
    last = bare[: MATERIAL.search(bare).end()].count("\n") + 1
    left = dict(constants)
    for k in range(first, last):
        text, mark, comment = lines[k].partition("!")
        for name in list(left):
            pattern = number_pattern(re.escape(name))
            if pattern.search(text):
                text = pattern.sub(lambda m, v=left[name]: f"{m[1]}{v:.6g}", text, count=1)
                del left[name]
        lines[k] = text + mark + comment
    return "".join(lines)


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


class Model:
    """Stress of a law along tests, by runs of talus-fem."""

    def __init__(self, material: str, names: list[str], tests: list[Test]):
        """Keep the text of the material, the constants to be fitted and the tests."""
        self.material, self.names, self.tests = material, names, tests
        self.program = find_program("talus-fem")
        self.runs, self.message = 0, ""

    def residuals(self, values: np.ndarray) -> np.ndarray | None:
        """Return stress of the law less that of the tests, over its largest; None if it fails."""
        parts = []
        constants = dict(zip(self.names, map(float, values), strict=True))
        with tempfile.TemporaryDirectory() as folder:
            for test in self.tests:
                deck = Path(folder) / "fit.nml"
                deck.write_text(deck_of(with_constants(self.material, test.own | constants), test))
                command = [str(self.program), str(deck), "--point"]
                done = subprocess.run(command, capture_output=True, text=True)
                self.runs += 1
                if done.returncode != 0:
                    self.message = (done.stderr + done.stdout).strip()
                    return None
                table = histories.read(Path(folder) / "fit_point.csv").columns
                stress = np.stack([table[f"stress {c}"] for c in COMPONENTS], axis=1)
                parts.append((stress - test.stress)[1:] / np.abs(test.stress).max())
        return np.concatenate([p.ravel() for p in parts])

    def slopes(self, values: np.ndarray, scale: np.ndarray, here: np.ndarray) -> np.ndarray:
        """Return the slopes of the residuals by the constants over their scales."""
        columns = []
        for k, name in enumerate(self.names):
            for side in (PROBE, -PROBE):
                moved = values.copy()
                moved[k] += side * scale[k]
                there = self.residuals(moved)
                if there is not None:
                    break
            else:
                raise FaultError("E562", f"the law fails on both sides of {name} = {values[k]:g}",
                                 self.message)  # fmt: skip
            columns.append((there - here) / side)
        return np.stack(columns, axis=1)


def fit(material: str, start: dict[str, float], tests: list[Test]) -> Fit:
    """Return the constants that bring the law nearest to the tests."""
    names, values = list(start), np.array(list(start.values()))
    scale = np.where(values == 0.0, 1.0, np.abs(values))
    model = Model(material, names, tests)
    here = model.residuals(values)
    if here is None:
        raise FaultError("E562", "the law does not follow a test with the constants to begin with",
                         model.message)  # fmt: skip
    damping, steps, still = 1.0e-3, 0, False
    slopes = model.slopes(values, scale, here)
    check_influence(names, slopes)
    while steps < MOST_STEPS and not still and damping < MOST_DAMPING:
        steps += 1
        normal = slopes.T @ slopes
        weights = damping * np.diag(np.diag(normal))
        change = -np.linalg.solve(normal + weights, slopes.T @ here)
        there = model.residuals(values + change * scale)
        if there is None or there @ there >= here @ here:
            damping *= 10.0
            still = np.abs(change).max() < STILL
            continue
        values, here, damping = values + change * scale, there, damping / 10.0
        slopes = model.slopes(values, scale, here)
        still = np.abs(change).max() < STILL
    return judged(names, values, scale, slopes, here, steps)


def check_influence(names: list[str], slopes: np.ndarray) -> None:
    """Refuse constants that the tests say nothing about, alone or beside the others."""
    size = np.linalg.norm(slopes, axis=0)
    for name, own in zip(names, size, strict=True):
        if own <= DIM * size.max() or own == 0.0:
            hint = "leave it out, or add a test that depends on it"
            raise FaultError("E563", f"the tests say nothing about {name}", hint)
    share = np.linalg.svd(slopes / size, compute_uv=False)
    if share[-1] <= 1.0e-7 * share[0]:
        hint = "fit fewer constants, or add tests on other paths"
        raise FaultError("E563", f"the tests do not tell {', '.join(names)} apart", hint)


def judged(names: list[str], values: np.ndarray, scale: np.ndarray, slopes: np.ndarray,
           here: np.ndarray, steps: int) -> Fit:  # fmt: skip
    """Return the fit with standard deviations and correlations of the constants."""
    freedom = max(np.count_nonzero(np.abs(slopes).max(axis=1) > 0) - len(names), 1)
    covariance = np.linalg.inv(slopes.T @ slopes) * (here @ here) / freedom
    spread = np.sqrt(np.diag(covariance))
    safe = np.where(spread > 0, spread, 1.0)
    correlation = covariance / np.outer(safe, safe)
    rms = float(np.sqrt(np.mean(here**2)))
    return Fit(names, values, spread * scale, correlation, rms, steps, len(here))
