"""Thick rings in plane strain: laws with a state in principal stresses, and their balance along the
radius with polynomials of high degree. A second program: nothing of it is Talus'.

Stresses and strains are rows (3, points) of r, theta, z, compression positive [Pa], [-].
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

Rows = np.ndarray
State = dict[str, np.ndarray]

FIRST = 1e-4  # of the radius, motion from which Newton's method starts


def mean(a: Rows) -> np.ndarray:
    """Return a third of the trace."""
    return a.sum(axis=0) / 3


def dev(a: Rows) -> Rows:
    """Return the deviator."""
    return a - mean(a)


def size(a: Rows) -> np.ndarray:
    """Return the root of a:a."""
    return np.sqrt((a * a).sum(axis=0))


def through(nodes: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the matrix (x, nodes) of the polynomial through the values at nodes."""
    off = x[:, None] - nodes
    out = np.empty_like(off)
    for k in range(len(nodes)):
        others = np.arange(len(nodes)) != k
        out[:, k] = np.prod(off[:, others] / (nodes[k] - nodes[others]), axis=1)
    return out


def newton(residual: Callable[[Rows], Rows], x: Rows) -> Rows:
    """Solve residual(x) = 0 at each point by Newton's method with complex steps."""
    for _ in range(60):
        r = residual(x)
        slopes = np.empty((len(x), len(x), x.shape[1]))
        for k in range(len(x)):
            moved = x.astype(complex)
            moved[k] += 1e-30j
            slopes[:, k] = residual(moved).imag / 1e-30
        step = np.linalg.solve(slopes.transpose(2, 0, 1), r.T[..., None])[..., 0].T
        x = x - step
        if np.all(abs(step) <= 1e-14 * (1e-9 + abs(x))):
            break
    return x


@dataclass
class Drucker:
    """Cone of Drucker and Prager through the compressive edges, hardening; backward Euler."""

    bulk: float
    shear: float
    cohesion: float
    friction: float  # [rad]
    dilation: float  # [rad]
    hardening: float

    def start(self, stress: Rows) -> State:
        """Return the state of a start inside the cone."""
        return {"z": np.zeros(stress.shape[1])}

    def step(self, stress: Rows, state: State, strain: Rows) -> tuple[Rows, State]:
        """Return stress and state after an increment that yields."""
        angles = np.array([self.friction, self.dilation])
        beta = 2 * np.sqrt(6) / (3 - np.sin(angles))
        (a, a_flow), (b, b_flow) = beta * np.cos(angles), beta * np.sin(angles)
        trial = stress + 3 * self.bulk * mean(strain) + 2 * self.shear * dev(strain)
        s, p = dev(trial), mean(trial)
        over = size(s) - b * p - a * (self.cohesion + self.hardening * state["z"])
        gamma = over / (2 * self.shear + self.bulk * b * b_flow + a * a_flow * self.hardening)
        s = s * (1 - 2 * self.shear * gamma / size(s))
        now = s + p + self.bulk * b_flow * gamma
        return now, {"z": state["z"] + a_flow * gamma, "flow": gamma}


@dataclass
class Clay:
    """Modified Cam-clay with p = p_n exp(e/kappa*), constant Poisson's ratio; backward Euler."""

    slope: float
    swelling: float  # kappa/v
    plastic: float  # (lambda - kappa)/v
    ratio: float  # G/K

    def start(self, stress: Rows) -> State:
        """Return the state of isotropic stress on the yield surface."""
        return {"pc": mean(stress)}

    def step(self, stress: Rows, state: State, strain: Rows) -> tuple[Rows, State]:
        """Return stress and state after an increment that yields."""
        p0, pc0, v = mean(stress), state["pc"], 3 * mean(strain)
        s0, e = dev(stress), dev(strain)

        def at(x: Rows) -> tuple[np.ndarray, ...]:
            grown = (v - x[0]) / self.swelling
            p, pc = p0 * np.exp(grown), pc0 * np.exp(x[0] / self.plastic)
            # mean of the shear modulus over the elastic path
            shear = self.ratio * p0 / self.swelling * (np.exp(grown) - 1) / (grown + 1e-300)
            s = (s0 + 2 * shear * e) / (1 + 6 * shear * x[1] / pc0 / self.slope**2)
            return p, pc, s

        def residual(x: Rows) -> Rows:
            p, pc, s = at(x)
            f = 1.5 * (s * s).sum(axis=0) / self.slope**2 + p * (p - pc)
            return np.array([x[0] - x[1] / pc0 * (2 * p - pc), f / pc0**2])

        x = newton(residual, np.array([0.5 * v, 0.5 * size(e) + abs(v)]))
        p, pc, s = at(x)
        return p + s, {"pc": pc, "flow": x[1]}


