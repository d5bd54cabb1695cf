"""Growth of an exchange between saturated grains and a saturated solid, in one dimension.

Springs and masses with the grid of their liquid, and linear elements with displacement and
pressure, exchange as talus-couple does it with static solids and scheme = 'average'. An interval
is linear in the state; the modulus of its largest eigenvalue is the growth. Nothing is damped.
"""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from talus.verification import Case

D, PORES, DT = 1.0e-3, 0.476, 1.0e-6  #: of grains [m], [-], their step [s]
STIFF, STORAGE = 1.0e8, 0.476 / 2.2e9  #: oedometric modulus of the grains [Pa], n/K_f [1/Pa]
DENSITY = 2650.0 * (1.0 - PORES) + 1000.0 * PORES
TRIALS, LOCKED = 3, 10.0  #: of the solid, with springs so many times those of the answer before
BRICK, CELLS, LAYERS, HELD = 5, 4, 20, 4  #: layers a brick, elements, layers, steps an exchange


@dataclass(frozen=True)
class Ratios:
    """Materials and steps of both halves; `above`: grains over the solid, with the drain."""

    above: bool
    modulus: float  #: of the solid [Pa]
    storage: float  #: of the grains' liquid [1/Pa]
    mobility: tuple[float, float]  #: of grains and solid [m^2/(Pa s)]
    steps: int  #: of the grains in an interval
    element: float  #: [m]
    solid_storage: float = STORAGE


