"""Two tiles of one making joined in one cell: the mosaic of the seams, and how it comes to rest.

Beside each of the two planes where they meet both tiles go on into each other in a band, and a
minimum cut says which grains stay (talus.seam). Grains near the planes then grow from a smaller
size among the others, which are held: soft first, with the friction of the tiles' making, since
grains without friction carry nothing at the density of a pack that has some. They grow a little
beyond their size, or shrink below it, until they bear the tiles' pressure: else they give way when
all are free, with the true friction, under the tiles' stresses, and the lateral stress at the
planes is lost.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from talus.faults import FaultError
from talus.files import make_folder
from talus.forms import volumes
from talus.images import nearest_shifts
from talus.packing import FIXED, FREE, Packing, read_packing, write_h5
from talus.seam import Band, depths, mosaic, overlapped, squares
from talus.tile import (
    CHECK,
    CHECK_TIME,
    CLOSING,
    DECK,
    LET_DOWN,
    PRESS_INERTIA,
    REST,
    STRESS,
    run_deck,
)
from talus.tile_stamp import (
    Stamp,
    anisotropy_of,
    check_held,
    check_images,
    mean_diameter,
    measured_stress,
    openings_of,
    rows_of,
    solid_fraction,
)
from talus.verification import field_steps, read_history

SAME = 1.0e-6  # part by which edges of the faces that meet may differ
ALIKE = 0.02  # part of the mean stress by which normal stresses of the tiles may differ
BAND, REACH = 3.0, 2.5  # in mean diameters: width of the band, from a plane to where grains grow
SIZES = (0.85, 0.93)  # of the grains before they have grown
SOFT = 0.01  # of Young's modulus until then
FARTHER, MOST_FARTHER = 2.5e-4, 8  # of their size beyond it, in so many stages at most
MAKING_ROOM = 5.0e-3  # of the time of a stage, for grains that are smaller than they will be
PRESSED = "&limits initial_overlap = 1.0, overlap = 1.0 /\n"  # of grains that make room
RESTS = ("1.0e-5", "1.0e-9"), ("1.0e-7", "1.0e-12")  # see Growth.settle
LOST = ("friction", "contact_damping", "background_damping", "tangential_relaxation")
MATERIAL = ("friction", "young", "poisson", "density")


@dataclass
class Sides:
    """Two tiles along one axis of a cell: grains of both that may stay, copies at both ends."""

    tiles: tuple[Packing, Packing]
    axis: int
    row: tuple[np.ndarray, np.ndarray]  # (n) of the tile
    copy: tuple[np.ndarray, np.ndarray]  # (n) edges of the tile from it along the axis
    x: tuple[np.ndarray, np.ndarray]  # (n, 3) in the joined cell [m]
    cell: np.ndarray  # (3, 3) of both [m]
    planes: tuple[float, float]  # where they meet [m]

    def from_plane(self, x: np.ndarray) -> np.ndarray:
        """Distance (n) of places (n, 3) from the nearer plane [m]."""
        edge = self.cell[self.axis, self.axis]
        apart = x[:, self.axis, None] - np.array(self.planes)
        return np.abs(apart - edge * np.rint(apart / edge)).min(axis=1)


def check_pair(tiles: tuple[Packing, Packing], stamps: tuple[Stamp, Stamp], axis: int) -> None:
    """Raise a fault for tiles that cannot meet: E686 cells, E687 materials, E688 shapes."""
    edges = [tile.cell.diagonal() for tile in tiles]
    if any(np.abs(tile.cell - np.diag(tile.cell.diagonal())).any() for tile in tiles):
        raise FaultError("E686", "the cells are not boxes along x, y and z")
    across = np.abs(edges[0] / edges[1] - 1.0)
    across[axis] = 0.0
    if across.max() > SAME:
        texts = (", ".join(f"{e:.7g}" for e in own) for own in edges)
        text = f"the faces that meet differ: edges {' and '.join(texts)} m"
        raise FaultError("E686", text, "make both tiles with the same --edge and --aspect")
    for name in MATERIAL:
        one, other = (float(getattr(stamp, name)) for stamp in stamps)
        if one != other:
            text = f"the tiles are of different materials: {name} {one:g} and {other:g}"
            raise FaultError("E687", text, "join tiles of one material")
    apart = np.abs(np.diag(stamps[0].stress - stamps[1].stress)).max()
    mean = np.trace(stamps[0].stress) / 3.0
    if apart > ALIKE * mean:
        text = f"a normal stress of the tiles differs by {apart:.4g} Pa, the mean is"
        raise FaultError("E687", f"{text} {mean:.4g} Pa", "make both at the same --stress")
    if any(tile.formed or tile.clumps is not None for tile in tiles):
        raise FaultError("E688", "a seam is found for spheres and ellipsoids only")


def lay_out(tiles: tuple[Packing, Packing], axis: int, width: float) -> Sides:
    """Return both tiles in one cell, each as far as half a band [m] beyond the planes."""
    long = [float(tile.cell[axis, axis]) for tile in tiles]
    if min(long) < 2.0 * width:
        text = f"a tile is {min(long):.4g} m long, two bands take {2.0 * width:.4g} m"
        raise FaultError("E686", text, "a narrower --band, or longer tiles")
    row, copy, x = [], [], []
    for tile, begin, edge in zip(tiles, (0.0, long[0]), long, strict=True):
        place = tile.x - tile.corner
        home = np.floor(place[:, axis] / edge)
        for other in range(3):
            place[:, other] -= tile.cell[other, other] * np.floor(
                place[:, other] / tile.cell[other, other]
            )
        rows, copies, places = [], [], []
        for number in (-1, 0, 1):
            along = place[:, axis] + number * edge
            near = np.flatnonzero((along >= -0.5 * width) & (along < edge + 0.5 * width))
            rows.append(near)
            copies.append(number - home[near].astype(np.int64))
            moved = place[near].copy()
            moved[:, axis] += begin + number * edge
            places.append(moved)
        row.append(np.concatenate(rows))
        copy.append(np.concatenate(copies))
        x.append(np.concatenate(places))
    cell = tiles[0].cell.copy()
    cell[axis, axis] = sum(long)
    return Sides(tiles, axis, tuple(row), tuple(copy), tuple(x), cell, (0.0, long[0]))


def band_of(sides: Sides, width: float) -> Band:
    """Return the pairs of grains of both sides that overlap; grains off the band stay."""
    parts = []
    for tile, row in zip(sides.tiles, sides.row, strict=True):
        parts.append((tile.axes[row].max(axis=1), squares(tile.axes[row], tile.quat[row])))
    edges = sides.cell.diagonal()
    first, second, apart = [], [], []
    reach = parts[0][0].max() + parts[1][0].max()
    inner = [np.flatnonzero(sides.from_plane(x) < 0.5 * width + reach) for x in sides.x]
    for i in inner[0]:
        far = sides.x[1][inner[1]] - sides.x[0][i]
        far -= edges * np.rint(far / edges)
        near = (far * far).sum(axis=1) < (parts[0][0][i] + parts[1][0][inner[1]]) ** 2
        first.append(np.full(near.sum(), i))
        second.append(inner[1][near])
        apart.append(far[near])
    first, second = np.concatenate(first), np.concatenate(second)
    depth = depths(np.concatenate(apart), parts[0][1][first], parts[1][1][second])
    weight = [
        volumes(tile.axes[row], tile.skew[row], tile.exponent[row])
        for tile, row in zip(sides.tiles, sides.row, strict=True)
    ]
    fixed = [sides.from_plane(x) > 0.5 * width for x in sides.x]
    touch = depth > 0.0
    return Band(first[touch], second[touch], depth[touch], tuple(weight), tuple(fixed))


def assemble(sides: Sides, stay: tuple[np.ndarray, np.ndarray]) -> Packing:
    """Return the grains of both sides that stay (masks), numbered from 1, with their contacts."""
    parts, pairs, forces = [], [], []
    begin = 0
    for k, tile in enumerate(sides.tiles):
        keep = np.flatnonzero(stay[k])
        part = tile.take(sides.row[k][keep])
        part.pairs, part.tangential, part.shift = np.empty((0, 2), np.int64), np.empty((0, 3)), None
        part.id = begin + np.arange(1, len(keep) + 1)
        part.x, part.groups = sides.x[k][keep].copy(), {}
        part.cell, part.corner = sides.cell, np.zeros(3)
        found, own = contacts_of(sides, k, keep)
        pairs.append(begin + 1 + found)
        forces.append(own)
        begin += len(keep)
        parts.append(part)
    made = parts[0].join(parts[1])
    made.pairs, made.tangential = np.concatenate(pairs), np.concatenate(forces)
    made.shift, made.x = None, made.x % sides.cell.diagonal()
    made.groups = {"first": parts[0].id, "second": parts[1].id}
    return made


def contacts_of(sides: Sides, k: int, keep: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Contacts of a tile between grains of its side that are kept: (m, 2) of keep, forces [N]."""
    tile = sides.tiles[k]
    if not len(tile.pairs):
        return np.empty((0, 2), np.int64), np.empty((0, 3))
    place = {(int(sides.row[k][i]), int(sides.copy[k][i])): n for n, i in enumerate(keep)}
    rows = rows_of(tile, tile.pairs)
    shift = np.zeros(len(rows), np.int64)
    if tile.shift is not None:
        shift = np.asarray(tile.shift)[:, sides.axis].astype(np.int64)
    found, of = [], []
    for copy in range(sides.copy[k].min(), sides.copy[k].max() + 1):
        for c, (pair, over) in enumerate(zip(rows.tolist(), shift.tolist(), strict=True)):
            one, other = place.get((pair[0], copy)), place.get((pair[1], copy + over))
            if one is not None and other is not None:
                found.append((one, other))
                of.append(c)
    return np.array(found, np.int64).reshape(-1, 2), tile.tangential[of]