@dataclass
class Crushing:
    """Einav's breakage with linear elasticity; backward Euler, B exact in the multiplier."""

    bulk: float
    shear: float
    slope: float
    energy: float
    omega: float  # [rad]
    theta: float
    initial: float  # B

    def start(self, stress: Rows) -> State:
        """Return the state of a start."""
        return {"B": np.full(stress.shape[1], self.initial)}

    def step(self, stress: Rows, state: State, strain: Rows) -> tuple[Rows, State]:
        """Return stress and state after an increment that yields."""
        left = 1 - self.theta * state["B"]
        v = mean(stress) / (left * self.bulk) + 3 * mean(strain)
        e = dev(stress) / (2 * left * self.shear) + dev(strain)
        w = np.sqrt(2 / 3) * size(e)
        cos2, sin2 = np.cos(self.omega) ** 2, np.sin(self.omega) ** 2

        def at(x: Rows) -> tuple[np.ndarray, ...]:
            b = 1 - 1 / (1 / (1 - state["B"]) + 2 * cos2 * x[2])
            left = 1 - self.theta * b
            return b, left * self.bulk * x[0], 3 * left * self.shear * x[1]

        def residual(x: Rows) -> Rows:
            b, p, q = at(x)
            psi = self.theta * (self.bulk * x[0] ** 2 / 2 + 1.5 * self.shear * x[1] ** 2)
            cut = (1 - b) ** 2 * psi / self.energy
            r1 = x[0] - v + 2 * x[2] * cut * sin2 * self.energy / p
            r2 = x[1] - w + 2 * x[2] * self.energy * q / (self.slope * p) ** 2
            return np.array([r1, r2, np.sqrt(cut + (q / (self.slope * p)) ** 2) - 1])

        x = newton(residual, np.array([0.9 * v, 0.9 * w, 1e-3 * np.ones_like(v)]))
        b, p, q = at(x)
        return p + np.sqrt(2 / 3) * q * e / size(e), {"B": b, "flow": x[2]}


