"""Measures of a packing: solid fraction, gaps and contacts of ellipsoids, fabric, bed height.

Arrays have one row a grain or a pair; SI units; quaternions are (w, x, y, z), body to space.
"""

from collections.abc import Callable, Iterable

import numpy as np

from talus.faults import FaultError
from talus.forms import Forms, bounding_radii, formed, inside, volumes
from talus.packing import FIXED, FREE, Packing

Watch = Callable[[Iterable], Iterable]


def rotations(quat: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3) of quaternions (n, 4); columns are the body axes in space."""
    w, x, y, z = (quat / np.linalg.norm(quat, axis=1, keepdims=True)).T
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], -1),
            np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], -1),
            np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1),
        ],
        axis=1,
    )


def shape_tensors(axes: np.ndarray, quat: np.ndarray) -> np.ndarray:
    """Tensors R diag(axes^2) R^T (n, 3, 3): the support along a unit n is sqrt(n . S n) [m2]."""
    turn = rotations(quat)
    return np.einsum("nij,nj,nkj->nik", turn, axes**2, turn)


def extents(packing: Packing) -> np.ndarray:
    """Half-sizes of the boxes with edges along x, y, z around the grains (n, 3) [m]."""
    return np.sqrt(np.einsum("nii->ni", shape_tensors(packing.axes, packing.quat)))


def solid_fraction(
    packing: Packing, lower: np.ndarray, upper: np.ndarray, spacing: float, watch: Watch = iter
) -> float:
    """Return the part of a box that lies inside grains, by points on a grid `spacing` [m] apart.

    Points inside two grains (their overlap) count once. The grid divides the box evenly, with half
    a spacing at its faces, so that boxes with a common face share no point.
    """
    lower, upper = np.asarray(lower, float), np.asarray(upper, float)
    if not (upper > lower).all() or spacing <= 0.0:
        raise FaultError("E541", f"no region between {lower} and {upper} m", "lower < upper")
    count = np.maximum(1, np.ceil((upper - lower) / spacing - 1.0e-9).astype(int))
    step = (upper - lower) / count
    filled = np.zeros(count, bool)
    half = extents(packing)
    other = formed(packing.skew, packing.exponent)
    turn = rotations(packing.quat)
    shapes = Forms(packing.axes, packing.skew, packing.exponent)
    half[other] = bounding_radii(shapes.take(other))[:, None]
    inverse = np.linalg.inv(shape_tensors(packing.axes, packing.quat))
    near = ((packing.x + half > lower) & (packing.x - half < upper)).all(axis=1)
    for k in watch(np.flatnonzero(near)):
        first = np.ceil((packing.x[k] - half[k] - lower) / step - 0.5).astype(int).clip(0)
        last = (np.floor((packing.x[k] + half[k] - lower) / step - 0.5).astype(int) + 1).clip(0)
        last = np.minimum(last, count)
        if (last <= first).any():
            continue
        d = [
            lower[i] + (np.arange(first[i], last[i]) + 0.5) * step[i] - packing.x[k, i]
            for i in range(3)
        ]
        a = inverse[k]
        x, y, z = d[0][:, None, None], d[1][None, :, None], d[2][None, None, :]
        level = (
            a[0, 0] * x * x + a[1, 1] * y * y + a[2, 2] * z * z
            + 2.0 * (a[0, 1] * x * y + a[1, 2] * y * z + a[0, 2] * x * z)
        )  # fmt: skip
        full = level <= 1.0
        if other[k]:
            local = np.stack(np.meshgrid(*d, indexing="ij"), -1) @ turn[k]
            full = inside(local, packing.axes[k], packing.skew[k], packing.exponent[k])
        filled[first[0] : last[0], first[1] : last[1], first[2] : last[2]] |= full
    return float(filled.mean())


def near_pairs(x: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Pairs (m, 2), rows i < j, whose spheres of radius `reach` (n) [m] touch, by cells."""
    if not len(x):
        return np.empty((0, 2), int)
    edge = 2.0 * float(reach.max())
    cell = np.floor((x - x.min(axis=0)) / edge).astype(np.int64)
    size = cell.max(axis=0) + 3
    key = ((cell[:, 0] + 1) * size[1] + cell[:, 1] + 1) * size[2] + cell[:, 2] + 1
    order = np.argsort(key, kind="stable")
    key_sorted = key[order]
    found = []
    for shift in np.ndindex(3, 3, 3):
        other = key + ((shift[0] - 1) * size[1] + shift[1] - 1) * size[2] + shift[2] - 1
        first, last = (
            np.searchsorted(key_sorted, other),
            np.searchsorted(key_sorted, other, "right"),
        )
        number = last - first
        i = np.repeat(np.arange(len(x)), number)
        inner = np.arange(number.sum()) - np.repeat(np.cumsum(number) - number, number)
        j = order[np.repeat(first, number) + inner]
        keep = i < j
        found.append(np.column_stack([i[keep], j[keep]]))
    pairs = np.concatenate(found)
    distance = np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1)
    pairs = pairs[distance <= reach[pairs[:, 0]] + reach[pairs[:, 1]]]
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


