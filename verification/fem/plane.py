"""Micropolar plane strain with bilinear quadrangles and any quadrature: a second program."""

import numpy as np


def strains(slope: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Return the matrix to gamma 11 12 21 22 and the curvatures from u, v, phi of four nodes."""
    b = np.zeros((6, 12))
    b[0, 0::3], b[3, 1::3] = slope[0], slope[1]
    b[1, 1::3], b[1, 2::3] = slope[0], -value
    b[2, 0::3], b[2, 2::3] = slope[1], value
    b[4, 2::3], b[5, 2::3] = slope[0], slope[1]
    return b


def stiffness(x: np.ndarray, law: np.ndarray, points: int) -> np.ndarray:
    """Return the stiffness of a quadrangle x (4, 2) with points^2 Gauss points."""
    place, weight = np.polynomial.legendre.leggauss(points)
    sx, sy = np.array([-1, 1, 1, -1]), np.array([-1, -1, 1, 1])
    k = np.zeros((12, 12))
    for a, wa in zip(place, weight, strict=True):
        for c, wc in zip(place, weight, strict=True):
            value = (1 + a * sx) * (1 + c * sy) / 4
            slope = np.array([sx * (1 + c * sy), sy * (1 + a * sx)]) / 4
            tangent = slope @ x
            b = strains(np.linalg.solve(tangent, slope), value)
            k += wa * wc * np.linalg.det(tangent) * b.T @ law @ b
    return k


def plane_compliance(n: int, points: int, moduli: tuple[float, ...]) -> float:
    """Compliance of the membrane on n x n quadrangles; moduli lambda, mu, kappa, gamma."""
    lam, mu, kappa, gamma = moduli
    law = np.zeros((6, 6))
    law[0, 0] = law[3, 3] = lam + 2 * mu + kappa
    law[0, 3] = law[3, 0] = lam
    law[1, 1] = law[2, 2] = mu + kappa
    law[1, 2] = law[2, 1] = mu
    law[4, 4] = law[5, 5] = gamma
    s = np.linspace(0.0, 1.0, n + 1)
    i, j = (a.ravel() for a in np.meshgrid(s, s))
    x = np.column_stack([48 * i, 44 * i + (44 - 28 * i) * j])
    k, force = np.zeros((3 * len(x),) * 2), np.zeros(3 * len(x))
    for row in range(n):
        for column in range(n):
            first = row * (n + 1) + column
            nodes = np.array([first, first + 1, first + n + 2, first + n + 1])
            dofs = (3 * nodes[:, None] + np.arange(3)).ravel()
            k[np.ix_(dofs, dofs)] += stiffness(x[nodes], law, points)
    share = np.full(n + 1, 1 / n)
    share[[0, -1]] /= 2
    force[3 * np.flatnonzero(i == 1.0) + 1] = share
    free = np.repeat(i > 0.0, 3)
    u = np.linalg.solve(k[np.ix_(free, free)], force[free])
    return float(u @ force[free])
