"""Two packs joined by a mosaic and by a hard cut, beside the packs alone."""

from pathlib import Path

import numpy as np

from talus.cli import main
from talus.compare import max_of
from talus.packing import Packing, read_packing, write_h5
from talus.seam import rotations
from talus.tile import DECK, REST, run_deck
from talus.tile_check import forces_now
from talus.tile_join import BAND, Growth, Joined, assemble, band_of, join_tiles, lay_out, settled
from talus.tile_stamp import Stamp, read_stamp
from talus.verification import Case, read_history

GRAINS = "--count 1000 --axes 2.5e-3 2e-3 1.5e-3 --spread 0.2 --young 2.9e9"
MADE = "--stress 100e3 --making-friction 0.15 --edge 0.036"
STRESS, SEEDS, AXIS = 100e3, (1, 2), 0
STRAIN = 1e-4  # at which the shear modulus is measured
SLOW = 1e-4  # inertial number of that strain
NEAR, OFF = (0.0, 1.5), (3.0, 4.6)  # distances from a plane, in mean diameters
# grains in the voids of a hard cut roll on: it rests less well than packs do
RESTS_OF_THE_CUT = ("1.0e-2", "1.0e-4"), ("1.0e-2", "1.0e-4")
CARRY = """&cell_rate component = 'xx', rate = {rates[0]:.9g} /
&cell_rate component = 'yy', rate = {rates[1]:.9g} /
&cell_rate component = 'zz', rate = {rates[2]:.9g} /
&dynamics  dt_factor = 0.2 /
"""
AT_REST = ("1.0e-5", "1.0e-9")


def run(case: Case) -> None:
    """Make two packs, join them in two ways and judge both."""
    paths = [made(case, seed) for seed in SEEDS]
    tiles = tuple(read_packing(path) for path in paths)
    stamps = tuple(read_stamp(path) for path in paths)
    modulus = [shear_modulus(case, f"pack_{seed}", *pair)
               for seed, *pair in zip(SEEDS, tiles, stamps, strict=True)]  # fmt: skip
    packs = {
        "phi": np.mean([s.solid_fraction for s in stamps]),
        "z": np.mean([s.coordination for s in stamps]), "g": np.mean(modulus, axis=0),
    }  # fmt: skip
    mosaic = join_tiles(tiles, stamps, AXIS, BAND, case.folder / "mosaic", print)
    hard = hard_cut(case.folder / "hard", tiles, stamps)
    found = [facts_of(case, "mosaic", mosaic, packs, AT_REST),
             facts_of(case, "hard", hard, packs, RESTS_OF_THE_CUT[0])]  # fmt: skip
    judge(case, *found)
    draw(case, mosaic, hard)


def made(case: Case, seed: int) -> Path:
    """Make a pack."""
    path = case.folder / f"pack_{seed}.h5"
    if main(f"pack tile {GRAINS} {MADE} --seed {seed} -o {path}".split()) != 0:
        raise RuntimeError(f"{path} was not made")
    return path


def hard_cut(folder: Path, tiles: tuple[Packing, Packing], stamps: tuple[Stamp, Stamp]) -> Joined:
    """Join packs at the planes; of grains that overlap those with most overlaps are left out."""
    sides = lay_out(tiles, AXIS, 0.0)
    band = band_of(sides, 0.0)
    stay = tuple(np.ones(len(row), bool) for row in sides.row)
    while (left := stay[0][band.first] & stay[1][band.second]).any():
        counts = [np.bincount(rows[left], minlength=len(own))
                  for rows, own in zip((band.first, band.second), stay, strict=True)]  # fmt: skip
        side = int(counts[1].max() > counts[0].max())
        stay[side][counts[side].argmax()] = False
    return settled(Growth(folder, stamps), sides, assemble(sides, stay), RESTS_OF_THE_CUT)


