"""The block of the benchmark by gmsh: a box with a box-shaped hole that is open at the top."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from talus.faults import FaultError
from talus.mesh import Mesh, boundary_faces, structured


@dataclass(frozen=True)
class Block:
    """Sizes in metres; the defaults are those of the small container (PENETRATION)."""

    hole: float = 20.0e-3  # half-width of the hole
    outer: float = 60.0e-3  # half-width of the block
    bottom: float = -25.0e-3  # height of the hole's floor
    top: float = 61.0e-3  # height of the block's top
    floor: float = 40.0e-3  # thickness under the hole
    size: float = 10.0e-3  # edge of an element


LARGEST = 5_000_000  # elements that a mesh may have


def divisions(length: float, size: float) -> int:
    """Number of elements along a length."""
    return max(1, round(length / size))


def build_block(path: Path, block: Block) -> None:
    """Write a gmsh file with the volume 'block' and the surfaces 'hole', 'outer', 'top'.

    The block is cut into 3 x 3 x 2 boxes, without the one of the hole; every line is transfinite.
    """
    check_block(block)
    import gmsh

    xs = [-block.outer, -block.hole, block.hole, block.outer]
    zs = [block.bottom - block.floor, block.bottom, block.top]
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("block")
        make_cells(gmsh, xs, zs, block.size)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def structured_block(block: Block) -> Mesh:
    """The same block with all hexahedra running along x, y, z, without gmsh."""
    check_block(block)
    xs = [-block.outer, -block.hole, block.hole, block.outer]
    zs = [block.bottom - block.floor, block.bottom, block.top]

    def line(values: list[float]) -> np.ndarray:
        parts = [
            np.linspace(a, b, divisions(b - a, block.size) + 1)
            for a, b in zip(values, values[1:], strict=False)
        ]
        return np.concatenate([parts[0], *(part[1:] for part in parts[1:])])

    lines = line(xs), line(xs), line(zs)
    centre = np.meshgrid(*((a[1:] + a[:-1]) / 2.0 for a in lines), indexing="ij")
    hole = (np.abs(centre[0]) < block.hole) & (np.abs(centre[1]) < block.hole)
    x, hex8 = structured(lines, ~(hole & (centre[2] > block.bottom)))
    small = 1e-9 * block.outer
    groups: dict[str, list] = {"hole": [], "outer": [], "top": []}
    for _, quad in boundary_faces(hex8).values():
        p = x[quad]
        if (np.abs(p[:, 2] - block.top) < small).all():
            groups["top"].append(quad)
        elif (np.abs(p[:, :2]) < block.hole + small).all() and (p[:, 2] > zs[1] - small).all():
            groups["hole"].append(quad)
        else:
            groups["outer"].append(quad)
    facets = {name: np.array(quads) for name, quads in groups.items()}
    return Mesh(x, hex8, {"block": np.arange(len(hex8))}, facets)


def check_block(block: Block) -> None:
    """Raise fault E526 for sizes that make no block, or far too many elements."""
    if not 0.0 < block.hole < block.outer or not block.bottom < block.top or block.floor <= 0.0:
        text = f"no block with these sizes: {block}"
        raise FaultError("E526", text, "0 < hole < outer, bottom < top, floor > 0")
    if block.size <= 0.0:
        raise FaultError("E526", f"the size of elements is {block.size} m", "it must be above 0")
    across = 2 * block.outer / block.size
    count = across * across * (block.top - block.bottom + block.floor) / block.size
    if count > LARGEST:
        text = f"elements of {block.size} m would be about {count:.2g}"
        raise FaultError("E526", text, f"at most {LARGEST}: choose a larger --size")


def make_cells(gmsh: object, xs: list[float], zs: list[float], size: float) -> None:
    """Add points, lines, surfaces and volumes of all boxes but the hole, and the groups."""
    geo = gmsh.model.geo
    point = {
        (i, j, k): geo.addPoint(xs[i], xs[j], zs[k])
        for i in range(4)
        for j in range(4)
        for k in range(3)
    }
    lines: dict[tuple, int] = {}
    surfaces: dict[tuple, int] = {}

    def line(a: tuple, b: tuple) -> int:
        if (b, a) in lines:
            return -lines[b, a]
        if (a, b) not in lines:
            lines[a, b] = geo.addLine(point[a], point[b])
            ends = np.array([[xs[p[0]], xs[p[1]], zs[p[2]]] for p in (a, b)])
            count = divisions(float(np.abs(ends[1] - ends[0]).sum()), size)
            geo.mesh.setTransfiniteCurve(lines[a, b], count + 1)
        return lines[a, b]

    def surface(corners: list[tuple]) -> int:
        key = tuple(sorted(corners))
        if key not in surfaces:
            loop = geo.addCurveLoop([line(corners[n], corners[(n + 1) % 4]) for n in range(4)])
            surfaces[key] = geo.addPlaneSurface([loop])
            geo.mesh.setTransfiniteSurface(surfaces[key])
            geo.mesh.setRecombine(2, surfaces[key])
        return surfaces[key]

    volumes = []
    for i, j, k in np.ndindex(3, 3, 2):
        if (i, j, k) == (1, 1, 1):
            continue
        c = [(i + a, j + b, k + d) for d in (0, 1) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
        sides = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
        loop = geo.addSurfaceLoop([surface([c[n] for n in side]) for side in sides])
        volumes.append(geo.addVolume([loop]))
        geo.mesh.setTransfiniteVolume(volumes[-1])
    geo.synchronize()
    add_groups(gmsh, surfaces, volumes)


def add_groups(gmsh: object, surfaces: dict[tuple, int], volumes: list[int]) -> None:
    """Name the volume and the outer, hole and top surfaces by the indices of their corners."""
    groups: dict[str, list[int]] = {"hole": [], "outer": [], "top": []}
    for corners, tag in surfaces.items():
        at = [{corner[d] for corner in corners} for d in range(3)]
        if at[2] == {2}:
            groups["top"].append(tag)
        elif at[2] == {0} or any(at[d] in ({0}, {3}) for d in (0, 1)):
            groups["outer"].append(tag)
        elif is_hole(at):
            groups["hole"].append(tag)
    gmsh.model.addPhysicalGroup(3, volumes, name="block")
    for name, tags in groups.items():
        gmsh.model.addPhysicalGroup(2, tags, name=name)


def is_hole(at: list[set[int]]) -> bool:
    """Whether a surface with these corner indices bounds the hole (its floor or a side)."""
    if at[2] == {1}:
        return at[0] == {1, 2} and at[1] == {1, 2}
    side = at[2] == {1, 2}
    return side and (
        (at[0] in ({1}, {2}) and at[1] == {1, 2}) or (at[1] in ({1}, {2}) and at[0] == {1, 2})
    )
