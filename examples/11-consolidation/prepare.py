"""Columns that consolidate: of grains, of elements, and of both, either half below.

Usage: prepare.py, in the folder of the run.
"""

from pathlib import Path

import numpy as np

from talus import mesh as meshes
from talus.packing import make_packing, write_h5

D, STIFFNESS, SIDE, LAYERS = 1.0e-3, 1.0e5, 3, 100  # of the lattice [m], [N/m], grains
HEIGHT, MODULUS = LAYERS * D, STIFFNESS / D  # [m], [Pa]
LOAD, RAMP, EXCHANGE = 1.0e4, 5.0e-4, 8.0e-6  # [Pa], [s], [s]
STORAGE = (1.0 - np.pi / 6.0) / 2.2e9  # of the liquid [1/Pa]
SPEED = 1.0e-9 / (STORAGE + 1.0 / MODULUS)  # c_v [m2/s]
HISTORY = EXCHANGE * round(0.05 * HEIGHT**2 / SPEED / EXCHANGE / 16)
OUTPUT, T_END = 16 * HISTORY, 160 * HISTORY  # time factors 0.05 and 0.5 [s]
FLOOR = "&wall id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'floor' /"
WEIGHT = "&surcharge stress = 1.0e4, curve = 'ramp', lower = 0.0, 0.0, upper = 0.003, 0.003 /"
DRAIN = "&drain side = 'z1', pressure = 0.0 /"
LOADED = "&pressure group = 'z1', value = 1.0e4, curve = 'ramp' /"
OPEN = "&pore_pressure group = 'z1', value = 0.0 /"
FAINT = "&spring group = 'z1', normal = 1.0e3 /"  # statics want a body that is held
HELD = "&support group = 'z0', fix = 'x', 'y', 'z' /"
#: Names, and the heights that are grains; ghosts are the layer on the facets.
COLUMNS = {"grains": (0, LAYERS), "elements": (0, 0), "below": (0, 50), "above": (50, LAYERS)}


def fill(part: str, name: str, words: dict[str, object]) -> None:
    """Write a deck with its words filled in."""
    text = (Path(__file__).parent / f"{part}.nml").read_text()
    shared = {"OUTPUT": repr(OUTPUT), "HISTORY": repr(HISTORY), "T_END": repr(T_END)}
    for word, value in (words | shared).items():
        text = text.replace(f"@{word.lower()}@", str(value))
    Path(f"{name}.nml").write_text(text)


def write_grains(name: str, alone: str) -> None:
    """Write packing and deck of the grains of a column."""
    first, last = COLUMNS[name]
    places = np.meshgrid(*(np.arange(k) for k in (SIDE, SIDE, last - first)), indexing="ij")
    x = D * (np.stack(places, -1).reshape(-1, 3) + [0.5, 0.5, first + 0.5])
    ghosts = np.flatnonzero(places[2].ravel() == (0 if first else last - 1)) + 1
    groups = {} if last - first == LAYERS else {"ghosts": ghosts}
    write_h5(Path(f"{name}.h5"), make_packing(x, np.full((len(x), 3), 0.5 * D), groups=groups))
    lower = (first + 0.5) * D if first else 0.0
    upper = (last - 0.5) * D if last < LAYERS else HEIGHT
    ends = [FLOOR] * (first == 0) + [WEIGHT, DRAIN] * (last == LAYERS)
    fill("grains", f"{name}_grains", {
        "RUN": alone, "PACK": f"{name}.h5", "ENDS": "\n".join(ends), "LOWER": lower,
        "UPPER": upper, "BRICKS": round((upper - lower) / 5.0e-3)})  # fmt: skip


def write_elements(name: str, alone: str) -> None:
    """Write mesh and deck of the elements of a column."""
    first, last = COLUMNS[name]
    lower = (last - 0.5) * D if 0 < last < LAYERS else 0.0
    upper = (first + 0.5) * D if first else HEIGHT
    number = (1, 1, round((upper - lower) / 5.0e-3))
    mesh = meshes.box(np.array([0.0, 0.0, lower]), np.array([0.003, 0.003, upper]), number)
    meshes.write_mesh(Path(f"{name}_mesh.h5"), mesh)
    ends = [HELD] * (lower == 0.0) + [FAINT] * (lower > 0.0) + [LOADED, OPEN] * (upper == HEIGHT)
    fill("solid", f"{name}_solid", {
        "RUN": alone, "MESH": f"{name}_mesh.h5", "ENDS": "\n".join(ends),
        "STEP": f", dt = {4 * EXCHANGE}" if alone else ""})  # fmt: skip


def main() -> None:
    """Write all four."""
    alone = f", t_end = {T_END!r}"
    write_grains("grains", alone)
    write_elements("elements", alone)
    for name, facets in (("below", "z0"), ("above", "z1")):
        write_grains(name, "")
        write_elements(name, "")
        words = {"GRAINS": f"{name}_grains.nml", "SOLID": f"{name}_solid.nml", "FACETS": facets,
                 "EXCHANGE": repr(EXCHANGE)}  # fmt: skip
        fill("coupled", name, words)


if __name__ == "__main__":
    main()
