"""Element tests: stresses and strains between six walls, in a cell or of a law, figures.

Stress is positive in compression, strains are logarithmic (Hencky) and positive in compression.
"""

from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from talus import histories
from talus.faults import FaultError
from talus.files import make_folder, write_text_file
from talus.forms import volumes
from talus.look import COLOURS, new_figure

KILO, PER_CENT = 1.0e3, 100.0
WINDOW = 0.01  # axial strain over which a peak is averaged
LATE = 0.2  # last part of the axial strain
SHORT = 0.02  # axial strain below which no angle is said
ENDING, CELL_ENDING, POINT_ENDING = "_walls", "_cell", "_point"
SQUARE = 1.0e-6  # of an edge, by which it may lean in a test along the axes
TABLE = (
    "axial_strain [-],volumetric_strain [-],p [Pa],q [Pa],axial_stress [Pa],lateral_stress [Pa],"
    "void_ratio [-],friction_angle [deg]"
)


@dataclass
class Specimen:
    """Curves of one test, one value a time."""

    name: str
    time: np.ndarray  # [s]
    length: np.ndarray  # (n, 3) between opposite walls [m]
    stress: np.ndarray  # (n, 3) on them, mean of both [Pa]
    axis: int  # that is called axial: 0, 1, 2
    void_ratio: np.ndarray | None  # [-], where the volume of the grains is known

    @property
    def axial_strain(self) -> np.ndarray:
        """Shortening of the axial length [-]."""
        return -np.log(self.length[:, self.axis] / self.length[0, self.axis])

    @property
    def volumetric_strain(self) -> np.ndarray:
        """Loss of volume [-]."""
        volume = self.length.prod(axis=1)
        return -np.log(volume / volume[0])

    @property
    def axial(self) -> np.ndarray:
        """Axial stress [Pa]."""
        return self.stress[:, self.axis]

    @property
    def lateral(self) -> np.ndarray:
        """Mean lateral stress [Pa]."""
        return (self.stress.sum(axis=1) - self.axial) / 2.0

    @property
    def pressure(self) -> np.ndarray:
        """Mean stress p [Pa]."""
        return self.stress.mean(axis=1)

    @property
    def deviator(self) -> np.ndarray:
        """Axial less lateral stress, q [Pa]."""
        return self.axial - self.lateral

    @property
    def friction_angle(self) -> np.ndarray:
        """Mobilised angle of friction [deg]: sin = (s1 - s3)/(s1 + s3); 0 without stress."""
        total = self.axial + self.lateral
        ratio = np.divide(self.deviator, total, out=np.zeros_like(total), where=total > 0.0)
        return np.degrees(np.arcsin(np.clip(ratio, -1.0, 1.0)))


def read_specimen(path: Path, axis: str = "z") -> Specimen:
    """Read *_walls.csv of a box of six walls, and the grains' volume from the field file beside it.

    Which walls are opposite follows from the forces: a smooth wall is always loaded along its
    normal, of two opposite ones the lower one downwards.
    """
    rows = histories.read(path)
    walls = np.unique(rows["wall"]).astype(int)
    if len(walls) != 6 or not rows["time"].size:
        text = f"{path} has {len(walls)} walls with rows"
        raise FaultError("E558", text, "an element test needs six walls")
    place = np.stack([[rows[c][rows["wall"] == w] for c in "xyz"] for w in walls])
    force = np.stack([[rows[f"force_{c}"][rows["wall"] == w] for c in "xyz"] for w in walls])
    steps = min(int(np.count_nonzero(rows["wall"] == w)) for w in walls)
    place, force = place[:, :, :steps], force[:, :, :steps]
    total = np.abs(force).sum(axis=2)
    along = total.argmax(axis=1)
    if (total.max(axis=1) <= 0.0).any() or sorted(along) != [0, 0, 1, 1, 2, 2]:
        text = f"the walls of {path} are no box with two of them across each axis"
        raise FaultError("E558", text, "every wall must have been loaded by grains")
    length, push = np.empty((steps, 3)), np.empty((steps, 3))
    for k in range(3):
        one, other = np.flatnonzero(along == k)
        length[:, k] = np.abs(place[one, k] - place[other, k])
        push[:, k] = 0.5 * (np.abs(force[one, k]) + np.abs(force[other, k]))
    stress = push * length / length.prod(axis=1)[:, None]
    name = path.stem.removesuffix(ENDING)
    solid = grain_volume(path.with_name(f"{name}.h5"))
    void_ratio = None if solid is None else length.prod(axis=1) / solid - 1.0
    time = rows["time"][rows["wall"] == walls[0]][:steps]
    return Specimen(name, time, length, stress, "xyz".index(axis), void_ratio)


