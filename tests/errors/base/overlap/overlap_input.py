"""A little overlap for `talus-couple overlap.h5 --weights`: two ghosts in one cube, one contact."""

import h5py
import numpy as np

CORNER = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0],
                   [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])  # fmt: skip


def values_and_slopes(xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return shape functions (8) of the unit cube and their slopes (8, 3)."""
    factor = np.where(CORNER == 1, xi, 1.0 - xi)
    slope = np.array([(2 * CORNER[:, i] - 1) * np.delete(factor, i, 1).prod(1) for i in range(3)])
    return factor.prod(1), slope.T


def write(method: str, copies: int = 1, **more: object) -> None:
    """Write overlap.h5; more: attributes, and arrays under names with __ for /."""
    n = copies
    shape = [values_and_slopes(np.array(x)) for x in ((0.5, 0.5, 0.2), (0.5, 0.5, 0.8))]
    middle, slope = values_and_slopes(np.full(3, 0.5))
    node = np.arange(8 * n).reshape(n, 8) + 1
    attrs = {"format": "talus-overlap", "version": 1, "nodes": 8 * n, "polar": 0, "turning": 1,
             "method": method, "depth": 1.0, "d_max": 0.3, "rho": 1.0}  # fmt: skip
    values = {
        "grains/kind": np.full(2 * n, 2),
        "grains/cell": np.repeat(np.arange(n) + 1, 2),
        "grains/depth": np.tile([0.2, 0.8], n),
        "grains/shape_u": np.tile(np.array([s[0] for s in shape]), (n, 1)),
        "grains/shape_phi": np.zeros((2 * n, 0)),
        "grains/shape_slope": np.tile(np.array([s[1].ravel() for s in shape]), (n, 1)),
        "contacts/pair": np.arange(2 * n).reshape(n, 2) + 1,
        "contacts/arm": np.tile([0.0, 0.0, 0.3, 0.0, 0.0, -0.3], (n, 1)),
        "contacts/normal": np.tile([0.0, 0.0, 1.0], (n, 1)),
        "contacts/stiffness": np.tile([1.0, 0.5], (n, 1)),
        "elements/node_u": node,
        "elements/node_phi": node[:, :0],
        "elements/region": np.full(n, 2),
        "elements/moduli": np.tile(np.eye(9).ravel(), (n, 1)),
        "points/element": np.arange(n) + 1,
        "points/volume": np.ones(n),
        "points/depth": np.full(n, 0.5),
        "points/slope_u": np.tile(slope.ravel(), (n, 1)),
        "points/slope_mean": np.tile(slope.ravel(), (n, 1)),
        "points/value_phi": np.zeros((n, 0)),
        "points/slope_phi": np.zeros((n, 0)),
    }
    for name, value in more.items():
        (values if "__" in name else attrs)[name.replace("__", "/")] = value
    with h5py.File("overlap.h5", "w") as file:
        for name, value in attrs.items():
            file.attrs[name] = value
        for name, value in values.items():
            array = np.asarray(value)
            file[name] = array.astype("i4") if array.dtype.kind == "i" else array
