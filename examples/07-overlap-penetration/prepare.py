"""Cut the pressed wide bed for the coupled and the rigid run, and mesh the surround.

Usage: prepare.py PRESSED OUT [X Y [deep]]. The tool stands at X, Y [mm], by default in the middle;
deep: grains are free to the floor, not to some way below the end of the stroke. Writes
OUT/truth_pack.h5 (all grains and the tool), core_pack.h5 (grains within the ghosts' outer faces),
near_pack.h5 (grains within the nearer ghosts alone),
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
STROKE = 0.020  # of the tool [m]
BELOW = 0.020  # grains alone below the end of the stroke [m]
RIGID = 0.0225  # half the inner width of the medium container [m]
NEAR_EDGE = 0.030  # where ghosts end if contacts between them do not count [m]
NEAR = 0.005  # width of the layer of ghosts that may touch free grains [m]
PROBE = 0.0225  # half-width of the box whose moduli are probed [m]
RADIUS = 0.5 * (FREE_EDGE + NEAR_EDGE)  # middle of these ghosts [m]
SIDES = 8.0 * RADIUS * (STROKE + BELOW)  # area through which displaced volume leaves there [m2]
LINES = np.array([INNER, FREE_EDGE, NEAR_EDGE, GHOST_EDGE, 0.045, 0.0525, OUTER])


def displaced(depth: np.ndarray | float) -> np.ndarray | float:
    """Volume of the tool below the surface at a depth of its tip [m], [m3]."""
    wide, high = TOOL_AXES[0], TOOL_AXES[2]
    return np.pi * wide**2 * depth**2 * (3.0 * high - depth) / (3.0 * high**2)


def half_width(packing: Packing) -> np.ndarray:
    """Larger of |x| and |y| of every centre [m]."""
    return np.abs(packing.x[:, :2]).max(axis=1)


def with_tool(packing: Packing) -> Packing:
    """The bed at rest with the tool just above it."""
    packing.v[:], packing.omega[:] = 0.0, 0.0
    packing.groups = {name: ids for name, ids in packing.groups.items() if ids.size}
    return add_tool(packing, TOOL_AXES, None)


def top_of(bed: Packing) -> float:
    """Height of the mesh: no ghost is above it [m]."""
    ring = (half_width(bed) > FREE_EDGE) & (half_width(bed) < GHOST_EDGE) & (bed.kind == FREE)
    return float(bed.x[ring, 2].max() + 1.0e-6)


def levels(top: float, deep: bool) -> np.ndarray:
    """Where grains alone, free grains and ghosts end below [m]."""
    if deep:
        return np.full(3, FLOOR)
    inner = top - STROKE - BELOW
    return inner - np.array([0.0, FREE_EDGE - INNER, GHOST_EDGE - INNER])


def core(bed: Packing, level: np.ndarray, edge: float) -> Packing:
    """Grains to the outer faces of the ghosts; a floor reaches as far as grains are free."""
    wide = half_width(bed)
    deep = level[2] <= FLOOR
    keep = (bed.kind == FREE) & (wide < edge)
    keep &= deep | (bed.x[:, 2] > level[1] - (edge - FREE_EDGE))
    keep |= (bed.kind == FIXED) & (wide < FREE_EDGE) & (bed.x[:, 2] < FLOOR) & deep
    return ordered(with_tool(bed.take(keep)), level)


def ordered(packing: Packing, level: np.ndarray) -> Packing:
    """Free grains first, then the ghosts near them, each in layers."""
    outside = half_width(packing) - FREE_EDGE
    if level[2] > FLOOR:
        outside = np.maximum(outside, level[1] - packing.x[:, 2])
    ring = np.where(outside < 0.0, 0, np.where(outside < NEAR, 1, 2))
    cell = np.floor((packing.x - packing.x.min(axis=0)) / NEAR)
    order = np.lexsort((packing.id, cell[:, 0], cell[:, 1], cell[:, 2], ring))
    return packing.take(order).numbered(np.arange(1, packing.count + 1))


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


def lines_up(top: float, level: np.ndarray) -> np.ndarray:
    """Heights of the nodes: layers of about LAYER, thinner among ghosts."""
    ends, parts = [top, *level, FLOOR], [LAYER, LAYER, 0.5 * (GHOST_EDGE - FREE_EDGE), 1.5 * LAYER]
    if level[2] <= FLOOR:
        ends, parts = [top, FLOOR], [LAYER]
    pieces = [np.linspace(high, low, int(round((high - low) / part)) + 1)
              for high, low, part in zip(ends, ends[1:], parts, strict=False)]  # fmt: skip
    return np.unique(np.concatenate(pieces))


def surround(top: float, level: np.ndarray) -> Mesh:
    """Hexahedra around the core, and below it, from the floor to the surface of the bed."""
    line, heights = np.concatenate([-LINES[::-1], LINES]), lines_up(top, level)
    middle, up = 0.5 * (line[1:] + line[:-1]), 0.5 * (heights[1:] + heights[:-1])
    wide = np.maximum(np.abs(middle)[:, None], np.abs(middle)[None, :])
    x, hex8 = structured((line, line, heights), (wide > INNER)[:, :, None] | (up < level[0]))
    at = x[hex8].mean(axis=1)
    wide = np.abs(at[:, :2]).max(axis=1)
    free = (wide < FREE_EDGE) & (at[:, 2] > level[1])
    ghosts = (wide < GHOST_EDGE) & (at[:, 2] > level[2]) & ~free
    near = ghosts & (wide < NEAR_EDGE) & (at[:, 2] > level[1] - (NEAR_EDGE - FREE_EDGE))
    mesh = Mesh(x, hex8, {"all": np.arange(len(hex8)), "free": np.flatnonzero(free),
                          "ghosts": np.flatnonzero(ghosts), "near": np.flatnonzero(near)})  # fmt: skip
    edge = np.abs(x[:, :2]).max(axis=1)
    low = (x[:, 2] < FLOOR + 1e-9) & ((edge > FREE_EDGE + 1e-9) | (level[2] > FLOOR))
    mesh.nodes["held"] = np.flatnonzero(low | (edge > OUTER - 1e-9))
    corners = hex8[~free][:, 4:]  # upper faces: the load is on the free grains and on these
    mesh.facets["top"] = corners[np.all(x[corners][:, :, 2] > top - 1e-9, axis=1)]
    return mesh


def main() -> int:
    """Write packings and mesh."""
    bed, out = read_packing(Path(sys.argv[1])), Path(sys.argv[2])
    at = 1e-3 * np.array([float(text) for text in sys.argv[3:5]] or [0.0, 0.0])
    bed.x[:, :2] -= at
    top = top_of(bed)
    level = levels(top, "deep" in sys.argv[5:])
    pieces = {"truth": whole(bed, at), "core": core(bed, level, GHOST_EDGE),
              "near": core(bed, level, NEAR_EDGE),
              "rigid": rigid_box(bed), "probe": probe_box(bed)}  # fmt: skip
    for name, packing in pieces.items():
        write_packing_file(out / f"{name}_pack.h5", packing)
        print(f"{name}_pack.h5: {(packing.kind == FREE).sum()} free grains of {packing.count}")
    mesh = surround(top, level)
    write_mesh(out / "surround.h5", mesh)
    free, ghosts = len(mesh.volumes["free"]), len(mesh.volumes["ghosts"])
    print(f"surround.h5: {len(mesh.x)} nodes, {mesh.count} hex8, top at {1e3 * top:.1f} mm")
    print(f"  {free} under free grains, {ghosts} of ghosts")
    return 0


if __name__ == "__main__":
    sys.exit(main())
