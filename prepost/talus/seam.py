"""Which grains of two packings stay where they meet: the min-cut mosaic.

Beside the plane of a seam both packings lie over each other in a band. Of all sets of grains that
may stay the one is taken with the least volume lost plus overlapped volume times a price; the price
is such that the grains that stay have the volume of the packs. Only grains of different packings
overlap here, so that the best set is a minimum cut of a bipartite network (Picard and Ratliff 1975;
Ford and Fulkerson 1956): source - grain of the first - grain of the second - sink. eq. D.98
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

MOST_DEPTH = 0.3  # pairs that are deeper exclude each other at any price
TRIALS = 30  # of the price
TURNS = 60  # of the golden section, in which the contact function is found to rounding
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
WHOLE = 2**40  # a weight of one, as a whole number: flows then end exactly


@dataclass
class Band:
    """Pairs of grains of two packings that overlap, and what the grains weigh."""

    first: np.ndarray  # (pairs), rows of the first packing
    second: np.ndarray  # (pairs), rows of the second
    depth: np.ndarray  # (pairs), see depths
    weight: tuple[np.ndarray, np.ndarray]  # of the grains of both [m3]
    fixed: tuple[np.ndarray, np.ndarray]  # grains of both that stay in any case


def rotations(quat: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3) from body to space of quaternions (n, 4)."""
    w, x, y, z = quat.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def squares(axes: np.ndarray, quat: np.ndarray) -> np.ndarray:
    """Matrices (n, 3, 3) of ellipsoids x A^-1 x = 1 with semi-axes (n, 3) [m2]."""
    turn = rotations(quat)
    return np.einsum("nij,nj,nkj->nik", turn, axes**2, turn)


