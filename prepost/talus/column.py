"""Columns: a stack of copies of a tile, each at the stress of its depth, for beds under gravity.

The tile is replayed: talus-dem strains it along z alone, at edges along x and y that stay, until it
bears the vertical stress of a border between layers, or of the surface; the lateral stress is what
comes, that of a bed at rest (K0). The shear stresses on horizontal planes, which a bed has not, go
by tilting the third edge. The borders go from the top down, each from the end of the one above:
neighbours differ by 1e-4 to 1e-3. Each layer goes over from one border's state to the next.
Stacked, with a floor of their own lowest grains and cut at the surface, they rest once under
gravity and surcharge.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from talus.column_measure import Profile, inner_rows, moved_places, profile_of, weight_stress
from talus.column_stack import blended, cut, like_tile, stack
from talus.faults import FaultError
from talus.files import make_folder
from talus.packing import Packing, read_packing, write_h5
from talus.progress import watch
from talus.tile import CHECK, CHECK_TIME, CLOSING, REST, STRESS, run_deck
from talus.tile_stamp import Stamp, forces_of
from talus.verification import field_steps, read_history

REPLAY_INERTIA = 2.6e-3  # inertial number of the strain of a layer [-]
LEAST_PART = 0.1  # of a whole layer's weight, that the tile bears at the surface at least
STRAIGHT = 1.0e-9  # of an edge, by which a box may be slanted
MOST_LAYERS = 1000
SKIN = 1.0  # depth below the surface, in largest diameters, of grains that may move
MOST_PART, MOST_WAY = 0.95, 1.0e-2  # of the inner grains move less, in mean diameters
BALANCE = 0.01  # of the vertical stress
DECK = """&run       title = 'Column: {name}', t_end = {t_end:.6g}, gravity = 0.0, 0.0, {down!r} /
&material  id = 'grain', density = {density!r}, young = {young!r}, poisson = {poisson!r} /
&contact   between = 'grain', 'grain', law = 'hertz_mindlin', friction = {friction!r},
           damping_ratio = 0.2 /