@dataclass
class Sand:
    """Dafalias and Manzari's sand of 2004 by rates (Runge and Kutta's); from isotropic stress."""

    constants: dict[str, float]
    void_ratio: float
    residual: float = 0.0  # p_r [Pa]
    parts: int = 100
    names: tuple[str, ...] = field(default=("s", "alpha", "fabric", "e"))

    def start(self, stress: Rows) -> State:
        """Return the state of isotropic stress."""
        none = np.zeros_like(stress)
        return {"alpha": none, "fabric": none, "e": np.full(stress.shape[1], self.void_ratio)}

    def moduli(self, p: np.ndarray, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return bulk and shear modulus [Pa]."""
        c = self.constants
        shear = c["G0"] * c["pat"] * (2.97 - e) ** 2 / (1 + e) * np.sqrt(p / c["pat"])
        return 2 * (1 + c["nu"]) / (3 * (1 - 2 * c["nu"])) * shear, shear

    def rates(self, y: Rows, rate: Rows, on: bool) -> Rows:
        """Return the rates of stress, alpha, fabric (3 rows each) and e; on the surface or not."""
        c = self.constants
        stress, alpha, fabric, e = y[:3], y[3:6], y[6:9], y[9]
        p, v = mean(stress), 3 * mean(rate)
        bulk, shear = self.moduli(p, e)
        r = dev(stress) / p
        away = r - alpha
        n = away / (size(away) + 1e-300)
        loads = 2 * shear * (n * rate).sum(axis=0) - bulk * (n * r).sum(axis=0) * v
        loads = np.maximum(loads, 0) * on
        cosine = np.sqrt(6) * (n**3).sum(axis=0)
        g = 2 * c["c"] / (1 + c["c"] - (1 - c["c"]) * cosine)
        psi = e - c["e0"] + c["line"] * (p / c["pat"]) ** c["xi"]
        bound = np.sqrt(2 / 3) * (g * c["M"] * np.exp(-c["nb"] * psi) - c["m"]) * n
        turn = np.sqrt(2 / 3) * (g * c["M"] * np.exp(c["nd"] * psi) - c["m"]) * n
        skew = (1 - c["c"]) / c["c"] * g
        b, third = 1 + 1.5 * skew * cosine, 3 * np.sqrt(1.5) * skew
        fall = np.maximum(0, (fabric * n).sum(axis=0))
        dilation = c["A0"] * (1 + fall) * ((turn - alpha) * n).sum(axis=0)
        b0 = c["G0"] * c["h0"] * (1 - c["ch"] * e) / np.sqrt(p / c["pat"])
        x = np.maximum(0, (alpha * n).sum(axis=0)) / b0  # 1/h: loading began at alpha = 0
        hard = 2 / 3 * p * ((bound - alpha) * n).sum(axis=0)
        hard = hard + x * (2 * shear * (b - third * cosine / np.sqrt(6))
                           - bulk * dilation * (n * r).sum(axis=0))  # fmt: skip
        lh = loads / hard if on else 0 * loads
        flow = lh * x
        direction = b * n - third * (n * n - 1 / 3)
        s = 2 * shear * (dev(rate) - flow * direction) + bulk * (v - flow * dilation)
        z = -c["cz"] * np.maximum(0, -flow * dilation) * (c["zmax"] * n + fabric)
        return np.vstack([s, 2 / 3 * lh * (bound - alpha), z, [-(1 + e) * v]])

    def step(self, stress: Rows, state: State, strain: Rows) -> tuple[Rows, State]:
        """Return stress and state after an increment: elastic to the surface, then rates."""
        y = np.vstack([stress + self.residual, state["alpha"], state["fabric"], [state["e"]]])
        reach = self.elastic_share(y, strain)
        for share, parts, on in ((reach, 4, False), (1 - reach, self.parts, True)):
            rate = strain * share / parts
            for _ in range(parts):
                k1 = self.rates(y, rate, on)
                k2 = self.rates(y + k1 / 2, rate, on)
                k3 = self.rates(y + k2 / 2, rate, on)
                y = y + (k1 + 2 * k2 + 2 * k3 + self.rates(y + k3, rate, on)) / 6
        away = dev(y[:3]) / mean(y[:3])
        n = (away - y[3:6]) / size(away - y[3:6])
        y[3:6] = away - np.sqrt(2 / 3) * self.constants["m"] * n
        out = {"alpha": y[3:6], "fabric": y[6:9], "e": y[9]}
        return y[:3] - self.residual, out | {"flow": (y[3:6] * n).sum(axis=0)}

    def elastic_share(self, y: Rows, strain: Rows) -> np.ndarray:
        """Return the share of an increment up to the yield surface, by halving."""
        low, high = np.zeros(y.shape[1]), np.ones(y.shape[1])
        bulk, shear = self.moduli(mean(y[:3]), y[9])
        at_once = size(dev(y[:3]) / mean(y[:3]) - y[3:6])
        for _ in range(50):
            t = (low + high) / 2
            root = np.sqrt(mean(y[:3])) + 0.5 * t * bulk / np.sqrt(mean(y[:3])) * 3 * mean(strain)
            s = dev(y[:3]) + t * 2 * shear * dev(strain) * (1 + root / np.sqrt(mean(y[:3]))) / 2
            inside = size(s / root**2 - y[3:6]) < np.sqrt(2 / 3) * self.constants["m"]
            low, high = np.where(inside, t, low), np.where(inside, high, t)
        begun = at_once > np.sqrt(2 / 3) * self.constants["m"] * (1 - 1e-6)
        return np.where(begun, 0.0, low)


@dataclass
class Ring:
    """A ring from radius a to b [m] by elements of high degree along the radius."""

    a: float
    b: float
    elements: int = 3
    degree: int = 8

    def __post_init__(self) -> None:
        """Lay out nodes, Gauss points and the matrices from u to its strains."""
        d, count = self.degree, self.elements
        nodes = -np.cos(np.pi * np.arange(d + 1) / d)
        points, weights = np.polynomial.legendre.leggauss(d + 2)
        fit = np.linalg.inv(np.vander(nodes, increasing=True))
        value = np.vander(points, d + 1, increasing=True) @ fit
        powers = np.vander(points, d + 1, increasing=True)[:, :-1] * np.arange(1, d + 1)
        slope = powers @ fit[1:]
        h = (self.b - self.a) / count
        self.r = np.empty(count * d + 1)
        self.at = np.concatenate([self.a + h * (k + (points + 1) / 2) for k in range(count)])
        self.w = np.tile(weights, count) * h / 2 * self.at
        self.slope = np.zeros((len(self.at), len(self.r)))
        self.value = np.zeros_like(self.slope)
        for k in range(count):
            row, column = k * (d + 2), k * d
            self.r[column : column + d + 1] = self.a + h * (k + (nodes + 1) / 2)
            self.value[row : row + d + 2, column : column + d + 1] = value
            self.slope[row : row + d + 2, column : column + d + 1] = slope * 2 / h

    def strains(self, u: np.ndarray) -> Rows:
        """Return the strains at the points, compression positive."""
        return -np.array([self.slope @ u, self.value @ u / self.at, 0 * self.at])

    def solve(self, law: object, pressure: float, loads: list[tuple]) -> tuple[np.ndarray, Rows]:
        """Follow pressures inside and outside [Pa] from an isotropic one.

        Returns u at the nodes [m] and the stress at the points [Pa].
        Raises where a point does not yield in an increment, or where Newton's method fails.
        """
        stress = np.full((3, len(self.at)), pressure)
        state, u = law.start(stress), np.zeros_like(self.r)
        change = FIRST * self.a / self.r
        for inner, outer in loads:
            for _ in range(40):
                now, matrix = self.tangent(law, stress, state, self.strains(change))
                force = self.slope.T @ (self.w * now[0]) + self.value.T @ (
                    self.w * now[1] / self.at
                )
                force[0] += inner * self.a
                force[-1] -= outer * self.b
                step = np.linalg.solve(matrix, force)
                change = change + step
                if np.max(abs(step)) < 1e-9 * np.max(abs(change)):
                    break
            else:
                raise RuntimeError("radial balance: no convergence")
            stress, state = law.step(stress, state, self.strains(change))
            if not np.all(state["flow"] > 0):
                raise RuntimeError("radial balance: a point does not yield")
            u = u + change
        return u, stress

    def tangent(self, law: object, stress: Rows, state: State, strain: Rows) -> tuple:
        """Return the stress after a strain, and the slope of the forces by u, by differences."""
        now = law.step(stress, state, strain)[0]
        by = (self.slope, self.value / self.at[:, None])
        matrix, tip = 0.0, np.max(abs(strain)) * 1e-6
        for k in (0, 1):
            moved = strain.copy()
            moved[k] += tip
            slopes = (law.step(stress, state, moved)[0] - now) / tip
            for i in (0, 1):
                matrix = matrix + by[i].T @ ((self.w * slopes[i])[:, None] * by[k])
        return now, matrix

    def at_nodes(self, values: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Return values of the nodes at radii, by the polynomial of each element."""
        d, out = self.degree, np.empty_like(r)
        for k, mine in self.places(r):
            own = self.r[k * d : (k + 1) * d + 1]
            out[mine] = through(own, r[mine]) @ values[k * d : (k + 1) * d + 1]
        return out

    def places(self, r: np.ndarray) -> list[tuple[int, np.ndarray]]:
        """Return each element with those of the radii that lie in it."""
        share = (r - self.a) / (self.b - self.a) * self.elements
        place = np.clip(share.astype(int), 0, self.elements - 1)
        return [(k, place == k) for k in range(self.elements)]

    def interpolate(self, values: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Return values at the Gauss points (any rows) at radii: one polynomial an element."""
        count, out = self.degree + 2, np.empty(values.shape[:-1] + r.shape)
        for k, mine in self.places(r):
            own = slice(k * count, (k + 1) * count)
            out[..., mine] = values[..., own] @ through(self.at[own], r[mine]).T
        return out
