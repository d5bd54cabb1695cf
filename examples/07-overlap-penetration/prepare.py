"""Cut the pressed wide bed for the coupled and the rigid run, and mesh the surround.

Usage: prepare.py PRESSED OUT [X Y]. The tool stands at X, Y [mm], by default in the middle. Writes
OUT/truth_pack.h5 (all grains and the tool), core_pack.h5 (grains within the ghosts' outer face),
rigid_pack.h5 (a rigid box: grains outside the medium container's inner width are fixed),
probe_pack.h5 (a box within a fixed shell), each but the first with the tool at its origin, and
surround.h5.
"""

import sys
from pathlib import Path

import numpy as np

from talus.generate import TOOL_AXES, add_tool
from talus.mesh import Mesh, structured, write_mesh
from talus.packing import FIXED, FREE, Packing, read_packing, write_packing_file

INNER, FREE_EDGE, GHOST_EDGE, OUTER = 0.0125, 0.0225, 0.0375, 0.060  # half-widths [m]
FLOOR = -0.0225  # top of the floor's spheres [m]
LAYER = 0.010  # height of an element, about [m]
RIGID = 0.0225  # half the inner width of the medium container [m]
NEAR = 0.005  # width of the layer of ghosts that may touch free grains [m]
PROBE = 0.0225  # half-width of the box whose moduli are probed [m]
LINES = np.array([INNER, FREE_EDGE, 0.030, GHOST_EDGE, 0.045, 0.0525, OUTER])


def half_width(packing: Packing) -> np.ndarray:
    """Larger of |x| and |y| of every centre [m]."""
    return np.abs(packing.x[:, :2]).max(axis=1)


def with_tool(packing: Packing) -> Packing:
    """The bed at rest with the tool just above it."""
    packing.v[:], packing.omega[:] = 0.0, 0.0
    packing.groups = {name: ids for name, ids in packing.groups.items() if ids.size}
    return add_tool(packing, TOOL_AXES, None)


def core(bed: Packing) -> Packing:
    """Grains to the outer face of the ghosts; the floor reaches as far as grains are free."""
    wide = half_width(bed)
    keep = (bed.kind == FREE) & (wide < GHOST_EDGE)
    keep |= (bed.kind == FIXED) & (wide < FREE_EDGE) & (bed.x[:, 2] < FLOOR)
    return ordered(with_tool(bed.take(keep)))


def ordered(packing: Packing) -> Packing:
    """Free grains first, then the ghosts near them, each in layers."""
    wide = half_width(packing)
    ring = np.where(wide < FREE_EDGE, 0, np.where(wide < FREE_EDGE + NEAR, 1, 2))
    cell = np.floor((packing.x - packing.x.min(axis=0)) / NEAR)
    order = np.lexsort((packing.id, cell[:, 0], cell[:, 1], cell[:, 2], ring))
    part = packing.take(order)
    place = {grain: k + 1 for k, grain in enumerate(part.id.tolist())}
    part.groups = {name: np.array(sorted(place[grain] for grain in ids.tolist()))
                   for name, ids in part.groups.items()}  # fmt: skip
    part.id = np.arange(1, part.count + 1)
    return part


def whole(bed: Packing, at: np.ndarray) -> Packing:
    """All grains where they fell, with the tool at `at`."""
    part = with_tool(bed.take(np.ones(bed.count, bool)))
    part.x[:, :2] += at
    return part


def rigid_box(bed: Packing) -> Packing:
    """The medium box: what lies up to two grains outside it is fixed."""
    wide = half_width(bed)
    part = bed.take((wide < RIGID + 0.010) & ((bed.kind == FREE) | (bed.x[:, 2] < FLOOR)))
    part.kind = np.where(half_width(part) < RIGID, part.kind, FIXED)
    part.groups = {"container": part.id[part.kind == FIXED], "free": part.id[part.kind == FREE]}
    return with_tool(part)


def probe_box(bed: Packing) -> Packing:
    """The middle of the bed for its moduli: what lies around it is fixed."""
    lower, upper = np.array([-PROBE, -PROBE, -0.010]), np.array([PROBE, PROBE, 0.045])
    near = (bed.kind == FREE) & np.all((bed.x > lower - 0.006) & (bed.x < upper + 0.006), axis=1)
    part = bed.take(near)
    inside = np.all((part.x > lower) & (part.x < upper), axis=1)
    part.kind = np.where(inside, FREE, FIXED)
    part.v[:], part.omega[:] = 0.0, 0.0
    part.groups = {"shell": part.id[~inside], "free": part.id[inside]}
    return part


def surround(top: float) -> Mesh:
    """Hexahedra around the core from the floor to the surface of the bed."""
    line = np.concatenate([-LINES[::-1], LINES])
    count = int(round((top - FLOOR) / LAYER))
    heights = np.linspace(FLOOR, top, count + 1)
    middle = 0.5 * (line[1:] + line[:-1])
    wide = np.maximum(np.abs(middle)[:, None], np.abs(middle)[None, :])
    keep = np.repeat((wide > INNER)[:, :, None], count, axis=2)
    x, hex8 = structured((line, line, heights), keep)
    at = np.abs(x[hex8].mean(axis=1)[:, :2]).max(axis=1)
    free = at < FREE_EDGE
    ghosts = (at < GHOST_EDGE) & ~free
    mesh = Mesh(x, hex8, {"all": np.arange(len(hex8)), "free": np.flatnonzero(free),
                          "ghosts": np.flatnonzero(ghosts)})  # fmt: skip
    edge = np.abs(x[:, :2]).max(axis=1)
    low = (x[:, 2] < FLOOR + 1e-9) & (edge > FREE_EDGE + 1e-9)
    mesh.nodes["held"] = np.flatnonzero(low | (edge > OUTER - 1e-9))
    corners = hex8[~free][:, 4:]  # upper faces: the load is on the free grains and on these
    mesh.facets["top"] = corners[np.all(x[corners][:, :, 2] > top - 1e-9, axis=1)]
    return mesh


def main() -> int:
    """Write packings and mesh."""
    bed, out = read_packing(Path(sys.argv[1])), Path(sys.argv[2])
    at = 1e-3 * np.array([float(text) for text in sys.argv[3:5]] or [0.0, 0.0])
    bed.x[:, :2] -= at
    ring = (half_width(bed) > FREE_EDGE) & (half_width(bed) < GHOST_EDGE) & (bed.kind == FREE)
    top = float(bed.x[ring, 2].max() + 1.0e-6)
    pieces = {"truth": whole(bed, at), "core": core(bed),
              "rigid": rigid_box(bed), "probe": probe_box(bed)}  # fmt: skip
    for name, packing in pieces.items():
        write_packing_file(out / f"{name}_pack.h5", packing)
        print(f"{name}_pack.h5: {(packing.kind == FREE).sum()} free grains of {packing.count}")
    mesh = surround(top)
    write_mesh(out / "surround.h5", mesh)
    free, ghosts = len(mesh.volumes["free"]), len(mesh.volumes["ghosts"])
    print(f"surround.h5: {len(mesh.x)} nodes, {mesh.count} hex8, top at {1e3 * top:.1f} mm")
    print(f"  {free} under free grains, {ghosts} of ghosts")
    return 0


if __name__ == "__main__":
    sys.exit(main())
