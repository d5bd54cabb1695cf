"""Growth of an exchange of liquid between elements and the grid of grains, in one dimension.

A rigid skeleton: elements step implicitly over an interval, the grid in many steps of it with the
pressure of the interface held. The largest eigenvalue of one interval is the growth.
"""

from itertools import product

import numpy as np

from talus.verification import Case

CELLS = 10  #: elements of unit size, mobility and compressibility; the outer end is drained
SOFT, FINE, RATIOS = (0.1, 1.0, 10.0), (0.25, 1.0), (1, 10, 100)
COURANT = (0.1, 1.0, 10.0, 100.0)  #: interval over the diffusion time of an element


def column(cells: int, h: float, soft: float) -> tuple[np.ndarray, np.ndarray]:
    """Flow matrix and lumped storage of cells of size h."""
    flow, storage = np.zeros((cells + 1, cells + 1)), np.zeros(cells + 1)
    for e in range(cells):
        flow[e : e + 2, e : e + 2] += np.array([[1.0, -1.0], [-1.0, 1.0]]) / h
        storage[e : e + 2] += 0.5 * soft * h
    return flow, storage


def growth(soft: float, fine: float, ratio: int, courant: float, robin: float,
           returned: bool) -> float:  # fmt: skip
    """Spectral radius of an interval.

    The grid is `soft` times as compressible as the elements, its bricks are `fine` elements, and it
    takes `ratio` steps in an interval of `courant` diffusion times. C.40 to C.42.
    """
    flow, storage = column(CELLS, 1.0, 1.0)
    bricks = round(CELLS / fine)
    own_flow, own_storage = column(bricks, fine, soft)
    span, step = courant, courant / ratio
    nodes = CELLS + 1
    size = nodes + bricks + 1
    state = np.eye(size)
    p, inner, kept = state[:nodes], state[nodes:-1].copy(), state[-1]
    held, came = p[-1], np.zeros(size)
    solve = np.linalg.inv(np.diag(own_storage[:bricks]) + step * own_flow[:bricks, :bricks])
    for _ in range(ratio):
        inner = solve @ (own_storage[:bricks, None] * inner
                         - step * np.outer(own_flow[:bricks, bricks], held))  # fmt: skip
        came -= step * (own_flow[bricks, :bricks] @ inner + own_flow[bricks, bricks] * held)
    storage[-1] += own_storage[bricks]
    ahead = robin * np.sqrt(max(soft, 1.0) / span) * span
    matrix, right = np.diag(storage) + span * flow, storage[:, None] * p
    matrix[-1, -1] += ahead
    right[-1] += came + ahead * held + (kept if returned else 0.0)
    matrix[0], right[0] = np.eye(nodes)[0], 0.0
    new = np.linalg.solve(matrix, right)
    whole = np.vstack([new, inner, ahead * (new[-1] - held)])
    return float(np.abs(np.linalg.eigvals(whole)).max())


def largest(robin: float, returned: bool) -> float:
    """Return the largest growth over all ratios."""
    return max(growth(*ratios, robin, returned)
               for ratios in product(SOFT, FINE, RATIOS, COURANT))  # fmt: skip


def judge_growth(case: Case) -> None:
    """Judge that the exchange grows without admittance, and does not with it."""
    case.above("growth of an interval without admittance", largest(0.0, False), 2.0)
    case.below("growth with it", largest(1.0, True), 1.0, "C.42")
    case.below("growth with half of it", largest(0.5, True), 1.0, "C.42")
    case.below("growth where what is withheld is kept", largest(1.0, False), 1.0)
