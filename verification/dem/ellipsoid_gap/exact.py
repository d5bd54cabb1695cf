"""Overlap of random ellipsoid pairs: Talus, brute force, and the original's geometric potential."""

import numpy as np

from talus.verification import Case, field_steps, write_packing

AXES = np.array([2.5e-3, 2.0e-3, 1.5e-3])
PAIRS = 300


def random_rotations(rng: np.random.Generator, n: int) -> np.ndarray:
    """Uniform random unit quaternions (n, 4)."""
    quat = rng.normal(size=(n, 4))
    return quat / np.linalg.norm(quat, axis=1, keepdims=True)


def matrices(quat: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3), body -> space."""
    w, x, y, z = quat.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def gap(r: np.ndarray, a: np.ndarray, b: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Gap in directions n (k, 3) of two ellipsoids with tensors a, b and centre distance r."""
    ha = np.sqrt(np.einsum("ki,ij,kj->k", n, a, n))
    hb = np.sqrt(np.einsum("ki,ij,kj->k", n, b, n))
    return n @ r - ha - hb


def brute_force(r: np.ndarray, a: np.ndarray, b: np.ndarray) -> tuple[float, np.ndarray]:
    """Largest gap over ever finer grids of directions about the best one; no derivative used."""
    best = r / np.linalg.norm(r)
    width = 1.2
    for _ in range(45):
        helper = np.eye(3)[np.argmin(np.abs(best))]
        t1 = np.cross(best, helper)
        t1 /= np.linalg.norm(t1)
        t2 = np.cross(best, t1)
        s = np.linspace(-width, width, 21)
        p, q = (g.ravel() for g in np.meshgrid(s, s))
        n = best + p[:, None] * t1 + q[:, None] * t2
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        best = n[np.argmax(gap(r, a, b, n))]
        width *= 0.55
    return float(gap(r, a, b, best[None])[0]), best


def deepest_point(d: np.ndarray, a1: np.ndarray, a2: np.ndarray) -> np.ndarray:
    """Deepest point of body 2 in body 1, from its centre: (A1 + l A2) y = A1 d, y A2 y = 1, l > 0.

    d is the centre of body 1 seen from body 2; a1, a2 are the quadratic forms Q diag(1/a^2) Q'.
    """
    low, high = 0.0, 1.0

    def excess(lam: float) -> float:
        y = np.linalg.solve(a1 + lam * a2, a1 @ d)
        return float(y @ a2 @ y - 1.0)

    while excess(high) > 0:
        high *= 2
    for _ in range(200):
        mid = (low + high) / 2
        low, high = (mid, high) if excess(mid) > 0 else (low, mid)
    return np.linalg.solve(a1 + high * a2, a1 @ d)


def potential_overlap(r: np.ndarray, a: np.ndarray, b: np.ndarray, n: np.ndarray) -> float:
    """Distance of the two deepest points of the geometric potential along the normal [m].

    The points of one level are scaled about the centre, so that the deepest points also lie apart
    along the tangent plane, by a distance of the order of the overlap: only the normal part agrees.
    """
    fa, fb = np.linalg.inv(a), np.linalg.inv(b)
    in_a = r + deepest_point(-r, fa, fb)  # point of B deepest in A
    in_b = deepest_point(r, fb, fa)  # point of A deepest in B
    return float(abs((in_a - in_b) @ n))


def make_pairs(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions, quaternions, brute-force overlaps of pairs that overlap by 0.05 to 2 %."""
    quat = random_rotations(rng, 2 * PAIRS)
    q = matrices(quat)
    tensor = np.einsum("nij,j,nkj->nik", q, AXES**2, q)
    x, exact = np.zeros((2 * PAIRS, 3)), np.zeros(PAIRS)
    for k in range(PAIRS):
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        a, b = tensor[2 * k], tensor[2 * k + 1]
        wanted = -1.5e-3 * rng.uniform(5e-4, 2e-2)
        low, high = 2.0e-3, 6.0e-3
        for _ in range(60):
            mid = (low + high) / 2
            low, high = (mid, high) if brute_quick(mid * direction, a, b) < wanted else (low, mid)
        x[2 * k] = [0.02 * (k % 20), 0.02 * (k // 20), 0.0]
        x[2 * k + 1] = x[2 * k] + high * direction
        exact[k] = -brute_force(x[2 * k + 1] - x[2 * k], a, b)[0]
    return x, quat, exact


def brute_quick(r: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    """Gap by a fixed point of normals, good enough to place the pairs."""
    n = r / np.linalg.norm(r)
    best = -np.inf
    for _ in range(12):
        g = float(gap(r, a, b, n[None])[0])
        best = max(best, g)
        d = r - b @ n / np.sqrt(n @ b @ n) - a @ n / np.sqrt(n @ a @ n)
        n = n + 0.3 * (d - (d @ n) * n) / np.linalg.norm(r)
        n /= np.linalg.norm(n)
    return best


def run(case: Case) -> None:
    """Judge overlaps and normals of all pairs; plot the difference to the geometric potential."""
    rng = np.random.default_rng(7)
    x, quat, exact = make_pairs(rng)
    write_packing(case.folder / "pack.h5", x, np.tile(AXES, (2 * PAIRS, 1)), quat=quat)
    case.run("talus-dem", "deck.nml")
    contacts = field_steps(case.folder / "deck.h5")[0].contacts
    first = np.minimum(contacts["ids"][:, 0], contacts["ids"][:, 1])
    order = np.argsort(first)
    found = np.full(PAIRS, np.nan)
    found[(first[order] - 1) // 2] = contacts["overlap"][order]
    normal = np.zeros((PAIRS, 3))
    normal[(first[order] - 1) // 2] = contacts["normal"][order]
    missing = int(np.isnan(found).sum())
    case.metric("pairs missed", missing, 0, 0)
    case.below(
        "largest |overlap - brute force| / semi-axis",
        float(np.nanmax(np.abs(found - exact)) / 2.5e-3),
        1e-12,
    )
    q = matrices(quat)
    tensor = np.einsum("nij,j,nkj->nik", q, AXES**2, q)
    other = np.array(
        [
            potential_overlap(x[2 * k + 1] - x[2 * k], tensor[2 * k], tensor[2 * k + 1], normal[k])
            for k in range(PAIRS)
        ]
    )
    relative = np.abs(other - found) / found
    direction = np.array(
        [
            brute_force(x[2 * k + 1] - x[2 * k], tensor[2 * k], tensor[2 * k + 1])[1]
            for k in range(PAIRS)
        ]
    )
    turned = np.abs(normal - direction).max()
    case.below(
        "largest difference of the normal", float(turned), 1e-6, "the gap is flat: sqrt(eps)"
    )
    order = np.polyfit(np.log(found), np.log(relative), 1)[0]
    name = "order of the difference to the geometric potential"
    case.metric(name, float(order), 1.0, 0.15, "O(overlap/R)")
    fig, ax = case.figure()
    ax.loglog(found / 1.5e-3, relative, "o", ms=4, label="geometric potential against Talus")
    ax.loglog(found / 1.5e-3, found / 1.5e-3, "-", label="overlap / least semi-axis")
    ax.set(xlabel="overlap / least semi-axis [-]", ylabel="relative difference of overlap [-]")
    ax.legend()
    case.save(fig)