class Growth:
    """Stages in which a joined packing comes to rest, each a run of talus-dem in a folder."""

    def __init__(self, folder: Path, stamps: tuple[Stamp, Stamp]):
        """Take the folder and what the tiles are made of."""
        make_folder(folder)
        self.folder, self.stamp = folder, stamps[0]
        self.normal = np.mean([np.diag(stamp.stress) for stamp in stamps], axis=0)
        self.making = float(np.mean([stamp.making_friction for stamp in stamps]))
        self.rate = PRESS_INERTIA / (
            self.stamp.mean_diameter * np.sqrt(self.stamp.density / self.normal.mean())
        )

    def run(
        self, name: str, source: Packing, stage: str, friction: float, stiff: float = 1.0,
        share: float = 1.0,
    ) -> Packing:  # fmt: skip
        """Run one stage with a friction and a part of Young's modulus; return its packing."""
        write_h5(self.folder / f"{name}_start.h5", source)
        s, t_end = self.stamp, share * CLOSING / self.rate
        text = DECK.format(
            title=f"Seam: {name}", t_end=t_end, every=t_end / 5000, mu=float(friction),
            source=f"{name}_start.h5", name=name, stage=stage, density=float(s.density),
            young=float(stiff * s.young), poisson=float(s.poisson),
        )  # fmt: skip
        run_deck(self.folder, name, text)
        return read_packing(self.folder / f"{name}_end.h5")

    def grow(self, start: Packing, near: np.ndarray) -> Packing:
        """Let the grains of a mask grow to their size among the others, which are held."""
        soft = REST.format(unbalanced="1.0e-2", energy="1.0e-3")
        last = REST.format(unbalanced="1.0e-3", energy="1.0e-5")
        packing, axes = replace(start), start.axes
        packing.pairs, packing.tangential = np.empty((0, 2), np.int64), np.empty((0, 3))
        kind = np.where(near, FREE, FIXED).astype(np.int32)
        stages = [(size, SOFT, LET_DOWN, MAKING_ROOM) for size in SIZES]
        stages += [(1.0, SOFT, soft, 1.0), (1.0, 1.0, last, 1.0)]
        for number, (size, stiff, groups, share) in enumerate(stages, 1):
            packing.axes = axes * np.where(near, size, 1.0)[:, None]
            packing.kind = kind
            name = f"grow_{number}"
            ended = self.run(name, packing, groups + PRESSED, self.making, stiff, share)
            packing = ended.take(rows_of(ended, start.id))
        way = np.sign(self.normal.mean() - self.pressure(name, packing, near))
        for more in range(1, MOST_FARTHER + 1):
            if way * (self.normal.mean() - self.pressure(name, packing, near)) <= 0.0:
                break
            packing.axes = axes * np.where(near, 1.0 + way * more * FARTHER, 1.0)[:, None]
            packing.kind = kind
            name = f"farther_{more}"
            ended = self.run(name, packing, last + PRESSED, self.making)
            packing = ended.take(rows_of(ended, start.id))
        packing.kind = np.full(packing.count, FREE, np.int32)
        packing.groups = start.groups
        return with_contacts_of_held(packing, start, near)

    def pressure(self, name: str, packing: Packing, near: np.ndarray) -> float:
        """Pressure that the grains of a mask bear at the end of a stage [Pa]. eq. D.99."""
        contacts = field_steps(self.folder / f"{name}.h5")[-1].contacts
        rows = rows_of(packing, contacts["ids"])
        branch = packing.x[rows[:, 1]] - packing.x[rows[:, 0]]
        branch += nearest_shifts(branch, packing.cell) @ packing.cell
        ends = 0.5 * near[rows].sum(axis=1)
        work = (ends * (contacts["force"] * branch).sum(axis=1)).sum()
        solid = volumes(packing.axes, packing.skew, packing.exponent)[near].sum()
        return float(work * self.stamp.solid_fraction / (3.0 * solid))

    def settle(self, start: Packing, parts: tuple = RESTS) -> Packing:
        """Let all grains rest under the tiles' normal stresses, then in a cell at rest.

        Each rest ends at an unbalanced force and a kinetic energy over the elastic (2, 2).
        """
        friction = self.stamp.friction
        servo = "".join(
            STRESS.format(component=name, stress=float(p), rate=self.rate, tolerance="1.0e-3")
            for name, p in zip(("xx", "yy", "zz"), self.normal, strict=True)
        )
        rests = [REST.format(unbalanced=u, energy=e) for u, e in parts]
        end = self.run("hold", start, servo + rests[0], friction)
        return self.run("rest", end, rests[1], friction)

    def loss(self) -> float:
        """Energy that the stages with all grains free have lost, over the elastic at their end."""
        rows = [read_history(self.folder / f"{name}_energy.csv") for name in ("hold", "rest")]
        lost = sum(float(own[f"{name}"][-1]) for own in rows for name in LOST)
        return lost / float(rows[-1]["elastic"][-1])

    def stamped(self, packing: Packing) -> Stamp:
        """Return the stamp of the joined tile."""
        write_h5(self.folder / "tile.h5", packing)
        self.run("check", packing, CHECK, self.stamp.friction, share=CHECK_TIME)
        contacts = field_steps(self.folder / "check.h5")[0].contacts
        stress, count = measured_stress(packing, contacts)
        return replace(
            self.stamp, stress=stress, solid_fraction=solid_fraction(packing),
            coordination=2.0 * count / packing.count, making_friction=self.making,
            mean_diameter=mean_diameter(packing), openings=openings_of(packing),
            mean_wanted=float(self.normal.mean()), normal_wanted=self.normal,
            anisotropy=anisotropy_of(stress), hash="",
        )  # fmt: skip