def gaps(packing: Packing, pairs: np.ndarray, sweeps: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Return the gaps (m) [m] of pairs of ellipsoids and the common normals (m, 3) from i to j.

    The gap is the largest of h(n) = n . (xj - xi) - |n|_Si - |n|_Sj over unit n (support functions
    of both): the distance where they are apart, minus the least overlap where they touch. Newton on
    the sphere with a gradient step where Newton does not rise; it starts from the branch vector.
    """
    s = shape_tensors(packing.axes, packing.quat)
    si, sj = s[pairs[:, 0]], s[pairs[:, 1]]
    branch = packing.x[pairs[:, 1]] - packing.x[pairs[:, 0]]
    n = branch / np.linalg.norm(branch, axis=1, keepdims=True)
    value, gradient, hessian = _support_gap(n, branch, si, sj)
    open_rows = np.arange(len(pairs))
    for _ in range(sweeps):
        if not open_rows.size:
            break
        k = open_rows
        trial = _newton(n[k], gradient[k], hessian[k])
        best, best_value = n[k].copy(), value[k].copy()
        for scale in (1.0, 0.25, 0.0625):
            for step in (trial, gradient[k] / np.linalg.norm(hessian[k], axis=(1, 2))[:, None]):
                there = n[k] + scale * step
                there /= np.linalg.norm(there, axis=1, keepdims=True)
                height = _support_gap(there, branch[k], si[k], sj[k])[0]
                better = height > best_value
                best[better], best_value[better] = there[better], height[better]
        moved = np.linalg.norm(best - n[k], axis=1)
        n[k] = best
        value[k], gradient[k], hessian[k] = _support_gap(best, branch[k], si[k], sj[k])
        open_rows = k[moved > 1.0e-12]
    return value, n


def _support_gap(n: np.ndarray, branch: np.ndarray, si: np.ndarray, sj: np.ndarray) -> tuple:
    """Return h, its gradient along the sphere and its Hessian on the sphere (ambient matrices)."""
    project = np.eye(3) - n[:, :, None] * n[:, None, :]
    value = np.einsum("mi,mi->m", n, branch)
    gradient, hessian = branch.copy(), np.zeros((len(n), 3, 3))
    for s in (si, sj):
        sn = np.einsum("mij,mj->mi", s, n)
        h = np.sqrt(np.einsum("mi,mi->m", n, sn))
        value -= h
        gradient -= sn / h[:, None]
        hessian -= s / h[:, None, None] - sn[:, :, None] * sn[:, None, :] / h[:, None, None] ** 3
    along = np.einsum("mi,mi->m", gradient, n)
    hessian = project @ hessian @ project - along[:, None, None] * project
    return value, np.einsum("mij,mj->mi", project, gradient), hessian


def _newton(n: np.ndarray, gradient: np.ndarray, hessian: np.ndarray) -> np.ndarray:
    """Newton step in the tangent plane; the normal direction is made regular with a unit entry."""
    size = np.linalg.norm(hessian, axis=(1, 2))[:, None, None] + 1.0e-300
    matrix = hessian / size - n[:, :, None] * n[:, None, :]
    step = (
        -np.linalg.solve(matrix - 1.0e-14 * np.eye(3), gradient[:, :, None])[:, :, 0]
        / size[:, :, 0]
    )
    length = np.linalg.norm(step, axis=1, keepdims=True)
    return step * np.minimum(1.0, 0.5 / np.maximum(length, 1.0e-300))


def contacts(packing: Packing, tolerance: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs (m, 2) of rows in contact (gap <= tolerance [m]) and their gaps (m) [m].

    Pairs of two grains that are not free are left out.
    """
    pairs = near_pairs(packing.x, packing.axes.max(axis=1) + 0.5 * tolerance)
    pairs = pairs[(packing.kind[pairs] == FREE).any(axis=1)]
    gap, _ = gaps(packing, pairs)
    touching = gap <= tolerance
    return pairs[touching], gap[touching]


def coordination(packing: Packing, tolerance: float = 0.0) -> np.ndarray:
    """Number of contacts of every grain (n)."""
    pairs, _ = contacts(packing, tolerance)
    return np.bincount(pairs.ravel(), minlength=packing.count)


def short_axis_fabric(packing: Packing, rows: np.ndarray | None = None) -> np.ndarray:
    """Second moment <m m> (3, 3) of the directions of the shortest axes; isotropic: 1/3 delta."""
    chosen = np.flatnonzero(packing.kind == FREE) if rows is None else rows
    turn = rotations(packing.quat[chosen])
    short = np.take_along_axis(turn, packing.axes[chosen].argmin(axis=1)[:, None, None], axis=2)[
        :, :, 0
    ]
    return short.T @ short / max(1, len(chosen))


def tops(packing: Packing) -> np.ndarray:
    """Heights of the highest points of all grains (n) [m]; of other shapes a bound from above."""
    reach = extents(packing)[:, 2]
    other = formed(packing.skew, packing.exponent)
    shapes = Forms(packing.axes, packing.skew, packing.exponent)
    reach[other] = bounding_radii(shapes.take(other))
    return packing.x[:, 2] + reach


def mass_median(packing: Packing) -> float:
    """Twice the middle semi-axis that half of the free grains' volume stays below, d50 [m]."""
    free = packing.kind == FREE
    size = 2.0 * np.median(packing.axes[free], axis=1)
    mass = volumes(packing.axes[free], packing.skew[free], packing.exponent[free])
    order = np.argsort(size, kind="stable")
    share = np.cumsum(mass[order])
    return float(size[order][np.searchsorted(share, 0.5 * share[-1])])


def bed_height(packing: Packing, part: float = 0.98) -> float:
    """Height of the surface: the part `part` of the free grains has its top below it [m]."""
    z = (packing.x[:, 2] + extents(packing)[:, 2])[packing.kind == FREE]
    if not z.size:
        raise FaultError("E540", "the packing has no free grains")
    return float(np.quantile(z, part))


def core_box(packing: Packing, margin: float) -> tuple[np.ndarray, np.ndarray]:
    """Box of the bulk: the free grains' centres less `margin` [m] on all sides."""
    x = packing.x[packing.kind == FREE]
    if not len(x):
        raise FaultError("E540", "the packing has no free grains")
    lower = np.quantile(x, 0.005, axis=0) + margin
    upper = np.quantile(x, 0.995, axis=0) - margin
    if not (upper > lower).all():
        raise FaultError(
            "E541", f"no bulk is left {margin} m inside the packing", "a smaller margin"
        )
    return lower, upper


def bulk_rows(packing: Packing, margin: float) -> np.ndarray:
    """Rows of the free grains whose centres lie in the bulk."""
    lower, upper = core_box(packing, margin)
    inside = ((packing.x >= lower) & (packing.x <= upper)).all(axis=1)
    return np.flatnonzero(inside & (packing.kind == FREE))


def layer_fractions(
    packing: Packing, margin: float, layers: int, spacing: float, watch: Watch = iter
) -> tuple[np.ndarray, np.ndarray]:
    """Return middle heights [m] and solid fractions of equal layers of the bulk."""
    lower, upper = core_box(packing, margin)
    edges = np.linspace(lower[2], upper[2], layers + 1)
    if edges[1] - edges[0] < spacing:
        text = f"{layers} layers would be {edges[1] - edges[0]:.2g} m thin"
        raise FaultError("E541", text, f"the points that are counted are {spacing:.2g} m apart")
    parts = []
    for k in watch(range(layers)):
        low, high = lower.copy(), upper.copy()
        low[2], high[2] = edges[k], edges[k + 1]
        parts.append(solid_fraction(packing, low, high, spacing))
    return 0.5 * (edges[1:] + edges[:-1]), np.array(parts)


def floor_share(
    packing: Packing, force: np.ndarray, density: float = 2650.0, gravity: float = 9.81
) -> float:
    """Vertical load on the lowest fixed grains over the weight of the free ones.

    Below 1 the walls carry a part (silo screening). `force` (n, 3) [N] acts on the grains.
    """
    fixed, free = packing.kind == FIXED, packing.kind == FREE
    if not fixed.any() or not free.any():
        return np.nan
    lowest = packing.x[fixed, 2].min()
    floor = fixed & (packing.x[:, 2] < lowest + 0.5 * packing.axes[fixed].min())
    volume = volumes(packing.axes[free], packing.skew[free], packing.exponent[free])
    weight = density * gravity * volume.sum()
    return float(-force[floor, 2].sum() / weight)


def describe(
    packing: Packing, layers: int = 5, watch: Watch = iter, force: np.ndarray | None = None
) -> dict[str, float]:
    """Return the measures that two packings are compared by."""
    free = packing.kind == FREE
    if not free.any():
        raise FaultError("E540", "the packing has no free grains")
    size = float(np.median(packing.axes[free].mean(axis=1)))
    margin = 3.0 * size
    _, fractions = layer_fractions(packing, margin, layers, size / 8.0, watch)
    bulk = bulk_rows(packing, margin)
    if not bulk.size:
        raise FaultError("E541", "the bulk of the packing holds no grain", "a larger packing")
    fabric = short_axis_fabric(packing, bulk)
    facts = {
        "free grains": float(free.sum()),
        "bulk grains": float(len(bulk)),
        "solid fraction": float(fractions.mean()),
    }
    facts |= {f"solid fraction, layer {k + 1}": float(f) for k, f in enumerate(fractions)}
    facts["coordination"] = float(coordination(packing)[bulk].mean())
    if packing.clumps is None:
        facts["d50 [m]"] = mass_median(packing)
    facts["bed height [m]"] = bed_height(packing)
    facts["highest point [m]"] = float(tops(packing)[free].max())
    facts["short axes, zz"] = float(fabric[2, 2])
    facts["short axes, xx"] = float(fabric[0, 0])
    if force is not None and (packing.kind == FIXED).any():
        facts["load on floor / weight"] = floor_share(packing, force)
    return facts