def facts_of(
    case: Case, name: str, joined: Joined, packs: dict, rest: tuple[str, str]
) -> dict[str, float]:
    """Return what is judged of a joined pack."""
    stamp = joined.stamp
    modulus = shear_modulus(case, name, joined.packing, stamp, rest)
    lateral = [lateral_stress(joined, *zone) for zone in (NEAR, OFF)]
    return {
        "phi": abs(stamp.solid_fraction / packs["phi"] - 1.0),
        "z": stamp.coordination / packs["z"],
        "lateral": max_of(np.abs(np.concatenate(lateral) / STRESS - 1.0)),
        "loss": joined.loss, "g": float(np.min(modulus / packs["g"])),
        "across": abs(float(joined.strain[AXIS])), "lost": 1.0 - joined.volume,
    }  # fmt: skip


def shear_modulus(
    case: Case, name: str, packing: Packing, stamp: Stamp, rest: tuple[str, str] = AT_REST
) -> np.ndarray:
    """Return q / (3 strain) of packs shortened along x and along z at constant volume (2) [Pa]."""
    fall = stamp.mean_diameter * np.sqrt(stamp.density / STRESS)
    write_h5(case.folder / f"{name}_shear.h5", packing)
    found = []
    for axis in (0, 2):
        rates = np.full(3, 0.5) * SLOW / fall
        rates[axis] *= -2.0
        stem = f"{name}_{axis}"
        step(case, f"{stem}_go", f"{name}_shear.h5", stamp, CARRY.format(rates=rates),
             STRAIN * fall / SLOW)  # fmt: skip
        step(case, f"{stem}_rest", f"{stem}_go_end.h5", stamp,
             REST.format(unbalanced=rest[0], energy=rest[1]), 1.0)  # fmt: skip
        rows = read_history(case.folder / f"{stem}_rest_cell.csv")
        change = -np.array([rows[f"stress_{a}{a}"][-1] for a in "xyz"]) - np.diag(stamp.stress)
        found.append((1.5 * change[axis] - 0.5 * change.sum()) / (3.0 * STRAIN))
    return np.array(found)


def step(case: Case, name: str, source: str, stamp: Stamp, stage: str, t_end: float) -> None:
    """Run a packing in its cell."""
    text = DECK.format(
        title=name, t_end=t_end, every=t_end / 100, mu=float(stamp.friction), source=source,
        name=name, stage=stage, density=float(stamp.density), young=float(stamp.young),
        poisson=float(stamp.poisson),
    )  # fmt: skip
    run_deck(case.folder, name, text)


