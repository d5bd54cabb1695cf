"""Tiles: periodic cells of grains at rest at a wanted stress, density and edge.

A cloud is pressed by talus-dem in a periodic cell whose edges keep their ratio. The friction while
it is pressed, that of making, decides how dense it becomes: it is searched for. Then the grains
rest at their true friction, small cycles of strain make the normal stresses equal (tile_even), and
grains and edges are scaled alike: forces of Hertz contacts go with the square of the length, so the
stress stays. Where three normal stresses are given, servos hold each, and the edges come out as
they come. A stage that has finished is not run again.
"""

import json
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from talus.faults import FaultError
from talus.files import make_folder, write_text_file
from talus.packing import Packing, read_packing, write_h5
from talus.programs import find_program
from talus.tile_even import EVEN, cycle_text, even
from talus.tile_stamp import (
    Stamp,
    check_held,
    check_images,
    hash_of,
    mean_diameter,
    measured_stress,
    openings_of,
    solid_fraction,
)
from talus.verification import field_steps, read_history

PRESS_INERTIA = 5.0e-3  # inertial number at which the cell closes [-]
CLOSING = 50.0  # time for a stage, in those of a strain of one at that rate
MOST_FRICTION = 1.0  # of making; beyond it packings become no looser
FIRST_FRICTION = 0.1
KNEE = 0.15  # the solid fraction falls about linearly with friction / (friction + KNEE)
CLOUD_FRACTION = 0.25  # of the bounding spheres in a cloud [-]
LIKELY_FRACTION = 0.6  # of a tile, to tell beforehand how wide it becomes [-]
DECK = """&run       title = '{title}', t_end = {t_end:.6g} /
&material  id = 'grain', density = {density!r}, young = {young!r}, poisson = {poisson!r} /
&contact   between = 'grain', 'grain', law = 'hertz_mindlin', friction = {mu!r},
           damping_ratio = 0.2 /
&particles file = '{source}', material = 'grain' /
&cell /
{stage}&output    every_time = {t_end:.6g}, fields = 'contacts', packing = '{name}_end.h5' /
&history   every_time = {every:.6g} /
"""
STRESS = """&cell_stress component = '{component}', stress = {stress!r}, rate = {rate:.6g},
           tolerance = {tolerance} /
"""
LET_DOWN = "&relaxation damping = 'adaptive', dt_factor = 0.2 /\n"
HOLDS, MOST_RESTS = 2.0e-3, 4  # of the mean stress at rest, and how often it is tried
CYCLE_RATE = 0.5  # of the rate of pressing
REST = f"""{LET_DOWN}&equilibrium unbalanced = {{unbalanced}}, energy_ratio = {{energy}},
             check_every = 200 /
"""
CHECK = "&dynamics dt_factor = 0.1 /\n"
CHECK_TIME = 1.0e-9  # of that of a stage: one step


@dataclass(frozen=True)
class Wanted:
    """What a tile is made for; SI units."""

    stress: float  # mean, positive in compression [Pa]
    friction: float  # of the grains
    density: float  # of the solid [kg/m3]
    young: float  # [Pa]
    poisson: float
    solid_fraction: float | None = None  # None: that of making_friction
    making_friction: float | None = None
    tolerance: float = 3.0e-3  # of the solid fraction
    trials: int = 12
    edge: float | None = None  # first edge [m]; None: as the grains lie
    least_edges: float = 9.0  # width of the cell in mean diameters
    normal: tuple[float, float, float] | None = None  # stresses xx, yy, zz [Pa]; None: equal ones
    even: bool = True  # False: the mean is held, the normal stresses are what they become

    @property
    def held(self) -> np.ndarray:
        """Normal stresses that the tile shall bear (3) [Pa]; not a number where it is free."""
        if self.normal is not None:
            return np.array(self.normal)
        return np.full(3, self.stress if self.even else np.nan)


def least_width(cell: np.ndarray) -> float:
    """Least distance of opposite faces of a cell, edges as rows (3, 3) [m]."""
    return float((1.0 / np.linalg.norm(np.linalg.inv(cell), axis=0)).min())


