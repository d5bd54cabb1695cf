"""Image of the contact network: a tube a contact, thick and bright where the force is large."""

from pathlib import Path

import numpy as np

from talus import version
from talus.faults import FaultError
from talus.fields import Cell, FieldFile
from talus.files import make_folder, replaced
from talus.measure_plots import contacts_of
from talus.pictures import ENDINGS, MILLI, VIEW, load_pyvista

THICKEST = 0.35  # radius of the tube of the largest force over the mean least semi-axis
SIDES = 8


def ends_of(
    contacts: dict[str, np.ndarray], grains: dict[str, np.ndarray], cell: Cell | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the branches (m, 3) [m]: grain centres, or the contact point on a plane.

    In a periodic cell the second end is an image, and branches are moved into the cell.
    """
    row = {int(number): k for k, number in enumerate(grains["id"])}
    first, second = contacts["ids"].T
    end = grains["x"][[row[int(k)] for k in second]]
    start = contacts["point"].copy()
    inner = first > 0
    start[inner] = grains["x"][[row[int(k)] for k in first[inner]]]
    if cell is not None:
        end = cell.nearest(end, contacts["point"])
        inside = cell.fold(start)
        start, end = inside, end + inside - start
    return start, end


def tubes(start: np.ndarray, end: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (2 SIDES m, 3) and quads of tubes from start to end (m, 3) with radius (m)."""
    along = end - start
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1.0e-300)
    helper = np.eye(3)[np.abs(along).argmin(axis=1)]
    u = np.cross(along, helper)
    u /= np.maximum(np.linalg.norm(u, axis=1, keepdims=True), 1.0e-300)
    w = np.cross(along, u)
    turn = 2.0 * np.pi * np.arange(SIDES) / SIDES
    ring = np.cos(turn)[None, :, None] * u[:, None] + np.sin(turn)[None, :, None] * w[:, None]
    ring *= radius[:, None, None]
    points = np.concatenate([start[:, None] + ring, end[:, None] + ring], axis=1)
    k = np.arange(SIDES)
    quad = np.column_stack(
        [np.full(SIDES, 4), k, (k + 1) % SIDES, SIDES + (k + 1) % SIDES, SIDES + k]
    )
    quads = np.tile(quad, (len(start), 1, 1))
    quads[:, :, 1:] += (2 * SIDES * np.arange(len(start)))[:, None, None]
    return points.reshape(-1, 3), quads.reshape(-1, 5)


def render(path: Path, step: int, output: Path, size: tuple[int, int]) -> None:
    """Write an image of the contact network of a step of a field file."""
    if output.suffix not in ENDINGS:
        raise FaultError("E554", f"no image can be written as '{output.name}'", "end it with .png")
    time, contacts, grains = contacts_of(path, step)
    with FieldFile(path) as fields:
        cell = fields.read(step).cell
    if not len(contacts["ids"]):
        raise FaultError("E543", f"{path} holds no contacts at {time:g} s", "choose another --step")
    pyvista = load_pyvista()
    force = np.linalg.norm(contacts["force"], axis=1)
    top = max(float(np.quantile(force, 0.99)), 1.0e-300)
    thick = THICKEST * grains["axes"].min(axis=1).mean() * np.sqrt(np.minimum(force / top, 1.0))
    points, quads = tubes(*ends_of(contacts, grains, cell), thick)
    mesh = pyvista.PolyData(MILLI * points, quads.ravel())
    mesh["force [N]"] = np.repeat(force, 2 * SIDES)
    plotter = pyvista.Plotter(off_screen=True, window_size=list(size))
    plotter.set_background("white")
    bar = {"title": "force [N]", "color": "black", "vertical": True, "position_x": 0.88,
           "position_y": 0.25, "height": 0.5, "n_labels": 5}  # fmt: skip
    plotter.add_mesh(mesh, cmap="viridis", clim=(0.0, top), scalar_bar_args=bar)
    text = f"t = {time:.4g} s, {len(force)} contacts"
    plotter.add_text(text, position=(0.02, 0.94), viewport=True, font_size=11, color="black")
    plotter.add_text(f"Talus {version()}", position="lower_right", font_size=6, color="grey")
    plotter.enable_parallel_projection()
    plotter.camera_position = [tuple(10.0 * VIEW), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
    plotter.enable_anti_aliasing("ssaa")
    plotter.reset_camera()
    try:
        make_folder(output.parent)
        with replaced(output) as temporary:
            plotter.screenshot(str(temporary))
    finally:
        plotter.close()