def depths(apart: np.ndarray, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Part (m) by which both ellipsoids of a pair must shrink until they touch; below 0: apart.

    Centres are (m, 3) apart [m], matrices (m, 3, 3) those of `squares`. One less the root of the
    contact function of Perram and Wertheim (1985), max of l (1 - l) r ((1 - l) A + l B)^-1 r over
    l from 0 to 1, which is concave: found by golden section. Spheres: 1 - r / (a + b).
    """

    def value(share: np.ndarray) -> np.ndarray:
        mixed = (1.0 - share)[:, None, None] * one + share[:, None, None] * other
        solved = np.linalg.solve(mixed, apart[:, :, None])[:, :, 0]
        return share * (1.0 - share) * (apart * solved).sum(axis=1)

    low, high = np.zeros(len(apart)), np.ones(len(apart))
    for _ in range(TURNS):
        left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        rising = value(left) < value(right)
        low, high = np.where(rising, left, low), np.where(rising, high, right)
    return 1.0 - np.sqrt(value(0.5 * (low + high)))


class Network:
    """Edges with capacities (whole numbers) from node 0, the source, to node 1, the sink."""

    def __init__(self, nodes: int):
        """Begin without edges."""
        self.edges: list[list[int]] = [[] for _ in range(nodes)]  # of each node
        self.to: list[int] = []
        self.room: list[int] = []  # edge k ^ 1 is k the other way

    def add(self, start: int, end: int, room: int) -> None:
        """Add an edge."""
        for node, other, most in ((start, end, room), (end, start, 0)):
            self.edges[node].append(len(self.to))
            self.to.append(other)
            self.room.append(most)

    def levels(self) -> list[int]:
        """Return how many edges with room lead from the source to each node, -1: none do."""
        level = [-1] * len(self.edges)
        level[0], queue = 0, deque([0])
        while queue:
            node = queue.popleft()
            for k in self.edges[node]:
                if self.room[k] > 0 and level[self.to[k]] < 0:
                    level[self.to[k]] = level[node] + 1
                    queue.append(self.to[k])
        return level

    def cut(self) -> list[bool]:
        """Send the largest flow (Dinic 1970); return whether a node is on the source's side."""
        while True:
            level = self.levels()
            if level[1] < 0:
                return [at >= 0 for at in level]
            left = [list(edges) for edges in self.edges]  # that may lead on
            while self.push(level, left):
                pass

    def push(self, level: list[int], left: list[list[int]]) -> bool:
        """Fill one shortest way to the sink; False if there is none."""
        way: list[int] = []
        node = 0
        while node != 1:
            while left[node]:
                k = left[node][-1]
                if self.room[k] > 0 and level[self.to[k]] == level[node] + 1:
                    break
                left[node].pop()
            if left[node]:
                way.append(left[node][-1])
                node = self.to[way[-1]]
            elif way:
                node = self.to[way.pop() ^ 1]
                left[node].pop()
            else:
                return False
        least = min(self.room[k] for k in way)
        for k in way:
            self.room[k] -= least
            self.room[k ^ 1] += least
        return True


def overlaps(band: Band) -> np.ndarray:
    """Volumes (pairs) in both grains of a pair [m3], as of two spheres of their mean volume.

    Two caps of height x of the radius: x^2 (3 - x) / 2 of a sphere.
    """
    mean = 0.5 * (band.weight[0][band.first] + band.weight[1][band.second])
    x = np.clip(band.depth, 0.0, 1.0)
    return mean * x * x * (3.0 - x) / 2.0


def cut_at(band: Band, price: float) -> tuple[np.ndarray, np.ndarray]:
    """Which grains of both stay (masks): the least volume lost and, at a price, overlapped.

    A pair of two grains that stay in any case is left as it is.
    """
    chosen = ~(band.fixed[0][band.first] & band.fixed[1][band.second])
    first, second = band.first[chosen], band.second[chosen]
    scale = WHOLE / max(weight.max() for weight in band.weight)
    rooms = [np.rint(scale * weight).astype(np.int64) for weight in band.weight]
    endless = int(sum(room.sum() for room in rooms) + 1)
    count = len(rooms[0])
    network = Network(2 + count + len(rooms[1]))
    for i in np.unique(first).tolist():
        network.add(0, 2 + i, endless if band.fixed[0][i] else int(rooms[0][i]))
    for j in np.unique(second).tolist():
        network.add(2 + count + j, 1, endless if band.fixed[1][j] else int(rooms[1][j]))
    costs = np.where(band.depth > MOST_DEPTH, np.inf, scale * price * overlaps(band))[chosen]
    costs = np.rint(np.minimum(costs, float(endless))).astype(np.int64).tolist()
    for i, j, cost in zip(first.tolist(), second.tolist(), costs, strict=True):
        network.add(2 + i, 2 + count + j, cost)
    side = np.array(network.cut())[2:]
    stay = np.ones(count, bool), np.ones(len(rooms[1]), bool)
    stay[0][first] = side[:count][first]
    stay[1][second] = ~side[count:][second]
    return stay


def mosaic(band: Band, volume: float) -> tuple[np.ndarray, np.ndarray]:
    """Which grains of both packings stay (masks) at the price that keeps a volume best [m3].

    The volume of what stays falls with the price, by whole grains: the price is doubled until less
    is left than is wanted, then halved between.
    """

    def error(stay: tuple[np.ndarray, np.ndarray]) -> float:
        return sum(float(w[s].sum()) for w, s in zip(band.weight, stay, strict=True)) - volume

    low, high = 0.0, np.inf
    price, best = 1.0, cut_at(band, 0.0)
    for _ in range(TRIALS):
        stay = cut_at(band, price)
        if abs(error(stay)) < abs(error(best)):
            best = stay
        if error(stay) > 0.0:
            low = price
        else:
            high = price
        price = 2.0 * price if np.isinf(high) else 0.5 * (low + high)
    return best


def overlapped(band: Band, stay: tuple[np.ndarray, np.ndarray]) -> float:
    """Volume in two grains that stay [m3]."""
    both = stay[0][band.first] & stay[1][band.second]
    return float(overlaps(band)[both].sum())
