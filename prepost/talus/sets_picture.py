"""Image of the sets of an overlap: free grains, ghosts, nodes that follow and of the edge.

The sets come from `<coupled deck>_sets.h5`, places from the field files of both solvers.
"""

from pathlib import Path

import numpy as np

from talus import version
from talus.checksum import opened
from talus.datasets import DAMAGE, numbers, word
from talus.elements import VTK
from talus.faults import FaultError
from talus.fields import FieldFile
from talus.files import make_folder, replaced
from talus.pictures import ENDINGS, MILLI, VIEW, ellipsoids, in_cut, load_pyvista

GRAINS = {1: ("free grains Q", "#b9770e"), 2: ("ghosts", "#7fb3d5"), 0: ("other grains", "#e8d5b0")}
NODES = {1: ("nodes that follow grains", "#c0392b"), 2: ("free nodes of the edge", "#1b4f72"),
         0: ("other nodes", "#9aa3ad")}  # fmt: skip
PARTS = {2: "#b9770e", 1: "#7fb3d5", 0: "#9aa3ad"}  # elements: of free grains, of ghosts, rest


def read_sets(path: Path) -> dict[str, np.ndarray]:
    """Return ids and sets of grains, sets of nodes, parts of elements."""
    try:
        with opened(path) as file:
            if word(file.attrs.get("format")) != "talus-sets":
                raise FaultError("E543", f"{path} holds no sets", "coupled_sets.h5 is wanted")
            names = ("grains/id", "grains/set", "nodes/set", "elements/part")
            return {name: numbers(file[name]) for name in names}
    except DAMAGE as fault:
        raise FaultError("E542", f"{path} cannot be read: {fault}") from fault


def sets_of(sets: dict[str, np.ndarray], ids: np.ndarray) -> np.ndarray:
    """Return the set of each grain by its id; 0 for those that the file does not name."""
    known = dict(zip(sets["grains/id"].tolist(), sets["grains/set"].tolist(), strict=True))
    return np.array([known.get(int(number), 0) for number in ids])


def render(
    grains: Path, solid: Path | None, sets: Path, step: int, output: Path, size: tuple[int, int]
) -> None:
    """Write a PNG: grains and nodes coloured by their sets, edges of the elements by their part."""
    if output.suffix not in ENDINGS:
        raise FaultError("E554", f"no image can be written as '{output.name}'", "end it with .png")
    if solid is None:
        raise FaultError("E543", "the sets need the solid, too", "add --solid solid.h5")
    found = read_sets(sets)
    pyvista = load_pyvista()
    with FieldFile(grains) as fields:
        now = fields.read(step)
    if not now.grains:
        raise FaultError("E543", f"{grains} holds no grains", "grains.h5 first, --solid after it")
    plotter = pyvista.Plotter(off_screen=True, window_size=list(size))
    plotter.set_background("white")
    member = sets_of(found, now.grains["id"])
    legend = add_grains(pyvista, plotter, now.grains, member)
    legend += add_nodes(pyvista, plotter, solid, found)
    plotter.add_legend(legend, bcolor="white", face="circle", size=(0.3, 0.2), loc="lower left")
    plotter.add_text(f"Talus {version()}", position="lower_right", font_size=6, color="grey")
    plotter.enable_parallel_projection()
    plotter.camera_position = [tuple(10.0 * VIEW), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
    plotter.enable_anti_aliasing("ssaa")
    plotter.reset_camera(bounds=bounds_of(now.grains, member))
    try:
        make_folder(output.parent)
        with replaced(output) as temporary:
            plotter.screenshot(str(temporary))
    finally:
        plotter.close()


def bounds_of(g: dict[str, np.ndarray], member: np.ndarray) -> list[float]:
    """Return what the image shows [mm]: the grains of the overlap, and some around them."""
    x = g["x"][member > 0] if np.any(member > 0) else g["x"]
    low, high = x.min(axis=0), x.max(axis=0)
    more = 0.15 * (high - low).max()
    return (MILLI * np.column_stack([low - more, high + more])).ravel().tolist()


def add_grains(
    pyvista: object, plotter: object, g: dict[str, np.ndarray], member: np.ndarray
) -> list[list[str]]:
    """Add the grains outside the cut; return entries of the legend."""
    entries = []
    for number, (name, colour) in GRAINS.items():
        rows = np.flatnonzero((member == number) & ~in_cut(g["x"]))
        if not len(rows):
            continue
        mesh = ellipsoids(pyvista, g, rows, np.zeros(len(rows)))
        plotter.add_mesh(mesh, color=colour, smooth_shading=True)
        entries.append([f"{name} ({np.count_nonzero(member == number)})", colour])
    return entries


def add_nodes(
    pyvista: object, plotter: object, solid: Path, found: dict[str, np.ndarray]
) -> list[list[str]]:
    """Add nodes as balls and elements by their edges; return entries of the legend."""
    with FieldFile(solid) as fields:
        if fields.mesh is None:
            raise FaultError("E543", f"{solid} holds no mesh", "the solid's field file is wanted")
        x, elements = fields.mesh
    if len(x) != len(found["nodes/set"]):
        raise FaultError("E543", f"{solid} has {len(x)} nodes, the sets {len(found['nodes/set'])}")
    grid = pyvista.UnstructuredGrid({VTK[k]: rows for k, rows in elements.items()}, MILLI * x)
    for part, colour in PARTS.items():
        rows = np.flatnonzero(found["elements/part"] == part)
        if len(rows) and rows.max() < grid.n_cells:
            plotter.add_mesh(
                grid.extract_cells(rows), style="wireframe", color=colour, line_width=2
            )
    first = next(iter(elements.values()))[0]
    ball = 0.1 * MILLI * np.linalg.norm(np.ptp(x[first], axis=0)) / np.sqrt(3.0)
    entries = []
    for number, (name, colour) in NODES.items():
        rows = np.flatnonzero(found["nodes/set"] == number)
        if not len(rows):
            continue
        cloud = pyvista.PolyData(MILLI * x[rows])
        mesh = cloud.glyph(geom=pyvista.Sphere(radius=ball), scale=False, orient=False)
        plotter.add_mesh(mesh, color=colour, smooth_shading=True)
        entries.append([f"{name} ({len(rows)})", colour])
    return entries
