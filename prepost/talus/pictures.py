"""Images of grains and the block around them, a quarter cut away (off-screen, pyvista)."""

import ctypes
import os
from pathlib import Path
from typing import NamedTuple

import numpy as np

from talus import version
from talus.elements import VTK
from talus.faults import FaultError
from talus.fields import GHOST, Cell, FieldFile, Snapshot, displacement
from talus.files import make_folder, replaced
from talus.forms import formed, surface_points
from talus.measure import rotations
from talus.packing import DRIVEN, FIXED
from talus.polyhedron_view import drawn, join_features, rounded_points

MILLI = 1.0e3
COLOURS_OF = {"displacement": "displacement [mm]", "speed": "speed [m/s]", "force": "force [N]",
              "generation": "generation [-]", "role": "role"}  # fmt: skip
DRAWING = ("libEGL.so.1", "libOSMesa.so.8", "libOSMesa.so")  # libraries that VTK loads
ENDINGS = (".png", ".jpg", ".jpeg", ".tif", ".bmp")
VIEW = np.array([0.95, -1.0, 0.62])  # from the cut quarter (+x, -y), from above
ROLES = {0: ("free", "#d9a441"), 1: ("fixed", "#9aa3ad"), 2: ("driven", "#c0392b"),
         3: ("ghost", "#5b9bd0")}  # fmt: skip
WALL_GREY, TOOL_RED, SOLID_SAND = "#9aa3ad", "#c0392b", "#d8c7a3"


def loads(library: str) -> bool:
    """Whether the system finds a shared library."""
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def load_pyvista() -> object:
    """Import pyvista, or say how to get it and what it draws with (VTK would end with a signal)."""
    try:
        import pyvista
    except ImportError as fault:
        raise FaultError(
            "E550", "images need pyvista, which is not installed", "make deps-render", exit_code=4
        ) from fault
    if not os.environ.get("DISPLAY") and not any(map(loads, DRAWING)):
        raise FaultError(
            "E550",
            f"no library that draws without a screen: neither {' nor '.join(DRAWING)}",
            "Debian: apt-get install libegl1; cluster: load Mesa",
            exit_code=4,
        )
    pyvista.OFF_SCREEN = True
    pyvista.vtk_verbosity("error")  # VTK warns that there is no screen, which is not wanted
    return pyvista


class Look(NamedTuple):
    """What an image is coloured by, its pixels, and what images of a series have in common.

    These are the top of the colours and the bounds x, x, y, y, z, z [mm]; None: those of the step.
    """

    color: str
    size: tuple[int, int]
    top: float | None = None
    bounds: tuple[float, ...] | None = None


def check_name(output: Path, endings: tuple[str, ...] = ENDINGS) -> None:
    """Raise a fault (E554) for a name that no image can have."""
    if output.suffix not in endings:
        raise FaultError("E554", f"no image can be written as '{output.name}'", "end it with .png")


def render(grains: Path, solid: Path | None, step: int, output: Path, look: Look) -> None:
    """Write a PNG of the grains at a step, coloured, with the block of `solid` around them."""
    check_name(output)
    pyvista = load_pyvista()
    with FieldFile(grains) as fields:
        surfaces = fields.read(0).surfaces
        now, entry = fields.read(step), fields.entry(step)
    if not now.grains:
        raise FaultError(
            "E543", f"{grains} holds no grains", "give grains.h5 first, --solid after it"
        )
    entry.surfaces = surfaces
    plotter = scene(pyvista, entry, now, solid, look)
    try:
        make_folder(output.parent)
        with replaced(output) as temporary:
            plotter.screenshot(str(temporary))
    finally:
        plotter.close()


