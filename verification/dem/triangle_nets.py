"""Nets of triangles as STL files: irregular floors, floors of pyramids."""

from pathlib import Path

import numpy as np


def net(count: int, size: float) -> np.ndarray:
    """Return points (count + 1, count + 1, 3) of a plane net around the origin [m]."""
    i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
    return size * np.stack([i - count / 2, j - count / 2, np.zeros_like(i)], -1).astype(float)


def rough_net() -> np.ndarray:
    """Return the points of irregular triangles of about 3 mm in one plane [m]."""
    rng = np.random.default_rng(5)
    x = net(12, 3.0e-3)
    x[..., :2] += rng.uniform(-0.9e-3, 0.9e-3, x[..., :2].shape)
    return x


def pyramids() -> np.ndarray:
    """Return the points of a floor of pyramids, 7 mm wide and 2.5 mm high [m]."""
    x = net(8, 3.5e-3)
    x[1::2, 1::2, 2] = 2.5e-3
    return x


def write_stl(path: Path, x: np.ndarray) -> None:
    """Write a net of points x (m, n, 3) as triangles."""
    a, b, c, d = x[:-1, :-1], x[1:, :-1], x[1:, 1:], x[:-1, 1:]
    triangles = np.stack([np.stack([a, b, c], -2), np.stack([a, c, d], -2)], 2).reshape(-1, 3, 3)
    write_triangles(path, triangles)


def write_triangles(path: Path, triangles: np.ndarray) -> None:
    """Write triangles (n, 3, 3), corners from outside against the clock."""
    lines = ["solid floor"]
    for corners in triangles:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {p[0]:.17g} {p[1]:.17g} {p[2]:.17g}" for p in corners]
        lines += ["endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid floor", ""]))
