"""A bed with a free surface from a periodic piece, cut for all grains, overlap and rigid box.

Usage: prepare.py cloud OUT | cut OUT. `cloud` writes OUT/cloud.h5: grains above a floor of fixed
spheres in a cell periodic in x and y. `cut` lays its deposit OUT/piece.h5 side by side three times
along x and y, holds the grains at the rim, and writes all_pack.h5, core_pack.h5, box_pack.h5 (each
with the tool) and surround_mesh.h5, by the means of example 07.
"""

import importlib.util
import sys
from pathlib import Path

import numpy as np

from talus.generate import cloud, lattice
from talus.mesh import write_mesh
from talus.packing import FIXED, FREE, Packing, read_packing, write_packing_file

EXAMPLES = Path(__file__).resolve().parent.parent
AXES = np.array([2.5e-3, 2.0e-3, 1.5e-3])  # semi-axes of a grain [m]
PIECE, COPIES = 0.040, 3  # width of the periodic piece [m], how often it lies along x and y
DEPTH, FRACTION = 0.045, 0.60  # of the bed, about [m], its solid fraction
LOOSE = 0.24  # height of the cloud [m]
FLOOR_RADIUS = 2.5e-3  # of the fixed spheres [m]
OUTER = 0.056  # half-width beyond which grains are held [m]


def means_of_example() -> object:
    """prepare.py of example 07 with the measures of this bed."""
    path = EXAMPLES / "07-overlap-penetration/prepare.py"
    spec = importlib.util.spec_from_file_location("overlap_prepare", path)
    means = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(means)
    means.FLOOR, means.OUTER = 0.0, OUTER
    means.LINES = np.array([means.INNER, means.FREE_EDGE, means.NEAR_EDGE, means.GHOST_EDGE,
                            0.0465, OUTER])  # fmt: skip
    return means


def write_cloud(out: Path) -> None:
    """Grains that fall, over spheres that do not."""
    count = round(FRACTION * PIECE**2 * DEPTH / (4.0 / 3.0 * np.pi * AXES.prod()))
    box = np.array([PIECE, PIECE, LOOSE])
    loose = cloud(np.ones(count), box, AXES, seed=1, periodic=True)
    loose.x[:, 2] += AXES[0]
    across = round(PIECE / (2.0 * FLOOR_RADIUS))
    floor = lattice("sc", (across, across, 1), 2.0 * FLOOR_RADIUS, np.full(3, FLOOR_RADIUS))
    floor.x += [FLOOR_RADIUS, FLOOR_RADIUS, -FLOOR_RADIUS]
    floor.kind[:] = FIXED
    write_packing_file(out / "cloud.h5", in_cell(loose.join(floor.renumbered(count))))
    print(f"cloud.h5: {count} grains")


def ship(out: Path) -> None:
    """The piece at rest as text."""
    piece = read_packing(out / "piece.h5")
    piece.x, piece.quat = piece.x.round(9), piece.quat.round(9)
    title = f"A piece of a bed, {PIECE} m wide, periodic in x and y: ellipsoids on fixed spheres."
    made = "Made by prepare.py cloud, fall.nml, settle.nml. Lengths in m."
    write_packing_file(out / "piece.txt", piece, f"{title}\n{made}")


def start(out: Path) -> None:
    """The shipped piece in its cell."""
    piece = read_packing(Path(__file__).parent / "piece.txt")
    write_packing_file(out / "fallen.h5", in_cell(piece))


def in_cell(packing: Packing) -> Packing:
    """The packing in the cell of the piece."""
    packing.cell, packing.corner = np.diag([PIECE, PIECE, 1.2 * LOOSE]), np.array([0.0, 0.0, -0.01])
    return packing


def whole_bed(piece: Packing) -> Packing:
    """The piece side by side about the origin; the rim is held."""
    bed = piece.repeated((COPIES, COPIES, 1))
    bed.x[:, :2] -= 0.5 * COPIES * PIECE
    bed.cell, bed.shift = None, None
    rim = np.abs(bed.x[:, :2]).max(axis=1) > OUTER
    bed.kind = np.where(rim, FIXED, bed.kind)
    bed.groups = {}
    near = np.abs(bed.x[np.searchsorted(bed.id, bed.pairs[:, 0])]
                  - bed.x[np.searchsorted(bed.id, bed.pairs[:, 1])]).max(axis=1) < PIECE  # fmt: skip
    bed.pairs, bed.tangential = bed.pairs[near], bed.tangential[near]
    return bed


def cut(out: Path) -> None:
    """All packings and the mesh."""
    means = means_of_example()
    bed = whole_bed(read_packing(out / "piece.h5"))
    top = means.top_of(bed)
    level = means.levels(top, True)
    pieces = {"all": means.whole(bed, np.zeros(2)), "core": means.core(bed, level, means.NEAR_EDGE),
              "box": means.rigid_box(bed)}  # fmt: skip
    for name, packing in pieces.items():
        write_packing_file(out / f"{name}_pack.h5", packing)
        print(f"{name}_pack.h5: {(packing.kind == FREE).sum()} grains that move of {packing.count}")
    mesh = means.surround(top, level)
    write_mesh(out / "surround_mesh.h5", mesh)
    print(f"surround_mesh.h5: {len(mesh.x)} nodes, {mesh.count} hex8, top at {1e3 * top:.1f} mm")


def main() -> int:
    """One of the steps."""
    step, out = sys.argv[1], Path(sys.argv[2])
    {"cloud": write_cloud, "ship": ship, "start": start, "cut": cut}[step](out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