def with_contacts_of_held(packing: Packing, start: Packing, near: np.ndarray) -> Packing:
    """Return a packing with the contacts of the start between grains that were held (not near)."""
    held = start.id[~near]
    new = ~np.isin(packing.pairs, held).all(axis=1)
    old = np.isin(start.pairs, held).all(axis=1)
    packing.pairs = np.concatenate([packing.pairs[new], start.pairs[old]])
    packing.tangential = np.concatenate([packing.tangential[new], start.tangential[old]])
    packing.shift = None
    return packing


@dataclass
class Joined:
    """A joined tile, and what became of it."""

    packing: Packing
    stamp: Stamp
    second: np.ndarray  # ids of the grains of the second tile
    volume: float  # of the grains that stay, over that of both tiles
    loss: float  # of energy while all grains came to rest, over the elastic
    strain: np.ndarray  # of the edges since then (3)


def volume_of(tiles: tuple[Packing, Packing]) -> float:
    """Volume of the grains of two tiles [m3]."""
    return sum(float(solid_fraction(tile) * np.linalg.det(tile.cell)) for tile in tiles)


def join_tiles(
    tiles: tuple[Packing, Packing], stamps: tuple[Stamp, Stamp], axis: int, width: float,
    folder: Path, say: Callable[[str], None],
) -> Joined:  # fmt: skip
    """Join two tiles along an axis, both planes with a mosaic in a band so wide (diameters)."""
    check_pair(tiles, stamps, axis)
    diameter = float(np.mean([stamp.mean_diameter for stamp in stamps]))
    sides = lay_out(tiles, axis, width * diameter)
    band, volume = band_of(sides, width * diameter), volume_of(tiles)
    stay = mosaic(band, volume)
    start = assemble(sides, stay)
    part = overlapped(band, stay) / volume
    say(f"{start.count} grains stay, of {tiles[0].count + tiles[1].count}; overlapped: {part:.4f}")
    growth = Growth(folder, stamps)
    grown = growth.grow(start, sides.from_plane(start.x) < REACH * diameter)
    return settled(growth, sides, grown)


def settled(growth: Growth, sides: Sides, packing: Packing, parts: tuple = RESTS) -> Joined:
    """Let all grains of a joined packing come to rest, and say what became of it."""
    second = packing.groups["second"]
    kept = solid_fraction(packing) * np.linalg.det(sides.cell) / volume_of(sides.tiles)
    end = growth.settle(packing, parts)
    end.groups = {}
    end.v[:], end.omega[:] = 0.0, 0.0
    check_images(end)
    stamp = growth.stamped(end)
    check_held(stamp)
    strain = end.cell.diagonal() / sides.cell.diagonal() - 1.0
    return Joined(end, stamp, second, kept, growth.loss(), strain)
