"""Random pairs of forms whose overlap and normal are known, and what Talus finds for them.

A pair is made from its contact: a direction n, the surface points of both grains with the normals n
and -n, laid on one line along n an overlap apart. Its gap is then stationary along n. Supports are
those of the theory of grains (Forms), written here a second time.
"""

from dataclasses import dataclass

import numpy as np

from talus.compare import max_of
from talus.forms import centres
from talus.generate import random_quaternions
from talus.measure import rotations
from talus.packing import make_packing, write_h5
from talus.verification import Case, field_steps

LEAST = 0.2e-3  # least semi-axis [m]
ASPECT = 5.0  # greatest over least semi-axis
DEEPEST = 0.05  # of the least semi-axis
MOST_EXPONENT = 8.0
BULGE = 1.0e-4  # by which flat spots are rounded, of the semi-axis
PITCH = 20.0 * ASPECT * LEAST
KINDS = ("sphere", "ellipsoid", "poly-ellipsoid", "superquadric", "skewed superquadric")


@dataclass
class Shapes:
    """Semi-axes on both sides (n, 3), exponents, rotations, kinds of n grains."""

    upper: np.ndarray
    lower: np.ndarray
    exponent: np.ndarray
    quat: np.ndarray
    kind: np.ndarray

    def centre(self) -> np.ndarray:
        """Centre of mass from the octants' origin, in their frame (n, 3)."""
        axes = 0.5 * (self.upper + self.lower)
        return centres(axes, (self.upper - self.lower) / (2.0 * axes), self.exponent)

    def support(self, n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Supports (n) about the centres along unit vectors (n, 3), and surface points (n, 3)."""
        turn = rotations(self.quat)
        m = np.einsum("nji,nj->ni", turn, n)
        a = np.where(m >= 0.0, self.upper, self.lower)
        u = a * m
        q = (self.exponent / (self.exponent - 1.0))[:, None]
        e2 = np.where(q < 2.0, (0.5 * q * BULGE) ** (2.0 / q), 0.0)
        square = (u * u).sum(axis=1, keepdims=True)
        v = u * u + e2 * square
        power = np.where(v > 0.0, v, 1.0) ** (0.5 * q - 1.0)
        total = (power * v).sum(axis=1, keepdims=True)
        scale = total ** (1.0 / q - 1.0) / np.sqrt(1.0 + 3.0 * e2)
        point = scale * a * u * (power + e2 * power.sum(axis=1, keepdims=True)) - self.centre()
        return (point * m).sum(axis=1), np.einsum("nij,nj->ni", turn, point)

    def holds(self, x: np.ndarray) -> np.ndarray:
        """Whether points (n, 3), seen from the centres, lie inside the grains."""
        y = np.einsum("nji,nj->ni", rotations(self.quat), x) + self.centre()
        a = np.where(y >= 0.0, self.upper, self.lower)
        return (np.abs(y / a) ** self.exponent[:, None]).sum(axis=1) <= 1.0

    def take(self, rows: np.ndarray) -> "Shapes":
        """Return some of them."""
        return Shapes(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


def random_shapes(rng: np.random.Generator, n: int) -> Shapes:
    """n grains of all kinds, turned at random; semi-axes from LEAST to ASPECT times that."""
    kind = rng.integers(len(KINDS), size=n)
    upper = LEAST * ASPECT ** rng.uniform(size=(n, 3))
    upper[kind == 0] = upper[kind == 0][:, :1]
    skewed = np.isin(kind, (2, 4))[:, None]
    lower = np.where(skewed, LEAST * ASPECT ** rng.uniform(size=(n, 3)), upper)
    exponent = np.where(kind > 2, rng.uniform(2.0, MOST_EXPONENT, n), 2.0)
    return Shapes(upper, lower, exponent, random_quaternions(rng, n), kind)


def gap(a: Shapes, b: Shapes, r: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Gaps (n) along unit vectors (n, 3) of pairs with centres r (n, 3) apart."""
    return (r * n).sum(axis=1) - a.support(n)[0] - b.support(-n)[0]


@dataclass
class Pairs:
    """Pairs with centres r apart, overlapping by `overlap` along `normal`."""

    a: Shapes
    b: Shapes
    r: np.ndarray
    normal: np.ndarray
    overlap: np.ndarray


def random_pairs(rng: np.random.Generator, count: int) -> Pairs:
    """Pairs whose centres lie outside each other and whose gap is greatest, nearby, along n.

    At corners sharper than the overlap the gap along n is no maximum: such pairs are left out.
    """
    a, b = random_shapes(rng, count), random_shapes(rng, count)
    n = rng.normal(size=(count, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    least = np.minimum(np.minimum(a.upper, a.lower), np.minimum(b.upper, b.lower)).min(axis=1)
    overlap = DEEPEST * least * rng.uniform(1e-3, 1.0, count)
    r = a.support(n)[1] - b.support(-n)[1] - overlap[:, None] * n
    good = ~a.holds(r) & ~b.holds(-r)
    across = np.cross(n, np.roll(n, 1, axis=1) + [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    beside = np.cross(n, across)
    for width in (1e-4, 1e-2):
        for angle in np.arange(8) * np.pi / 4.0:
            m = n + width * (np.cos(angle) * across + np.sin(angle) * beside)
            m /= np.linalg.norm(m, axis=1, keepdims=True)
            good &= gap(a, b, r, m) < -overlap
    rows = np.flatnonzero(good)
    return Pairs(a.take(rows), b.take(rows), r[rows], n[rows], overlap[rows])


def look(case: Case, pairs: Pairs) -> tuple[np.ndarray, np.ndarray]:
    """Overlaps (n), NaN where missed, and normals (n, 3) that talus-dem finds."""
    count = len(pairs.r)
    k = np.arange(count)
    x = np.zeros((2 * count, 3))
    x[::2] = PITCH * np.column_stack([k % 60, k // 60 % 60, k // 3600])
    x[1::2] = x[::2] + pairs.r

    def both(name: str) -> np.ndarray:
        first, second = getattr(pairs.a, name), getattr(pairs.b, name)
        return np.stack([first, second], 1).reshape(2 * count, *first.shape[1:])

    upper, lower = both("upper"), both("lower")
    packing = make_packing(x, 0.5 * (upper + lower), both("quat"))
    packing.skew, packing.exponent = (upper - lower) / (upper + lower), both("exponent")
    write_h5(case.folder / "pack.h5", packing)
    case.run("talus-dem", "deck.nml")
    contacts = field_steps(case.folder / "deck.h5")[0].contacts
    first = np.minimum(contacts["ids"][:, 0], contacts["ids"][:, 1])
    overlap, normal = np.full(count, np.nan), np.zeros((count, 3))
    overlap[(first - 1) // 2] = contacts["overlap"]
    normal[(first - 1) // 2] = contacts["normal"]
    return overlap, normal


def judge(case: Case, batches: int, size: int, seed: int) -> None:
    """Compare many pairs and draw what is left."""
    rng = np.random.default_rng(seed)
    missed, deeper, other, total = 0, 0, 0, 0
    drawn, worst, turned = [], 0.0, 0.0
    for _ in range(batches):
        pairs = random_pairs(rng, size)
        overlap, normal = look(case, pairs)
        scale = np.maximum(pairs.a.upper, pairs.b.upper).max(axis=1)
        error = (overlap - pairs.overlap) / scale
        same = np.abs(error) < 1e-9
        total += len(error)
        missed += int(np.isnan(error).sum())
        deeper += int((error >= 1e-9).sum())
        other += int((error <= -1e-9).sum())
        worst = max_of(worst, float(np.abs(error[same]).max()))
        own = np.where((pairs.normal * normal).sum(axis=1, keepdims=True) < 0.0, -normal, normal)
        turned = max_of(turned, float(np.abs(own - pairs.normal)[same].max()))
        if len(drawn) < 1:
            drawn.append((pairs, error, same))
    case.above("pairs looked at", total, 0.8 * batches * size)
    case.metric("pairs missed", missed, 0, 0)
    case.metric("pairs with a deeper overlap than the one made", deeper, 0, 0)
    case.below(
        "share of pairs that a third direction separates more easily", other / total, 0.02,
        "the gap has a higher maximum elsewhere, which Talus finds",
    )  # fmt: skip
    case.below("largest |overlap - exact| / greatest semi-axis", worst, 1e-12)
    case.below("largest difference of the normal", turned, 1e-6)
    draw(case, *drawn[0])


def draw(case: Case, pairs: Pairs, error: np.ndarray, same: np.ndarray) -> None:
    """Draw the errors of one batch by kind of the rounder and the squarer grain."""
    kind = np.maximum(pairs.a.kind, pairs.b.kind)
    least = np.minimum(np.minimum(pairs.a.upper, pairs.a.lower),
                       np.minimum(pairs.b.upper, pairs.b.lower)).min(axis=1)  # fmt: skip
    fig, ax = case.figure()
    for k, name in enumerate(KINDS):
        rows = same & (kind == k)
        value = np.maximum(np.abs(error[rows]), 1e-18)
        ax.loglog(pairs.overlap[rows] / least[rows], value, ".", ms=2, label=f"to {name}s")
    ax.set(
        xlabel="overlap / least semi-axis [-]", ylabel="|overlap - exact| / greatest semi-axis [-]"
    )
    ax.legend(markerscale=4, fontsize=8)
    case.save(fig)