def box_of(volume: float, aspect: np.ndarray) -> np.ndarray:
    """Edges (3) [m] of a box with a ratio of edges for bounding spheres of a volume [m3]."""
    return aspect * (volume / CLOUD_FRACTION / aspect.prod()) ** (1.0 / 3.0)


def check_width(cell: np.ndarray, diameter: float, least: float) -> None:
    """Raise a fault (E519) if the cell is narrower than so many diameters [m]."""
    width = least_width(cell) / diameter
    if width < least:
        more = np.ceil(10.0 * (least / width) ** 3) / 10.0
        hint = f"{more:g} times as many grains, edges more alike, or another --least-edges"
        text = f"the tile is {width:.3g} mean diameters wide, not {least:g}"
        raise FaultError("E519", text, hint)


def make_tile(
    cloud: Packing, wanted: Wanted, folder: Path, say: Callable[[str], None]
) -> tuple[Packing, Stamp]:
    """Press, rest, scale and check a cloud in its cell; return the tile and its stamp."""
    diameter = mean_diameter(cloud)
    shrink = (solid_fraction(cloud) / (wanted.solid_fraction or LIKELY_FRACTION)) ** (1.0 / 3.0)
    check_width(shrink * cloud.cell, diameter, wanted.least_edges)
    stages = Stages(folder, wanted, diameter)
    stages.begin(cloud)
    friction = wanted.making_friction
    if friction is None:
        friction = search_friction(stages, wanted, say)
    else:
        stages.press(friction, 1, say)
    tile = stages.rest(say)
    if wanted.edge is not None:
        factor = wanted.edge / float(np.linalg.norm(tile.cell[0]))
        say(f"scaled by {factor:.4f}: mean diameter {factor * diameter:.4g} m")
        tile = tile.scaled(factor)
    tile.v[:], tile.omega[:] = 0.0, 0.0
    check_width(tile.cell, mean_diameter(tile), wanted.least_edges)
    check_images(tile)
    stress, contacts = measured_stress(tile, stages.contacts_of(tile))
    stamp = Stamp(
        stress, solid_fraction(tile), 2.0 * contacts / tile.count, friction, wanted.friction,
        wanted.young, wanted.poisson, wanted.density, mean_diameter(tile), openings_of(tile),
        wanted.stress, wanted.held,
    )  # fmt: skip
    check_held(stamp)
    return tile, stamp


def search_friction(stages: "Stages", wanted: Wanted, say: Callable[[str], None]) -> float:
    """Find the friction of making that gives the solid fraction, or say why not (E517)."""
    found: list[tuple[float, float]] = []  # friction, solid fraction less the wanted one
    friction = FIRST_FRICTION
    for trial in range(1, wanted.trials + 1):
        error = solid_fraction(stages.press(friction, trial, say)) - wanted.solid_fraction
        found.append((friction, error))
        if abs(error) <= wanted.tolerance:
            return friction
        following = next_friction(found)
        if following is None:
            end = "loosest" if error > 0.0 else "densest"
            text = f"the {end} packing of these grains has {error + wanted.solid_fraction:.4f}"
            text += f", a solid fraction of {wanted.solid_fraction:g} is asked"
            raise FaultError("E517", text, f"friction of making {friction:g}")
        friction = following
    rows = ", ".join(f"{mu:.4g}: {e + wanted.solid_fraction:.4f}" for mu, e in found)
    hint = "a larger --tolerance, more grains or more --trials"
    raise FaultError("E517", f"no friction of making was found in {wanted.trials}: {rows}", hint)


