"""All contacts of a packing by brute force, without normals, gaps, cells or lists.

Two ellipsoids overlap if and only if the contact function of Perram and Wertheim,
F = max over 0 < s < 1 of s (1-s) r.[(1-s) A + s B]^-1 r, is below 1 (J. Comput. Phys. 58, 1985);
A and B are Q diag(a^2, b^2, c^2) Q'. The function of s is concave: a golden section finds its
maximum. A plane cuts an ellipsoid if its distance from the centre is less than sqrt(n.A n).
"""

import numpy as np

GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
SECTIONS = 40  # the maximum is flat: an error of 4e-9 in s is 1e-16 in F
ROWS = 500  # grains whose pairs are looked at together


def tensors(quat: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Q diag(a^2, b^2, c^2) Q' of each grain (n, 3, 3) [m2]."""
    w, x, y, z = quat.T
    turn = np.moveaxis(np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]), 2, 0)  # fmt: skip
    return np.einsum("nij,nj,nkj->nik", turn, axes**2, turn)


def contact_function(r: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """F of pairs (m,): below 1 they overlap; r (m, 3) [m], a and b (m, 3, 3) [m2]."""

    def value(s: np.ndarray) -> np.ndarray:
        mixed = (1.0 - s)[:, None, None] * a + s[:, None, None] * b
        solved = np.linalg.solve(mixed, r[:, :, None])[:, :, 0]
        return s * (1.0 - s) * np.einsum("mi,mi->m", r, solved)

    low, high = np.zeros(len(r)), np.ones(len(r))
    left, right = high - GOLDEN, low + GOLDEN
    at_left, at_right = value(left), value(right)
    for _ in range(SECTIONS):
        rising = at_left < at_right
        low, high = np.where(rising, left, low), np.where(rising, high, right)
        width = GOLDEN * (high - low)
        new = value(np.where(rising, low + width, high - width))
        left, right = high - width, low + width
        at_left, at_right = np.where(rising, at_right, new), np.where(rising, new, at_left)
    return np.maximum(at_left, at_right)


def grain_pairs(grains: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Pairs (m, 2) of rows with a free grain whose bounding spheres meet, of all n (n-1)/2; F."""
    x, radius = grains["x"], grains["axes"].max(axis=1)
    found = []
    for start in range(0, len(x), ROWS):
        part = slice(start, start + ROWS)
        distance = np.linalg.norm(x[part, None] - x[None], axis=2)
        i, j = np.nonzero(distance < radius[part, None] + radius[None])
        found.append(np.column_stack([i + start, j])[j > i + start])
    pairs = np.concatenate(found)
    pairs = pairs[(grains["kind"][pairs] == 0).any(axis=1)]
    tensor = tensors(grains["quat"], grains["axes"])
    i, j = pairs.T
    return pairs, contact_function(x[j] - x[i], tensor[i], tensor[j])


def compare(step: object, planes: dict[int, tuple], slack: float) -> dict[str, int]:
    """Count the contacts of a step of a field file against brute force.

    `planes` has point and normal of each plane by its id in the output (-1, -2, ...). Pairs whose
    overlap is below `slack` of the size (F within 2 slack of 1) may be listed or not.
    """
    grains, ids = step.grains, step.grains["id"]
    listed = {(int(i), int(j)) for i, j in np.sort(step.contacts["ids"], axis=1)}
    pairs, function = grain_pairs(grains)
    names = ids[pairs]
    tensor = tensors(grains["quat"], grains["axes"])
    touching = {tuple(map(int, p)) for p in np.sort(names[function < 1.0 - 2.0 * slack], axis=1)}
    maybe = {tuple(map(int, p)) for p in np.sort(names[function < 1.0 + 2.0 * slack], axis=1)}
    for plane, (point, normal) in planes.items():
        n = np.array(normal) / np.linalg.norm(normal)
        reach = np.sqrt(np.einsum("i,nij,j->n", n, tensor, n))
        gap = ((grains["x"] - np.array(point)) @ n - reach) / reach
        free = grains["kind"] == 0
        touching |= {(plane, int(i)) for i in ids[free & (gap < -slack)]}
        maybe |= {(plane, int(i)) for i in ids[free & (gap < slack)]}
    return {
        "pairs": len(ids) * (len(ids) - 1) // 2,
        "contacts": len(touching),
        "missed": len(touching - listed),
        "invented": len(listed - maybe),
    }