def read_cell(path: Path, axis: str = "z") -> Specimen:
    """Read *_cell.csv of a cell that keeps its right angles: edges, and Love-Weber stress."""
    rows = histories.read(path)
    if not rows["time"].size:
        raise FaultError("E545", f"{path} has no rows yet", "the run has written nothing")
    edges = np.stack([[rows[f"edge_{e}{c}"] for c in "xyz"] for e in "abc"]).transpose(2, 0, 1)
    length = np.diagonal(edges, axis1=1, axis2=2).copy()
    if (np.abs(edges - length[:, :, None] * np.eye(3)) > SQUARE * length[:, :, None]).any():
        text = f"the cell of {path} does not keep its right angles"
        raise FaultError("E558", text, "talus plot cell draws shear; edges must run along x, y, z")
    stress = -np.stack([rows[f"stress_{c}{c}"] for c in "xyz"], axis=1)
    name = path.stem.removesuffix(CELL_ENDING)
    solid = grain_volume(path.with_name(f"{name}.h5"))
    void_ratio = None if solid is None else rows["volume"] / solid - 1.0
    return Specimen(name, rows["time"], length, stress, "xyz".index(axis), void_ratio)


def read_point(path: Path, axis: str = "z") -> Specimen:
    """Read *_point.csv of a law (talus-fem --point): edges are exp(strain), as of a cell."""
    rows = histories.read(path)
    strain, stress = (np.stack([rows[f"{what} {c}{c}"] for c in "xyz"], axis=1)
                      for what in ("strain", "stress"))  # fmt: skip
    if not len(strain):
        raise FaultError("E545", f"{path} has no rows yet", "the run has written nothing")
    name = path.stem.removesuffix(POINT_ENDING)
    return Specimen(name, rows["time"], np.exp(strain), -stress, "xyz".index(axis), None)


READERS = {ENDING: read_specimen, CELL_ENDING: read_cell, POINT_ENDING: read_point}


def read_test(path: Path, axis: str = "z") -> Specimen:
    """Read a test between walls, in a cell or of a law, by the ending of its history."""
    ending = f"_{path.stem.rpartition('_')[2]}"
    return READERS.get(ending, read_specimen)(path, axis)


def grain_volume(path: Path) -> float | None:
    """Volume of the free grains of a field file [m3]; None if there is no such file."""
    if not path.exists():
        return None
    try:
        with h5py.File(path) as file:
            grains = file["steps"][min(file["steps"])]["grains"]
            free = grains["kind"][...] == 0
            axes = grains["axes"][...][free]
            skew = grains["skew"][...][free] if "skew" in grains else np.zeros_like(axes)
            p = grains["exponent"][...][free] if "exponent" in grains else np.full(len(axes), 2.0)
    except (OSError, KeyError, ValueError):
        return None
    return float(volumes(axes, skew, p).sum()) or None


def mean_over(test: Specimen, values: np.ndarray, low: float, high: float) -> float:
    """Mean of a curve over a range of axial strain, NaN if the test does not reach its end."""
    strain = test.axial_strain
    inside = (strain >= low) & (strain <= high)
    if not inside.any() or strain.max() < high - WINDOW / 2.0:
        return float("nan")
    return float(values[inside].mean())