class Grains:
    """A chain of grains from the facets outwards, and its liquid."""

    def __init__(self, r: Ratios):
        """Make the operators of the grid."""
        x = D * np.arange(1, LAYERS + 1)
        bricks = LAYERS // BRICK
        h = D * (LAYERS + 0.5) / bricks
        self.divergence = np.zeros((bricks + 1, LAYERS))
        self.flow = np.zeros((bricks + 1, bricks + 1))
        self.storage = np.zeros(bricks + 1)
        for c in range(bricks):
            inside = np.flatnonzero(np.minimum((x / h).astype(int), bricks - 1) == c)
            local = (x[inside] - (c + 0.5) * h) / h
            fit = np.linalg.pinv(np.vstack([np.ones_like(local), local]).T)
            self.divergence[c, inside] -= fit[0]
            self.divergence[c + 1, inside] += fit[0]
            self.flow[c : c + 2, c : c + 2] += r.mobility[0] / h * np.array([[1, -1], [-1, 1]])
            self.storage[c : c + 2] += 0.5 * r.storage * h
        self.half = self.storage[0]
        self.storage[0] = 0.0  # the solid has it
        self.free = np.arange(bricks + 1) < bricks + (not r.above)
        self.floor = 0.0 if r.above else 2.0 * STIFF / D

    def accelerate(self, x: np.ndarray, side: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return forces of contacts on grains, and on the ghost at the side."""
        contact = STIFF / D * (np.vstack([side, x[:-1]]) - x)
        force = contact.copy()
        force[:-1] -= contact[1:]
        force[-1] -= self.floor * x[-1]
        return force, -contact[0]


class Solid:
    """Elements from the facets inwards, in a step of an interval; facets held by springs."""

    def __init__(self, r: Ratios, half: float, springs: float):
        """Make and invert the matrix of a step, with this storage of the half bricks."""
        n, h, span = CELLS + 1, r.element, DT * r.steps
        one, both = np.array([[1, -1], [-1, 1]]), np.array([[2, 1], [1, 2]])
        stiffness, self.coupling, content = (np.zeros((n, n)) for _ in range(3))
        for e in range(CELLS):
            i = slice(e, e + 2)
            stiffness[i, i] += r.modulus / h * one
            self.coupling[i, i] += 0.5 * np.array([[1, 1], [-1, -1]])
            content[i, i] += r.solid_storage * h / 6.0 * both + h / r.modulus / 12.0 * one
            content[i, i] += span * r.mobility[1] / h * one
        self.stored = content.copy()
        for e in range(CELLS):
            self.stored[e : e + 2, e : e + 2] -= span * r.mobility[1] / h * one
        for matrix in (content, self.stored):
            matrix[0, 0] += half
        stiffness[0, 0] += springs
        stiffness[-1, -1] += 0.0 if r.above else 1.0e3
        matrix = np.block([[stiffness, -self.coupling], [self.coupling.T, content]])
        open_ = np.ones(2 * n, bool)
        open_[[n - 1, 2 * n - 1]] = [not r.above, r.above]
        self.inverse = np.zeros_like(matrix)
        self.inverse[np.ix_(open_, open_)] = np.linalg.inv(matrix[np.ix_(open_, open_)])

    def answer(self) -> float:
        """Return the volume by pressure that the facets take."""
        return 1.0 / self.inverse[CELLS + 1, CELLS + 1]

    def step(self, u: np.ndarray, p: np.ndarray, force: np.ndarray, volume: np.ndarray,
             ahead: float = 0.0) -> np.ndarray:  # fmt: skip
        """Return displacements and pressures at the end of an interval."""
        right = np.vstack([0.0 * u, self.stored @ p + self.coupling.T @ u])
        right[0] += force
        right[CELLS + 1] += volume + ahead * p[0]
        return self.inverse @ right


def conductance(r: Ratios, half: float, share: float) -> tuple[float, float]:
    """Return conductance [m/Pa] and springs by area [Pa/m], as the coupling finds them. C.45."""
    found = half + np.sqrt(r.mobility[1] * (r.solid_storage + 1.0 / r.modulus) * DT * r.steps)
    for _ in range(TRIALS):
        found = Solid(r, half, 1.5 * STIFF / D + LOCKED / found).answer()
    return share * found, 1.5 * STIFF / D + 1.0 / (share * found)


def growth(r: Ratios, share: float) -> float:
    """Return the growth with a share of the solid's answer; 0: the pressure is held. C.41, C.44."""
    grains, span = Grains(r), DT * r.steps
    taken, springs, ahead = 0.0, 1.5 * STIFF / D, 0.0
    if share > 0.0:
        taken, springs = conductance(r, grains.half, share)
        grains.storage[0] = taken
    else:
        soft = max(r.storage + 1.0 / STIFF, r.solid_storage + 1.0 / r.modulus)
        ahead = 2.0 * span * (np.sqrt(max(r.mobility) * soft / span) + np.sqrt(soft / DENSITY))
        grains.free[0] = False
    solid = Solid(r, grains.half + ahead, springs)
    sizes = (LAYERS, LAYERS, len(grains.storage), CELLS + 1, CELLS + 1, 1, 1, 1)
    state = np.split(np.eye(sum(sizes)), np.cumsum(sizes)[:-1])
    return float(np.abs(np.linalg.eigvals(np.vstack(
        interval(grains, solid, state, (span, springs, taken, ahead))))).max())  # fmt: skip


def interval(grains: Grains, solid: Solid, state: list, how: tuple) -> list:
    """Return the state after an interval: x, v, omega, u, p, side, mean flow, withheld."""
    span, springs, taken, ahead = how
    x, v, omega, u, p, side, mean, kept = state
    pace, parts = (u[:1] - side) / span, round(span / DT) // HELD
    time, at, omega = HELD * DT, side.copy(), omega.copy()
    matrix = np.diag(grains.storage) + time * grains.flow
    matrix += time**2 / (DENSITY * D) * grains.divergence @ grains.divergence.T
    free = grains.free
    start, volume, pull, push = p[:1], 0.0, 0.0, 0.0
    for _ in range(parts):
        right = omega + time * (grains.divergence @ v)
        right[:1] += time * pace + taken * start - mean / parts
        found = np.zeros_like(omega)
        found[:1] = p[:1]
        found[free] = np.linalg.solve(
            matrix[np.ix_(free, free)], right[free] - matrix[np.ix_(free, ~free)] @ found[~free]
        )
        before = x
        for _ in range(HELD):
            force, ghost = grains.accelerate(x, at)
            pull = pull + ghost / (HELD * parts)
            v = v + DT / (DENSITY * D) * (force - grains.divergence.T @ found)
            x = x + DT * v
            at = at + DT * pace
        omega = omega + grains.divergence @ (x - before) - time * (grains.flow @ found)
        omega[:1] += time * pace
        omega[1:] *= free[1:, None]
        gone = taken * (found[:1] - start) + mean / parts if taken > 0.0 else omega[:1].copy()
        omega[:1] -= gone
        volume, push, start = volume + gone, push + found[:1] / parts, found[:1]
    force = pull - push + springs * u[:1]
    new = solid.step(u, p, force[0], (volume + kept)[0])
    withheld = ahead * (new[CELLS + 1 : CELLS + 2] - p[:1])
    mean = mean + 0.3 * (volume - mean) if taken > 0.0 else 0.0 * mean
    return [x, v, omega, new[: CELLS + 1], new[CELLS + 1 :], u[:1], mean, withheld]


def all_ratios(above: bool) -> list[Ratios]:
    """Return compressibilities of 0.01 to 100, 4 to 100 steps, elements a quarter or two bricks."""
    spread = product((1.0e6, 1.0e8, 1.0e10), (0.01, 1.0, 100.0), (0.01, 100.0), (1e-12, 1e-8),
                     (4, 20, 100), (1.25e-3, 1.0e-2))  # fmt: skip
    return [Ratios(above, m, s * STORAGE, (k * k0, k0), n, h) for m, s, k, k0, n, h in spread]


def judge_swing(case: Case) -> None:
    """Judge that the exchange with a conductance grows no more than that of dry halves."""
    for above, name in ((False, "below"), (True, "above")):
        ratios = all_ratios(above)
        dry = max(growth(replace(r, storage=1.0, solid_storage=1.0), 0.0) for r in ratios)
        most = max(growth(r, 0.8) for r in ratios)
        case.below(f"grains {name}: growth with a conductance / of dry halves", most / dry, 1.0)
        held = max(growth(r, 0.0) for r in ratios)
        case.above(f"grains {name}: growth with held pressures / of dry halves", held / dry, 1.02)