def next_friction(found: list[tuple[float, float]]) -> float | None:
    """Return the next friction to try from pairs (friction, error); None beyond both ends.

    Too dense wants more friction, too loose less. Between two the error is taken as linear in
    friction / (friction + KNEE), but a tenth of the way from either at least.
    """
    dense = max((pair for pair in found if pair[1] > 0.0), default=None)
    loose = min((pair for pair in found if pair[1] <= 0.0), default=None)
    if loose is None:
        return None if dense[0] >= MOST_FRICTION else min(3.0 * dense[0], MOST_FRICTION)
    if dense is None:
        if loose[0] <= 0.0:
            return None
        return loose[0] / 4.0 if loose[0] > 0.02 else 0.0
    low, high = (mu / (mu + KNEE) for mu in (dense[0], loose[0]))
    part = min(max(dense[1] / (dense[1] - loose[1]), 0.1), 0.9)
    middle = low + part * (high - low)
    return float(KNEE * middle / (1.0 - middle))


class Stages:
    """Runs of talus-dem in a folder, each kept by its deck."""

    def __init__(self, folder: Path, wanted: Wanted, diameter: float):
        """Take the folder and choose rate [1/s] and time [s] from the inertial number."""
        self.folder, self.wanted = folder, wanted
        self.rate = PRESS_INERTIA / (diameter * np.sqrt(wanted.density / wanted.stress))
        self.last = self.kept = ""  # names of stages
        self.aspect = np.ones(3)

    def begin(self, cloud: Packing) -> None:
        """Write the cloud, unless the folder has the same one; another is a fault (E516)."""
        make_folder(self.folder)
        edges = np.linalg.norm(cloud.cell, axis=1)
        self.aspect = edges / edges[0]
        path = self.folder / "cloud.h5"
        if not path.exists():
            write_h5(path, cloud)
            return
        old = read_packing(path)
        if not (np.array_equal(old.x, cloud.x) and np.array_equal(old.axes, cloud.axes)):
            text = f"{self.folder} holds the stages of a tile of other grains"
            raise FaultError("E516", text, "give another --work, or remove that folder")

    def press(self, friction: float, trial: int, say: Callable[[str], None]) -> Packing:
        """Press the cloud at a friction until it rests at the stress."""
        stage = self.servo() + REST
        end = self.run(f"press_{trial:02d}", "cloud.h5", friction, stage, ("1.0e-4", "1.0e-6"))
        part = solid_fraction(end)
        say(f"trial {trial}: friction of making {friction:.4g}, solid fraction {part:.4f}")
        return end

    def rest(self, say: Callable[[str], None]) -> Packing:
        """Let the last pressed packing rest at the true friction, at the stress and then at hand.

        The servo ends within 0.1 % of the stress; without it the cell stands still. A loose packing
        gives way a last time while it comes to rest: then both are done again.
        """
        mu, source = self.wanted.friction, f"{self.last}_end.h5"
        for more in ("", *(f"_{k}" for k in range(2, MOST_RESTS + 1))):
            end = self.held(f"hold{more}", source, f"rest{more}")
            if abs(self.normal_stress().mean() / self.wanted.stress - 1.0) < HOLDS:
                break
            source = f"{self.last}_end.h5"
        if self.wanted.even and self.wanted.normal is None:
            end = self.even(say)
        say(f"at rest with friction {mu:g}, solid fraction {solid_fraction(end):.4f}")
        return end

    def held(self, name: str, source: str, rest: str, normal: list[float] | None = None) -> Packing:
        """Let a packing rest at the stress and then, under another name, in a cell at rest."""
        mu = self.wanted.friction
        self.run(name, source, mu, self.servo(normal) + REST, ("1.0e-5", "1.0e-9"))
        return self.run(rest, f"{name}_end.h5", mu, REST, ("1.0e-7", "1.0e-12"))

    def even(self, say: Callable[[str], None]) -> Packing:
        """Make the normal stresses equal by cycles of strain; if these cannot, by three servos."""
        first = self.kept = self.last
        error = even(self, self.normal_stress(), self.wanted.young, say)
        self.last = self.kept
        if error <= EVEN:
            return read_packing(self.folder / f"{self.kept}_end.h5")
        end = self.held("axes", f"{first}_end.h5", "axes_rest", [self.wanted.stress] * 3)
        edges = np.linalg.norm(end.cell, axis=1)
        part = np.abs(edges / edges[0] / self.aspect - 1.0).max()
        say(f"normal stresses held by three servos instead: edges off their ratio by {part:.2g}")
        return end

    def servo(self, normal: list[float] | None = None, tolerance: str = "1.0e-3") -> str:
        """Return the groups that hold the mean stress, or normal stresses (3) where given [Pa]."""
        normal = normal or self.wanted.normal
        parts = {"mean": self.wanted.stress}
        if normal is not None:
            parts = dict(zip(("xx", "yy", "zz"), normal, strict=True))
        return "".join(
            STRESS.format(component=name, stress=value, rate=self.rate, tolerance=tolerance)
            for name, value in parts.items()
        )

    def cycle(self, number: int, strain: np.ndarray) -> np.ndarray:
        """Strain the packing that was kept by (3) and back; return its normal stresses [Pa]."""
        groups, time = cycle_text(strain, CYCLE_RATE * self.rate)
        stage = self.servo(tolerance="1.0") + groups + LET_DOWN
        share, name = time * self.rate / CLOSING, f"cycle_{number:02d}"
        mu = self.wanted.friction
        self.run(name, f"{self.kept}_end.h5", mu, stage, ("", ""), share, 1)
        self.held(f"{name}_hold", f"{name}_end.h5", f"{name}_rest")
        return self.normal_stress()

    def keep(self) -> None:
        """Begin the next cycle with the last packing."""
        self.kept = self.last

    def normal_stress(self) -> np.ndarray:
        """Return the normal stresses at the end of the last stage (3) [Pa]."""
        rows = read_history(self.folder / f"{self.last}_cell.csv")
        return -np.array([rows[f"stress_{a}{a}"][-1] for a in "xyz"])

    def contacts_of(self, tile: Packing) -> dict[str, np.ndarray]:
        """Return the contacts that talus-dem finds in a tile."""
        write_h5(self.folder / "tile.h5", tile)
        self.run("check", "tile.h5", self.wanted.friction, CHECK, ("", ""), CHECK_TIME, 1)
        return field_steps(self.folder / "check.h5")[0].contacts

    def run(
        self, name: str, source: str, mu: float, stage: str, rest: tuple[str, str],
        share: float = 1.0, rows: int = 5000,
    ) -> Packing:  # fmt: skip
        """Run one stage, unless it has finished with the same deck; return its packing."""
        w, t_end = self.wanted, share * CLOSING / self.rate
        groups = stage.format(unbalanced=rest[0], energy=rest[1])
        text = DECK.format(
            title=f"Tile: {name}", t_end=t_end, every=t_end / rows, mu=mu, source=source,
            name=name, stage=groups, density=w.density, young=w.young, poisson=w.poisson,
        )  # fmt: skip
        self.last = name
        run_deck(self.folder, name, text)
        return read_packing(self.folder / f"{name}_end.h5")


def run_deck(folder: Path, name: str, text: str) -> None:
    """Run talus-dem with a deck in a folder, unless that has finished; a failure is E518.

    The end of a stage is a file of its deck and the source's hash, written behind it.
    """
    done = folder / f"{name}.done"
    source = folder / text.split("file = '")[1].split("'")[0]
    stamp = json.dumps({"deck": text, "source": hash_of(read_packing(source))})
    if done.exists() and done.read_text() == stamp:
        return
    done.unlink(missing_ok=True)
    write_text_file(folder / f"{name}.nml", text)
    words = [str(find_program("talus-dem")), f"{name}.nml", "--threads=1"]
    run = subprocess.run(words, cwd=folder, capture_output=True, text=True)
    if run.returncode != 0:
        last = [line for line in (run.stdout + run.stderr).splitlines() if "error" in line]
        reason = last[0].strip() if last else f"exit code {run.returncode}"
        hint = f"see {folder / name}.log"
        code = 2 if run.returncode == 2 else 4
        raise FaultError("E518", f"talus-dem failed in stage {name}: {reason}", hint, "", code)
    write_text_file(done, stamp)
