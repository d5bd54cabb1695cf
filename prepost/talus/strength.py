"""Strength of a pack from element tests: friction, dilation and cohesion of Drucker and Prager.

The law is that of the solids: |s| = B p + A c with p the mean pressure, A = beta cos(phi),
B = beta sin(phi), and dilation B_psi = gain of volume over |e|, the path of the deviatoric strain.
Elastic strains are left out: between grains they are small against those of the peak.
"""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from talus import histories
from talus.cell_plots import distortion, tensors
from talus.faults import FaultError
from talus.files import make_folder, write_text_file
from talus.look import COLOURS, new_figure
from talus.specimens import CELL_ENDING, ENDING, read_specimen

KILO, PER_CENT = 1.0e3, 100.0
ROOT6 = np.sqrt(6.0)
WINDOW = 0.01  # path of the deviatoric strain over which a peak is taken
LATE = 0.25  # last part of the path that is the critical state
LEAST = 3  # rows of a window
CONES = {"compression": -1.0, "extension": 1.0}


@dataclass
class Loading:
    """Invariants of a test, one value a time."""

    name: str
    pressure: np.ndarray  # p [Pa]
    deviator: np.ndarray  # |s|, Frobenius norm [Pa]
    volume: np.ndarray  # logarithmic gain of volume [-]
    path: np.ndarray  # of the deviatoric strain, sum of |de| [-]


@dataclass
class Cone:
    """A fit: friction, dilation and cohesion, and how good it is."""

    friction_deg: float
    dilation_deg: float
    cohesion_Pa: float
    slope: float  # B [-]
    intercept_Pa: float  # A c [Pa]
    dilatancy: float  # B_psi [-]
    scatter: float  # rms of |s| about the line over the mean of |s| [-]
    points: int
    cone: str


def read_loading(path: Path) -> Loading:
    """Read a test in a cell (*_cell.csv, any strain) or between six walls (*_walls.csv)."""
    if not path.stem.endswith(CELL_ENDING):
        test = read_specimen(path)
        strain = np.log(test.length / test.length[0])
        rate = np.diff(strain - strain.mean(axis=1)[:, None], axis=0)
        walk = np.concatenate([[0.0], np.cumsum(np.linalg.norm(rate, axis=1))])
        rest = np.linalg.norm(test.stress - test.pressure[:, None], axis=1)
        name = path.stem.removesuffix(ENDING)
        return Loading(name, test.pressure, rest, -test.volumetric_strain, walk)
    rows = histories.read(path)
    if not rows["time"].size:
        raise FaultError("E545", f"{path} has no rows yet", "the run has written nothing")
    stress = tensors(rows, "stress")
    pressure = -np.trace(stress, axis1=1, axis2=2) / 3.0
    rest = 0.5 * (stress + stress.transpose(0, 2, 1)) + pressure[:, None, None] * np.eye(3)
    volume = np.log(rows["volume"] / rows["volume"][0])
    walk = distortion(tensors(rows, "deform")) / np.sqrt(2.0)
    norm = np.linalg.norm(rest, axis=(1, 2))
    return Loading(path.stem.removesuffix(CELL_ENDING), pressure, norm, volume, walk)


def peak_rows(test: Loading) -> np.ndarray:
    """Rows of the window of the path with the largest mean of |s|/p."""
    ratio = np.divide(test.deviator, test.pressure, out=np.zeros_like(test.pressure),
                      where=test.pressure > 0.0)  # fmt: skip
    best, chosen = -1.0, np.empty(0, int)
    for start in np.arange(0.0, test.path[-1] - WINDOW, WINDOW / 4.0):
        rows = np.flatnonzero((test.path >= start) & (test.path <= start + WINDOW))
        if len(rows) >= LEAST and ratio[rows].mean() > best:
            best, chosen = float(ratio[rows].mean()), rows
    if not len(chosen):
        hint = f"a path of the deviatoric strain above {WINDOW}, {LEAST} rows in each {WINDOW}"
        raise FaultError("E559", f"test '{test.name}' is too short for a strength", hint)
    return chosen


def critical_rows(test: Loading) -> np.ndarray:
    """Rows of the last part of the path."""
    return np.flatnonzero(test.path >= (1.0 - LATE) * test.path[-1])


