"""A sphere above a square sheet of triangles, for decks of membranes."""

from pathlib import Path

import numpy as np

from talus.packing import make_packing, write_h5


def write(sides: int, edge: float, bump: float, height: float) -> None:
    """Write packing.h5 and sheet.stl: sides x sides squares, nodes `bump` up and down [m]."""
    x = np.array([[0.0, 0.0, height]])
    write_h5(Path("packing.h5"), make_packing(x, np.full((1, 3), 1.0e-3)))
    grid = edge * np.linspace(-0.5, 0.5, sides + 1)
    node = np.stack(np.meshgrid(grid, grid, indexing="ij"), -1)
    high = bump * (-1.0) ** np.add.outer(np.arange(sides + 1), np.arange(sides + 1))
    node = np.concatenate([node, high[:, :, None]], 2)
    a, b, c, d = node[:-1, :-1], node[1:, :-1], node[:-1, 1:], node[1:, 1:]
    corner = np.concatenate([np.stack([a, b, d], 2), np.stack([a, d, c], 2)]).reshape(-1, 3, 3)
    lines = ["solid sheet"]
    for triangle in corner:
        lines += ["facet normal 0 0 1", "outer loop"]
        lines += ["vertex " + " ".join(f"{v:.9e}" for v in point) for point in triangle]
        lines += ["endloop", "endfacet"]
    Path("sheet.stl").write_text("\n".join([*lines, "endsolid sheet", ""]))