def peak_angle(test: Specimen) -> tuple[float, float]:
    """Largest friction angle [deg] averaged over 1 % of axial strain, and the strain there [-]."""
    strain, angle = test.axial_strain, test.friction_angle
    best, where = float("nan"), float("nan")
    for start in np.arange(0.0, strain.max() - WINDOW, WINDOW / 4.0):
        mean = mean_over(test, angle, start, start + WINDOW)
        if np.isfinite(mean) and not mean <= best:
            best, where = mean, start + WINDOW / 2.0
    return best, float(where)


def angles(test: Specimen) -> str:
    """Return a line with the peak of the friction angle and its mean late in the test [deg]."""
    peak, strain = peak_angle(test)
    end = float(test.axial_strain.max())
    late = mean_over(test, test.friction_angle, (1.0 - LATE) * end, end)
    if not np.isfinite(peak) or end < SHORT:
        return f"too short for a friction angle: {PER_CENT * end:.2g} % of axial strain"
    where = f"mean over 1 % about {PER_CENT * strain:.2g} % of axial strain"
    return (f"friction angle {peak:.1f} deg at its peak ({where}), {late:.1f} deg in the last "
            "fifth of the test")  # fmt: skip


def widen(ax: object, least: float) -> None:
    """Give the vertical axis at least a span, so that rounding does not show as a curve."""
    low, high = ax.get_ylim()
    if high - low < least:
        ax.set_ylim(0.5 * (low + high - least), 0.5 * (low + high + least))


def figure(tests: dict[str, Specimen], title: str = "") -> object:
    """Draw stress-strain, volume, q-p and e-log p curves of tests."""
    fig, axes = new_figure(nrows=2, ncols=2, figsize=(10.0, 7.2))
    (shear, path), (volume, voids) = axes
    for k, (label, test) in enumerate(tests.items()):
        colour = COLOURS[k % len(COLOURS)]
        look = {"color": colour, "lw": 1.2, "label": label}
        strain = PER_CENT * test.axial_strain
        shear.plot(strain, test.deviator / KILO, **look)
        path.plot(test.pressure / KILO, test.deviator / KILO, **look)
        volume.plot(strain, -PER_CENT * test.volumetric_strain, **look)
        if test.void_ratio is not None:
            good = test.pressure > 0.0
            voids.semilogx(test.pressure[good] / KILO, test.void_ratio[good], **look)
    shear.set(xlabel="axial strain [%]", ylabel="q = axial less lateral stress [kPa]")
    path.set(xlabel="mean stress p [kPa]", ylabel="q [kPa]")
    volume.set(xlabel="axial strain [%]", ylabel="gain of volume [%]")
    voids.set(xlabel="mean stress p [kPa]", ylabel="void ratio [-]")
    if not voids.has_data():
        voids.text(
            0.5, 0.5, "no field file beside the history", transform=voids.transAxes, ha="center"
        )
    widen(volume, 0.2)
    widen(voids, 0.005)
    shear.legend(fontsize=8)
    fig.suptitle(title or "Element test", fontsize=11)
    return fig


def write_table(path: Path, tests: dict[str, Specimen]) -> None:
    """Write the curves as CSV, one row a test and time."""
    lines = [f"test,time [s],{TABLE}"]
    for label, test in tests.items():
        voids = np.full_like(test.time, np.nan) if test.void_ratio is None else test.void_ratio
        columns = (test.time, test.axial_strain, test.volumetric_strain, test.pressure,
                   test.deviator, test.axial, test.lateral, voids, test.friction_angle)  # fmt: skip
        text = label.replace('"', "'")
        lines += [
            f'"{text}",' + ",".join(f"{v:.9g}" for v in row) for row in zip(*columns, strict=True)
        ]
    make_folder(path.parent)
    write_text_file(path, "\n".join(lines) + "\n")