def fit(tests: list[Loading], rows: list[np.ndarray], cone: str = "compression") -> Cone:
    """Least squares of |s| = B p + A c and of dV = B_psi |de| over rows of all tests.

    Each test counts alike, however many rows it has. Grains without cohesion may give a negative
    cohesion: it is then zero and the line passes the origin.
    """
    weight = np.concatenate([np.full(len(r), 1.0 / np.sqrt(len(r))) for r in rows])
    p = np.concatenate([t.pressure[r] for t, r in zip(tests, rows, strict=True)])
    q = np.concatenate([t.deviator[r] for t, r in zip(tests, rows, strict=True)])
    slope, intercept = line(p * weight, q * weight, weight)
    if intercept < 0.0 or len(tests) == 1:
        x = p * weight
        slope, intercept = float(x @ (q * weight) / (x @ x)), 0.0
    grown, walked = [], []
    for test, r in zip(tests, rows, strict=True):
        part = 1.0 / np.sqrt(len(r))
        grown.append(part * (test.volume[r] - test.volume[r].mean()))
        walked.append(part * (test.path[r] - test.path[r].mean()))
    x, y = np.concatenate(walked), np.concatenate(grown)
    dilatancy = float(x @ y / max(x @ x, 1.0e-300))
    error = float(np.sqrt(np.mean((q - slope * p - intercept) ** 2)) / q.mean())
    side = CONES[cone]
    friction = angle_of(slope, side)
    beta = 2.0 * ROOT6 / (3.0 + side * np.sin(friction))
    dilation = angle_of(dilatancy, side)
    return Cone(
        float(np.degrees(friction)), float(np.degrees(dilation)),
        float(intercept / (beta * np.cos(friction))), float(slope), float(intercept), dilatancy,
        error, len(p), cone,
    )  # fmt: skip


def line(x: np.ndarray, y: np.ndarray, weight: np.ndarray) -> tuple[float, float]:
    """Slope and intercept of y = slope x + intercept weight by least squares."""
    found = np.linalg.lstsq(np.stack([x, weight], axis=1), y, rcond=None)[0]
    return float(found[0]), float(found[1])


def angle_of(slope: float, side: float) -> float:
    """Angle [rad] of B = 2 sqrt(6) sin/(3 + side sin); side -1: triaxial compression."""
    sine = 3.0 * slope / (2.0 * ROOT6 - side * slope)
    if not -1.0 < sine < 1.0:
        text = f"no cone has the slope {slope:.4g}"
        raise FaultError("E559", text, "|s|/p is too large: are these tests of soil?")
    return float(np.arcsin(sine))


def fit_states(tests: list[Loading], cone: str) -> dict[str, tuple[Cone, list[np.ndarray]]]:
    """Fits of peak and critical state with the rows that they are made from."""
    found = {}
    for state, choose in (("peak", peak_rows), ("critical", critical_rows)):
        rows = [choose(test) for test in tests]
        found[state] = (fit(tests, rows, cone), rows)
    return found


def figure(tests: list[Loading], found: dict[str, tuple[Cone, list[np.ndarray]]]) -> object:
    """Draw |s| against p and volume against the path, with the fitted lines."""
    fig, (left, right) = new_figure(ncols=2, figsize=(10.4, 4.4))
    marks = {"peak": ("-", "o"), "critical": ("--", "s")}
    for k, test in enumerate(tests):
        colour = COLOURS[k % len(COLOURS)]
        left.plot(test.pressure / KILO, test.deviator / KILO, lw=0.6, color=colour, alpha=0.6)
        right.plot(test.path, PER_CENT * test.volume, lw=1.0, color=colour, label=test.name)
        for state, (cone, rows) in found.items():
            r = rows[k]
            left.plot(test.pressure[r].mean() / KILO, test.deviator[r].mean() / KILO,
                      marks[state][1], color=colour, mec="black")  # fmt: skip
            middle, half = test.path[r].mean(), max(np.ptp(test.path[r]), 0.03)
            ends = middle + half * np.array([-1.0, 1.0])
            right.plot(ends, PER_CENT * (test.volume[r].mean() + cone.dilatancy * (ends - middle)),
                       marks[state][0], color="black", lw=1.0)  # fmt: skip
    most = 1.1 * max(test.pressure[r].max() for f in found.values()
                     for test, r in zip(tests, f[1], strict=True))  # fmt: skip
    for state, (cone, _) in found.items():
        text = (f"{state}: friction {cone.friction_deg:.1f}°, dilation {cone.dilation_deg:.1f}°, "
                f"cohesion {cone.cohesion_Pa / KILO:.2g} kPa")  # fmt: skip
        ends = np.array([0.0, most])
        left.plot(ends / KILO, (cone.slope * ends + cone.intercept_Pa) / KILO, marks[state][0],
                  color="black", lw=1.0, label=text)  # fmt: skip
    left.set(xlabel="mean pressure p [kPa]", ylabel="deviatoric stress |s| [kPa]",
             xlim=(0.0, most / KILO))  # fmt: skip
    right.set(xlabel="path of the deviatoric strain [-]", ylabel="gain of volume [%]")
    left.legend(fontsize=7)
    right.legend(fontsize=8)
    fig.suptitle("Cone of Drucker and Prager, least squares over peak and critical states")
    return fig


def write_json(path: Path, found: dict[str, tuple[Cone, list[np.ndarray]]]) -> None:
    """Write the fits, keys as in the material groups of talus-fem where there is one."""
    make_folder(path.parent)
    facts = {"format": "talus-strength", "version": 1}
    facts |= {state: asdict(cone) for state, (cone, _) in found.items()}
    write_text_file(path, json.dumps(facts, indent=2) + "\n")