def slab_stress(joined: Joined, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Normal stresses (slabs, 3) of slabs from low to high along the axis [Pa].

    Branches are cut at the faces of the slabs, which may go on over those of the cell.
    """
    packing = joined.packing
    forces = forces_now(packing, joined.stamp)
    edge = packing.cell[AXIS, AXIS]
    rows = np.searchsorted(packing.id, packing.pairs[:, 0])
    start = packing.x[rows, AXIS]
    ends = np.sort(np.stack([start, start + forces.branch[:, AXIS]]), axis=0)
    long = np.maximum(ends[1] - ends[0], 1e-12 * edge)
    area = np.linalg.det(packing.cell) / edge
    found = np.zeros((len(low), 3))
    for shift in (-edge, 0.0, edge):
        inside = np.minimum(ends[1] + shift, high[:, None]) - np.maximum(
            ends[0] + shift, low[:, None]
        )
        part = np.clip(inside / long, 0.0, 1.0)
        found += np.einsum("sk,ki,ki->si", part, forces.force, forces.branch)
    return found / (area * (high - low))[:, None]


def lateral_stress(joined: Joined, nearest: float, farthest: float) -> np.ndarray:
    """Mean lateral stress at so many diameters from each plane, on both sides of it (2) [Pa]."""
    edge = joined.packing.cell[AXIS, AXIS]
    d = joined.stamp.mean_diameter
    found = []
    for plane in (0.0, 0.5 * edge):
        middle = edge if plane == 0.0 else plane
        slabs = [(middle - farthest * d, middle - nearest * d),
                 (middle + nearest * d, middle + farthest * d)]  # fmt: skip
        slabs = np.array([[low % edge, low % edge + high - low] for low, high in slabs])
        found.append(slab_stress(joined, *slabs.T)[:, [1, 2]].mean())
    return np.array(found)


def judge(case: Case, mosaic: dict, hard: dict) -> None:
    """Hold both to the same limits: the mosaic keeps them, the hard cut fails each."""
    limits = [
        ("phi", "solid fraction off that of the packs", 0.005, False),
        ("z", "coordination number / the packs'", 0.92, True),
        ("lateral", "lateral stress 0 to 1.5 and 3 to 4.6 d off a seam, off 100 kPa", 0.25, False),
        ("loss", "energy lost as all come to rest / elastic", 0.3, False),
        ("g", "shear modulus at 1e-4 / the packs', the lower of two directions", 0.78, True),
        ("across", "strain across the seams", 1e-3, False),
    ]  # fmt: skip
    for key, text, limit, least in limits:
        (case.above if least else case.below)(f"mosaic: {text}", mosaic[key], limit)
    for key, text, limit, least in limits:
        (case.below if least else case.above)(f"hard cut fails: {text}", hard[key], limit)
    case.above("hard cut: volume of the grains lost", hard["lost"], 0.02, "why it fails")


def draw(case: Case, mosaic: Joined, hard: Joined) -> None:
    """Sections through both joined packs, and the lateral stress along them."""
    fig, axes = case.figure(figsize=(7.0, 6.4), nrows=3, sharex=True)
    for ax, joined, name in zip(axes[:2], (mosaic, hard), ("mosaic", "hard cut"), strict=True):
        section(ax, joined)
        ax.set(ylabel=f"{name}\nz [mm]", aspect="equal")
        ax.grid(False)
    for joined, name, color in ((mosaic, "mosaic", "C0"), (hard, "hard cut", "C3")):
        edge = joined.packing.cell[AXIS, AXIS]
        width = 3.0 * joined.stamp.mean_diameter
        middle = np.linspace(0.0, edge, 49)[:-1]
        stress = slab_stress(joined, middle - 0.5 * width, middle + 0.5 * width)
        axes[2].plot(1e3 * middle, 1e-3 * stress[:, [1, 2]].mean(axis=1), color=color, label=name)
    for plane in (0.0, 0.5, 1.0):
        axes[2].axvline(1e3 * plane * edge, color="grey", lw=0.8, ls=":")
    axes[2].axhspan(75.0, 125.0, color="C0", alpha=0.12, lw=0)
    axes[2].set(xlabel="along the packs [mm]", ylabel="lateral stress [kPa]", ylim=(0.0, None))
    axes[2].legend(fontsize=7)
    case.save(fig)


def section(ax: object, joined: Joined) -> None:
    """Ellipses in which the plane y = half of the edge cuts the grains, a colour for each pack."""
    from matplotlib.patches import Ellipse

    packing, second = joined.packing, joined.second
    height = 0.5 * packing.cell[1, 1]
    turn = rotations(packing.quat)
    inverse = np.einsum("nij,nj,nkj->nik", turn, packing.axes**-2.0, turn)
    for k in range(packing.count):
        q, y = inverse[k], height - packing.x[k, 1]
        plane = q[np.ix_([0, 2], [0, 2])]
        side = y * q[[0, 2], 1]
        middle = -np.linalg.solve(plane, side)
        rest = 1.0 - q[1, 1] * y * y + side @ np.linalg.solve(plane, side)
        if rest <= 0.0:
            continue
        size, way = np.linalg.eigh(plane / rest)
        wide = 2e3 / np.sqrt(size)
        place = 1e3 * (packing.x[k, [0, 2]] + middle)
        angle = np.degrees(np.arctan2(way[1, 0], way[0, 0]))
        color = "C1" if packing.id[k] in second else "C0"
        ax.add_patch(Ellipse(place, *wide, angle=angle, fc=color, ec="white", lw=0.3, alpha=0.8))
    ax.set(xlim=(0.0, 1e3 * packing.cell[0, 0]), ylim=(0.0, 1e3 * packing.cell[2, 2]))