def scene(
    pyvista: object, entry: Snapshot, now: Snapshot, solid: Path | None, look: Look
) -> object:
    """Return a plotter with all that an image shows."""
    plotter = pyvista.Plotter(off_screen=True, window_size=list(look.size))
    plotter.set_background("white")
    if now.cell is not None:
        fold(entry, now)
        add_cell(pyvista, plotter, now.cell)
    add_grains(pyvista, plotter, entry, now, look)
    nodes = np.empty((0, 3))
    if solid is not None:
        nodes = add_solid(pyvista, plotter, solid, now.time)
    add_surfaces(pyvista, plotter, entry, now, nodes)
    low, high = np.reshape(plotter.bounds, (3, 2)).T
    text = f"t = {now.time:.4g} s\n{' x '.join(f'{d:.3g}' for d in high - low)} mm"
    plotter.add_text(text, position=(0.02, 0.92), viewport=True, font_size=11, color="black")
    plotter.add_text(f"Talus {version()}", position="lower_right", font_size=6, color="grey")
    plotter.enable_parallel_projection()
    plotter.camera_position = [tuple(10.0 * VIEW), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
    plotter.enable_anti_aliasing("ssaa")
    plotter.reset_camera(bounds=look.bounds)
    plotter.camera.zoom(1.15)
    return plotter


def fold(first: Snapshot, now: Snapshot) -> None:
    """Move grains into their cell; displacements become those relative to its flow."""
    if first.cell is not None:
        first.grains["x"] = now.cell.flow(first.cell, first.grains["x"])
    before, now.grains["x"] = now.grains["x"], now.cell.fold(now.grains["x"])
    join_features(now.grains, before)
    inside, now.grains["x"] = now.grains["x"], before
    moved = np.nan_to_num(displacement(first.grains, now.grains))
    now.grains["x"] = inside
    _, there, here = np.intersect1d(first.grains["id"], now.grains["id"], return_indices=True)
    first.grains["x"][there] = (inside - moved)[here]


def add_cell(pyvista: object, plotter: object, cell: Cell) -> None:
    """Add the twelve edges of a cell as lines."""
    for k in range(3):
        a, b, c = np.roll(cell.vectors, -k, axis=0)
        for corner in (0.0 * a, b, c, b + c):
            start = MILLI * (cell.origin + corner)
            plotter.add_mesh(pyvista.Line(start, start + MILLI * a), color="black", line_width=2)


def in_cut(x: np.ndarray) -> np.ndarray:
    """Whether points lie in the quarter that is cut away (x > 0, y < 0)."""
    return (x[..., 0] > 0.0) & (x[..., 1] < 0.0)


def values_of(first: Snapshot, now: Snapshot, color: str) -> np.ndarray:
    """Values that the grains are coloured by (n): displacement since `first`, speed or force."""
    if color == "force":
        if "force" not in now.grains:
            raise FaultError("E543", "the field file holds no forces", "colour by another field")
        return np.linalg.norm(now.grains["force"], axis=1)
    if color == "generation":
        if "generation" not in now.grains:
            raise FaultError("E621", "the grains of the field file do not break",
                             "colour by another field, or run with &breakage")  # fmt: skip
        return now.grains["generation"].astype(float)
    if color == "speed":
        return np.linalg.norm(now.grains["v"], axis=1)
    return MILLI * np.linalg.norm(np.nan_to_num(displacement(first.grains, now.grains)), axis=1)


def round_above(value: float) -> float:
    """Return the next of some numbers whose fifths are short, times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    steps = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 7.5, 10.0)
    return float(power * min(s for s in steps if s * (1.0 + 1.0e-9) >= value / power))


def add_grains(
    pyvista: object, plotter: object, first: Snapshot, now: Snapshot, look: Look
) -> None:
    """Add the grains outside the cut: free coloured, walls grey, the penetrator whole and red.

    By role all have the colour of their kind, and a legend names it.
    """
    g = now.grains
    kind = g["kind"]
    shown = ~in_cut(g["x"])
    if look.color == "role":
        sets = [(shown & (kind == k) | (kind == k) & (k == DRIVEN), *ROLES[k]) for k in ROLES]
        plotter.add_legend([list(role) for role in ROLES.values()], bcolor="white", face="circle",
                           size=(0.12, 0.14), loc="center right")  # fmt: skip
    else:
        add_free(pyvista, plotter, first, now, look)
        walls = shown & np.isin(kind, (FIXED, GHOST))
        sets = [(walls, "walls", WALL_GREY), (kind == DRIVEN, "driven", TOOL_RED)]
    for rows, _, colour in sets:
        if rows.any():
            mesh = ellipsoids(pyvista, g, np.flatnonzero(rows), np.zeros(int(rows.sum())))
            plotter.add_mesh(mesh, color=colour, smooth_shading=True)


def top_of(values: np.ndarray) -> float:
    """Top of the colours for values: a round number above all but the largest hundredth."""
    return round_above(max(float(np.quantile(values, 0.99)), 1.0e-12))


def add_free(pyvista: object, plotter: object, first: Snapshot, now: Snapshot, look: Look) -> None:
    """Add the free grains outside the cut, coloured by a field with its bar."""
    g = now.grains
    free = ~in_cut(g["x"]) & ~np.isin(g["kind"], (FIXED, DRIVEN, GHOST))
    if not free.any():
        return
    values = values_of(first, now, look.color)[free]
    top, labels = look.top or top_of(values), 6
    if look.color == "generation":
        top = max(float(values.max()), 1.0)
        labels = int(top) + 1
    if values.max() > top:
        note = f"some grains above the scale: up to {values.max():.3g}"
        plotter.add_text(note, position=(0.02, 0.02), viewport=True, font_size=8, color="black")
    bar = {"title": COLOURS_OF[look.color], "color": "black", "vertical": True, "position_x": 0.88,
           "position_y": 0.25, "height": 0.5, "n_labels": labels,
           "fmt": "%.3g"}  # fmt: skip
    mesh = ellipsoids(pyvista, g, np.flatnonzero(free), values)
    colours = {"scalars": "value", "cmap": "viridis", "clim": (0.0, top)}
    plotter.add_mesh(mesh, smooth_shading=True, scalar_bar_args=bar, **colours)


def ellipsoids(
    pyvista: object, g: dict[str, np.ndarray], rows: np.ndarray, values: np.ndarray
) -> object:
    """Return one surface of many grains with the point data `value`; lengths in mm."""
    some = drawn(g)[rows]
    rows, values = rows[some], values[some]
    marks = g.get("vertices", np.zeros(len(g["x"]), int))[rows]
    fine = 2 if "skew" in g or marks.any() else 1  # flat spots leave fewer points
    ball = pyvista.Sphere(radius=1.0, theta_resolution=20 * fine, phi_resolution=14 * fine)
    unit = np.asarray(ball.points, float)
    faces = np.asarray(ball.faces).reshape(-1, 4)
    turn = rotations(g["quat"][rows])
    points = np.einsum("nij,nj,pj->npi", turn, g["axes"][rows], unit)
    if "skew" in g:
        form = [g[name][rows] for name in ("axes", "skew", "exponent")]
        other = formed(form[1], form[2])
        shaped = surface_points(*(part[other] for part in form), unit)
        points[other] = np.einsum("nij,npj->npi", turn[other], shaped)
    points += g["x"][rows][:, None, :]
    points[marks > 0] = rounded_points(g, rows[marks > 0], unit)
    shift = (np.arange(len(rows)) * len(unit))[:, None, None]
    cells = np.tile(faces, (len(rows), 1, 1))
    cells[:, :, 1:] += shift
    mesh = pyvista.PolyData(MILLI * points.reshape(-1, 3), cells.ravel())
    mesh["value"] = np.repeat(values, len(unit))
    return mesh


def add_surfaces(
    pyvista: object, plotter: object, first: Snapshot, now: Snapshot, nodes: np.ndarray
) -> None:
    """Add the triangles that grains meet: fixed ones as glass, moving ones red.

    A surface whose corners are nodes (n, 3) [mm] of the solid is the solid's own face: it is drawn
    with the solid.
    """
    s, before = now.surfaces, first.surfaces
    for number in np.unique(s.get("surface", [])):
        rows = s["triangles"][s["surface"] == number]
        if lies_on(MILLI * s["x"][np.unique(rows)], nodes):
            continue
        moved = number not in before["surface"] or np.any(s["x"][rows] != before["x"][rows])
        cells = np.column_stack([np.full(len(rows), 3), rows])
        mesh = pyvista.PolyData(MILLI * s["x"], cells.ravel())
        look = {"color": TOOL_RED} if moved else {"color": WALL_GREY, "opacity": 0.25}
        plotter.add_mesh(mesh.clean(), **look)


def lies_on(points: np.ndarray, nodes: np.ndarray) -> bool:
    """Return whether points (a few are checked) are nodes, to a micrometre [mm]."""
    few = points[:: max(1, len(points) // 20)]
    if not len(nodes):
        return False
    return all(np.linalg.norm(nodes - p, axis=1).min() < 1e-3 for p in few)


def add_solid(pyvista: object, plotter: object, path: Path, time: float) -> np.ndarray:
    """Add the block at the step nearest in time, without the elements of the cut.

    Returns its nodes (n, 3) there [mm].
    """
    with FieldFile(path) as fields:
        if fields.mesh is None:
            raise FaultError(
                "E543", f"{path} holds no mesh", "the field file of the solid is wanted"
            )
        x, elements = fields.mesh
        times = [fields.read(k).time for k in range(len(fields))]
        step = int(np.argmin(np.abs(np.array(times) - time)))
        moved = fields.read(step).solid.get("u", np.zeros_like(x))
    cells = {VTK[kind]: rows for kind, rows in elements.items()}
    grid = pyvista.UnstructuredGrid(cells, MILLI * (x + moved))
    corners = [x[rows] for rows in elements.values()]
    low = np.concatenate([p.min(axis=1) for p in corners])
    high = np.concatenate([p.max(axis=1) for p in corners])
    block = split_at_cut(grid, low, high)
    plotter.add_mesh(
        block, color=SOLID_SAND, show_edges=True, edge_color="#8a7a58", line_width=1, ambient=0.25
    )
    return MILLI * (x + moved)


def split_at_cut(grid: object, low: np.ndarray, high: np.ndarray) -> object:
    """Return the elements outside the cut; low, high (m, 3) are their bounds [m] at the start.

    Only where elements straddle the planes of the cut are they clipped (which splits them).
    """
    small = 1.0e-9
    inside = (low[:, 0] > -small) & (high[:, 1] < small)
    straddle = (high[:, 0] > small) & (low[:, 1] < -small) & ~inside
    whole = grid.extract_cells(np.flatnonzero(~inside & ~straddle))
    if not straddle.any():
        return whole
    part = grid.extract_cells(np.flatnonzero(straddle))
    left = part.clip(normal=(1.0, 0.0, 0.0), origin=(0.0, 0.0, 0.0))
    right = part.clip(normal=(-1.0, 0.0, 0.0), origin=(0.0, 0.0, 0.0))
    right = right.clip(normal=(0.0, -1.0, 0.0), origin=(0.0, 0.0, 0.0))
    return whole.merge([left, right], merge_points=False)