&particles file = '{source}', material = 'grain' /
&cell      {periodic}/
{stage}&output    every_time = {t_end:.6g}, fields = 'contacts', packing = '{name}_end.h5' /
&history   every_time = {every:.6g} /
"""
SETTLE = """&relaxation damping = 'adaptive', dt_factor = 0.5 /
&equilibrium unbalanced = 1.0e-5, energy_ratio = 1.0e-9, check_every = 200 /
"""
SURCHARGE = "&surcharge stress = {stress!r} /\n"


@dataclass(frozen=True)
class Bed:
    """What a column is made for; SI units."""

    height: float  # of the free bed above its floor [m]
    surcharge: float = 0.0  # on its surface [Pa]
    gravity: float = 9.81  # [m/s2]


@dataclass
class Column:
    """A column at rest and what it is."""

    packing: Packing
    profile: Profile
    layers: int
    floor: float  # thickness [m]
    replayed: np.ndarray  # (layers + 1, 3) normal stresses of the replays, lowest first [Pa]
    moved: np.ndarray  # ways of the inner grains in coming to rest, in mean diameters

    @property
    def way(self) -> float:
        """Way that 95 of 100 of these grains do not exceed; the others are loose."""
        return float(np.quantile(self.moved, MOST_PART))


def make_column(
    tile: Packing, stamp: Stamp, bed: Bed, folder: Path, say: Callable[[str], None]
) -> Column:
    """Replay, stack, cut and settle a tile; return the column at rest."""
    check_box(tile)
    floor = 2.0 * float((tile.axes * (1.0 + np.abs(tile.skew))).max())
    layers = int(np.ceil((floor + bed.height) / tile.cell[2, 2]))
    if not 1 <= layers <= MOST_LAYERS:
        text = f"a bed {bed.height:g} m high takes {layers} layers of the tile"
        raise FaultError("E536", text, f"at most {MOST_LAYERS}, or a higher tile")
    stages = Replays(folder, stamp, bed)
    stages.begin(tile)
    wanted = border_stresses(tile, stamp, bed, floor, layers)
    say(f"{layers} layers, vertical stress {wanted[-1]:.4g} to {wanted[0]:.4g} Pa")
    states, normal = [], np.empty((layers + 1, 3))
    for k in watch(range(layers, -1, -1), "layers"):
        states.insert(0, like_tile(stages.replay(k, wanted[k]), tile))
        normal[k] = stages.normal_stress()
    k0 = normal[:, :2].mean(axis=1) / normal[:, 2]
    say(f"lateral over vertical stress {k0[-1]:.3f} (top) to {k0[0]:.3f}")
    tops = np.ones(layers)
    tops[-1] = (floor + bed.height) / tile.cell[2, 2] - (layers - 1)
    between = [blended(tile, *states[k : k + 2], tops[k]) for k in range(layers)]
    stacked = cut(stack(between), floor, bed.height)
    settled = stages.settle(stacked)
    forces = forces_of(settled, stages.contacts_of(settled))
    profile = profile_of(settled, forces, tile.cell[2, 2], bed.height - stamp.mean_diameter)
    moved = moved_places(stacked, settled)[inner_rows(stacked, bed.height - SKIN * floor)]
    column = Column(settled, profile, layers, floor, normal, moved / stamp.mean_diameter)
    check_column(column, stamp, bed)
    return column


def check_column(column: Column, stamp: Stamp, bed: Bed) -> None:
    """Raise a fault (E537) if the column moved much in coming to rest or is not in balance."""
    if not column.way < MOST_WAY:
        text = f"a twentieth of the inner grains moved {column.way:.3g} mean diameters or more"
        hint = "press the tile to about the stress of the highest layer; at least 9 d wide"
        raise FaultError("E537", text, hint)
    weight = stamp.density * bed.gravity
    balance = weight_stress(column.packing, column.profile.z, weight, bed.surcharge)
    error = np.abs(column.profile.stress[:, 2, 2] / balance - 1.0).max()
    if not error < BALANCE:
        text = f"the vertical stress is off the weight above by {error:.3g} of it"
        raise FaultError("E537", text, "remove the stage settle, and run it again")


def check_box(tile: Packing) -> None:
    """Raise a fault (E536) for a tile whose cell is no box along x, y and z."""
    off = tile.cell - np.diag(np.diag(tile.cell))
    if np.abs(off).max() > STRAIGHT * np.abs(tile.cell).max():
        raise FaultError("E536", "the cell of the tile is no box along x, y and z")


def border_stresses(
    tile: Packing, stamp: Stamp, bed: Bed, floor: float, layers: int
) -> np.ndarray:  # fmt: skip
    """Return the vertical stress below each layer and at the surface, lowest first [Pa].

    At the surface it is the surcharge, but as a tile needs some stress a tenth of a layer's weight
    at least, or half of what is below.
    """
    edge = tile.cell[2, 2]
    weight = stamp.solid_fraction * stamp.density * bed.gravity  # of the bed [N/m3]
    stress = bed.surcharge + weight * (floor + bed.height - edge * np.arange(layers))
    least = min(LEAST_PART * weight * edge, 0.5 * stress[-1])
    return np.append(stress, max(bed.surcharge, least))


class Replays:
    """Runs of talus-dem in a folder, each kept by its deck."""

    def __init__(self, folder: Path, stamp: Stamp, bed: Bed):
        """Take the folder and the stamp of the tile."""
        self.folder, self.stamp, self.bed = folder, stamp, bed
        self.last = "tile"

    def begin(self, tile: Packing) -> None:
        """Write the tile; stages of another one run anew, as their sources differ."""
        make_folder(self.folder)
        write_h5(self.folder / "tile_end.h5", tile)

    def rate(self, stress: float) -> float:
        """Rate of strain at the inertial number of replays, at a stress [Pa] [1/s]."""
        s = self.stamp
        return REPLAY_INERTIA / (s.mean_diameter * np.sqrt(s.density / stress))

    def replay(self, border: int, stress: float) -> Packing:
        """Strain the last state to a vertical stress [Pa] without shear stress; then it rests."""
        rate, name = self.rate(stress), f"border_{border:03d}"
        parts = {"zz": float(stress), "xz": 0.0, "yz": 0.0}
        servo = "".join(
            STRESS.format(component=name, stress=value, rate=rate, tolerance="1.0e-3")
            for name, value in parts.items()
        )
        still = REST.format(unbalanced="1.0e-5", energy="1.0e-9")
        time = CLOSING / rate
        self.run(f"{name}_strain", f"{self.last}_end.h5", servo + still, time)
        still = REST.format(unbalanced="1.0e-7", energy="1.0e-12")
        return self.run(name, f"{name}_strain_end.h5", still, time)

    def normal_stress(self) -> np.ndarray:
        """Return the normal stresses at the end of the last stage (3) [Pa]."""
        rows = read_history(self.folder / f"{self.last}_cell.csv")
        return -np.array([rows[f"stress_{a}{a}"][-1] for a in "xyz"])

    def settle(self, stacked: Packing) -> Packing:
        """Let the stack rest under gravity and surcharge, periodic along x and y."""
        write_h5(self.folder / "stacked.h5", stacked)
        time = CLOSING / self.rate(self.middle_stress())
        settled = self.run("settle", "stacked.h5", self.load() + SETTLE, time, gravity=True)
        settled.v[:], settled.omega[:] = 0.0, 0.0
        return settled

    def contacts_of(self, settled: Packing) -> dict[str, np.ndarray]:
        """Return the contacts that talus-dem finds in the settled column."""
        write_h5(self.folder / "column.h5", settled)
        time = CHECK_TIME * CLOSING / self.rate(self.middle_stress())
        self.run("check", "column.h5", self.load() + CHECK, time, gravity=True)
        return field_steps(self.folder / "check.h5")[0].contacts

    def middle_stress(self) -> float:
        """Vertical stress half way down [Pa]."""
        weight = self.stamp.solid_fraction * self.stamp.density * self.bed.gravity
        return self.bed.surcharge + 0.5 * weight * self.bed.height

    def load(self) -> str:
        """Return the group of the surcharge."""
        return SURCHARGE.format(stress=self.bed.surcharge) if self.bed.surcharge else ""

    def run(
        self, name: str, source: str, stage: str, time: float, gravity: bool = False
    ) -> Packing:  # fmt: skip
        """Run one stage, unless it has finished with the same deck; return its packing."""
        s = self.stamp
        text = DECK.format(
            name=name, t_end=time, every=time / 1000.0, source=source, stage=stage,
            density=float(s.density), young=float(s.young), poisson=float(s.poisson),
            friction=float(s.friction), down=-self.bed.gravity if gravity else 0.0,
            periodic="periodic = 'a', 'b' " if gravity else "",
        )  # fmt: skip
        self.last = name
        run_deck(self.folder, name, text)
        return read_packing(self.folder / f"{name}_end.h5")
