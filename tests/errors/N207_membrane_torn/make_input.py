"""A sphere far above a sheet."""

from pathlib import Path

import numpy as np

from talus.packing import make_packing, write_h5

SIDES, EDGE, BUMP = 4, 0.01, 0.0

x = np.array([[0.0, 0.0, 0.05]])
write_h5(Path("packing.h5"), make_packing(x, np.full((1, 3), 1.0e-3)))
grid = EDGE * np.linspace(-0.5, 0.5, SIDES + 1)
node = np.stack(np.meshgrid(grid, grid, indexing="ij"), -1)
high = BUMP * (-1.0) ** np.add.outer(np.arange(SIDES + 1), np.arange(SIDES + 1))
node = np.concatenate([node, high[:, :, None]], 2)
a, b, c, d = node[:-1, :-1], node[1:, :-1], node[:-1, 1:], node[1:, 1:]
corner = np.concatenate([np.stack([a, b, d], 2), np.stack([a, d, c], 2)]).reshape(-1, 3, 3)
lines = ["solid sheet"]
for triangle in corner:
    lines += ["facet normal 0 0 1", "outer loop"]
    lines += ["vertex " + " ".join(f"{v:.9e}" for v in point) for point in triangle]
    lines += ["endloop", "endfacet"]
Path("sheet.stl").write_text("\n".join([*lines, "endsolid sheet", ""]))
