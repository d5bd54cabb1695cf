"""Periodic cells in which linear grains and elements overlap: lattices, random packs, moduli.

Nothing here is Talus' own: shape functions, contact springs, pull-backs and the coupled moduli are
written anew, so that what `talus-couple FILE.h5 --weights` gives is judged from outside.
"""

from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

from talus.compare import max_of

FREE, GHOST = 1, 2
HAT, TILDE, BAR = 1, 2, 3
GAUSS = 1.0 / np.sqrt(3.0)
CORNER = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0],
                   [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])  # fmt: skip
AXIAL = np.zeros((3, 3, 3))
for one, two, three in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    AXIAL[one, two, three], AXIAL[one, three, two] = 1.0, -1.0


def strain_states() -> np.ndarray:
    """Return the six uniform strains xx yy zz xy yz zx, (6, 3, 3)."""
    e = np.zeros((6, 3, 3))
    for s, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))):
        e[s, i, j] += 0.5
        e[s, j, i] += 0.5
    return e


@dataclass
class Pack:
    """Grains in a periodic box: centres, radii, contacts with branch and arms [m]."""

    length: np.ndarray
    x: np.ndarray
    radius: np.ndarray
    pair: np.ndarray
    branch: np.ndarray
    kn: float = 1.0
    ks: float = 0.5

    @property
    def normal(self) -> np.ndarray:
        """Unit vectors from the first grain to the second."""
        return self.branch / np.linalg.norm(self.branch, axis=1)[:, None]

    @property
    def arms(self) -> np.ndarray:
        """Vectors from both centres to the contact point, (n, 2, 3)."""
        length = np.linalg.norm(self.branch, axis=1)
        r = self.radius[self.pair]
        first = (r[:, 0] - 0.5 * (r.sum(1) - length))[:, None] * self.normal
        return np.stack([first, first - self.branch], 1)

    def moduli(self) -> np.ndarray:
        """Return the affine sum C_ijkl = 1/V sum l_i l_k K_jl as 9 x 9 [Pa]."""
        n = self.normal
        k = self.ks * np.eye(3) + (self.kn - self.ks) * np.einsum("ci,cj->cij", n, n)
        c = np.einsum("ci,ck,cjl->ijkl", self.branch, self.branch, k) / np.prod(self.length)
        return c.reshape(9, 9)


def find_contacts(
    x: np.ndarray, radius: np.ndarray, length: np.ndarray, reach: float = 1e-9
) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs and branches of grains whose gap is below reach (times the diameter)."""
    cells = np.maximum(3, np.floor(length / (2.0 * radius.max() * (1.0 + reach))).astype(int))
    home = np.floor(x / length * cells).astype(int) % cells
    key = np.ravel_multi_index(home.T, cells)
    order = np.argsort(key, kind="stable")
    start = np.searchsorted(key[order], np.arange(np.prod(cells) + 1))
    pairs = []
    for shift in np.stack(np.meshgrid(*3 * [np.arange(-1, 2)], indexing="ij"), -1).reshape(-1, 3):
        other = np.ravel_multi_index(((home + shift) % cells).T, cells)
        count = start[other + 1] - start[other]
        first = np.repeat(np.arange(len(x)), count)
        offset = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        second = order[np.repeat(start[other], count) + offset]
        pairs.append(np.stack([first, second], 1)[first < second])
    pair = np.concatenate(pairs)
    branch = x[pair[:, 1]] - x[pair[:, 0]]
    branch -= length * np.round(branch / length)
    near = np.linalg.norm(branch, axis=1) <= radius[pair].sum(1) * (1.0 + reach)
    pair, branch = pair[near], branch[near]
    order = np.lexsort(pair.T)
    return pair[order], branch[order]


def lattice(
    kind: str, elements: tuple[int, ...], shift: np.ndarray, many: int = 0
) -> tuple[Pack, float]:
    """Return grains of diameter 1 in simple cubic or fcc order, and the elements' size.

    An element is `many` cells wide: if 0, three of the cubic lattice (3 d), two of fcc (2.83 d).
    """
    edge, usual = (1.0, 3) if kind == "cubic" else (np.sqrt(2.0), 2)
    many = many or usual
    base = np.zeros((1, 3))
    if kind == "fcc":
        base = np.array([[0, 0, 0], [0, 1, 1], [1, 0, 1], [1, 1, 0]]) * 0.5
    cells = [many * n for n in elements]
    at = np.stack(np.meshgrid(*map(np.arange, cells), indexing="ij"), -1).reshape(-1, 3)
    length = np.array(cells) * edge
    x = ((base[None] + at[:, None]).reshape(-1, 3) * edge + shift) % length
    radius = np.full(len(x), 0.5)
    return Pack(length, x, radius, *find_contacts(x, radius, length)), many * edge


@dataclass
class Overlap:
    """A pack whose grains in HAT elements are free, in TILDE ghosts, elsewhere taken away."""

    pack: Pack
    h: np.ndarray
    region: np.ndarray  # (nx, ny, nz)
    polar: bool
    moduli: np.ndarray
    depth: float = 0.0
    keep: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        """Sort grains and nodes, evaluate shape functions, make the projection."""
        self.shape = np.array(self.region.shape)
        nodes = np.arange(np.prod(self.shape)).reshape(self.shape)
        index = np.stack(np.meshgrid(*map(np.arange, self.shape), indexing="ij"), -1).reshape(-1, 3)
        around = (index[:, None] + CORNER) % self.shape
        self.node = nodes[tuple(np.moveaxis(around, -1, 0))]
        self.origin = index * self.h
        self.of_element = self.region.ravel()
        self.nodes = nodes.size
        place = np.floor(self.pack.x / self.h).astype(int) % self.shape
        cell = np.ravel_multi_index(place.T, self.shape)
        self.keep = np.flatnonzero(self.of_element[cell] != BAR)
        new = np.full(len(cell), -1)
        new[self.keep] = np.arange(len(self.keep))
        self.x, self.cell = self.pack.x[self.keep], cell[self.keep]
        self.kind = np.where(self.of_element[self.cell] == HAT, FREE, GHOST)
        inside = (new[self.pack.pair] >= 0).all(1)
        self.pair = new[self.pack.pair[inside]]
        self.branch, self.normal = self.pack.branch[inside], self.pack.normal[inside]
        self.arms = self.pack.arms[inside]
        xi = (self.x - self.origin[self.cell]) / self.h
        factor = np.where(CORNER[None] == 1, xi[:, None], 1.0 - xi[:, None])
        self.value = factor.prod(2)
        self.slope = self.slopes(factor)
        gauss = 0.5 + 0.5 * GAUSS * (2 * CORNER - 1)
        factor = np.where(CORNER[None] == 1, gauss[:, None], 1.0 - gauss[:, None])
        self.g_value, self.g_slope = factor.prod(2), self.slopes(factor)
        self.volume = np.prod(self.h) / 8.0
        self.element = np.repeat(np.arange(len(self.node)), 8)
        self.point = self.origin[self.element] + np.tile(gauss, (len(self.node), 1)) * self.h
        self.hat = np.zeros(self.nodes, bool)
        self.hat[self.node[self.of_element == HAT]] = True
        self.free = np.flatnonzero(self.kind == FREE)
        n = np.zeros((len(self.free), self.nodes))
        np.add.at(n, (np.arange(len(self.free))[:, None], self.node[self.cell[self.free]]),
                  self.value[self.free])  # fmt: skip
        n = n[:, self.hat]
        self.project = np.linalg.solve(n.T @ n, n.T) if len(self.free) else np.zeros((0, 0))
        self.d_max = 2.0 * self.pack.radius.max()
        if not self.depth:
            self.depth = self.ghost_layer()
        self.weights(np.ones(len(self.pair)), np.zeros(len(self.element)))

    def slopes(self, factor: np.ndarray) -> np.ndarray:
        """Derivatives of the shape functions, (n, 8, 3) [1/m]."""
        sign = (2 * CORNER - 1) / self.h
        out = np.empty_like(factor)
        for i in range(3):
            out[..., i] = sign[:, i] * np.delete(factor, i, 2).prod(2)
        return out

    def distance(self, x: np.ndarray) -> np.ndarray:
        """Distance from the elements of free grains [m], over all periodic images."""
        low = self.origin[self.of_element == HAT]
        best = np.full(len(x), np.inf)
        for corner in low:
            gap = x - (corner + 0.5 * self.h)
            gap -= self.pack.length * np.round(gap / self.pack.length)
            gap = np.maximum(np.abs(gap) - 0.5 * self.h, 0.0)
            best = np.minimum(best, np.linalg.norm(gap, axis=1))
        return best

    def ghost_layer(self) -> float:
        """Least distance from the free region to an element without grains [m]."""
        ends = np.unique(self.node[self.of_element == BAR])
        grid = np.stack(np.unravel_index(ends, self.shape), -1) * self.h
        return float(self.distance(grid).min()) if len(ends) else 0.0

    def weights(self, w: np.ndarray, beta: np.ndarray) -> None:
        """Take weights of contacts and points."""
        self.w, self.beta = w, beta

    # --- forces -----------------------------------------------------------------------------
    def spring(self, jump: np.ndarray) -> np.ndarray:
        """Force on the first grain [N]."""
        along = (jump * self.normal).sum(1)[:, None] * self.normal
        return self.pack.ks * jump + (self.pack.kn - self.pack.ks) * along

    def follow(self, q: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return motion (u, turn) of all grains and nodes for free grains q and free nodes d."""
        nodes = d.copy()
        nodes[self.hat] = self.project @ q
        if not self.polar:
            nodes[:, 3:] = 0.0
        grains = np.zeros((len(self.kind), 6))
        grains[self.free] = q
        g = np.flatnonzero(self.kind == GHOST)
        around = nodes[self.node[self.cell[g]]]
        grains[g] = np.einsum("ga,gai->gi", self.value[g], around)
        if not self.polar:
            turn = np.einsum("gaj,gak->gjk", self.slope[g], around[..., :3])
            grains[g, 3:] = 0.5 * np.einsum("ijk,gjk->gi", AXIAL, turn)
        return grains, nodes

    def inner(self, grains: np.ndarray, nodes: np.ndarray, strain: np.ndarray,
              turn: np.ndarray | None = None) -> tuple[np.ndarray, ...]:  # fmt: skip
        """Return inner loads on grains and nodes, contact forces, stress of points."""
        one, two = self.pair.T
        spin = grains[:, 3:] if turn is None else grains[:, 3:] + turn
        jump = grains[two, :3] - grains[one, :3] + self.branch @ strain.T
        jump += np.cross(spin[two], self.arms[:, 1]) - np.cross(spin[one], self.arms[:, 0])
        force = self.spring(jump)
        load = np.zeros_like(grains)
        f = self.w[:, None] * force
        np.add.at(load, one, np.hstack([-f, -np.cross(self.arms[:, 0], f)]))
        np.add.at(load, two, np.hstack([f, np.cross(self.arms[:, 1], f)]))
        around = nodes[self.node]
        gamma = np.einsum("qak,eal->eqkl", self.g_slope, around[..., :3]) + strain.T
        if self.polar:
            phi = np.einsum("qa,eam->eqm", self.g_value, around[..., 3:])
            if turn is not None:
                phi = phi + turn
            gamma = gamma + np.einsum("lkm,eqm->eqkl", AXIAL, phi)
        else:
            gamma = 0.5 * (gamma + gamma.swapaxes(2, 3))
        sigma = (gamma.reshape(-1, 9) @ self.moduli.T).reshape(gamma.shape)
        t = (self.beta * self.volume).reshape(-1, 8)[..., None, None] * sigma
        out = np.zeros((len(self.node), 8, 6))
        out[..., :3] = np.einsum("eqkl,qak->eal", t, self.g_slope)
        if self.polar:
            out[..., 3:] = np.einsum("lkm,eqkl,qa->eam", AXIAL, t, self.g_value)
        at_nodes = np.zeros_like(nodes)
        np.add.at(at_nodes, self.node, out)
        return load, at_nodes, force, sigma

    def pull_back(self, load: np.ndarray, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return loads on free grains and free nodes: transposes of follow."""
        nodes = nodes.copy()
        g = np.flatnonzero(self.kind == GHOST)
        part = self.value[g][..., None] * load[g][:, None]
        if not self.polar:
            part[..., :3] += 0.5 * np.cross(load[g, None, 3:], self.slope[g])
            part[..., 3:] = 0.0
        np.add.at(nodes, self.node[self.cell[g]], part)
        q = load[self.free] + self.project.T @ nodes[self.hat]
        nodes[self.hat] = 0.0
        if not self.polar:
            nodes[:, 3:] = 0.0
        return q, nodes

    # --- what is measured -------------------------------------------------------------------
    def residual(self) -> dict[str, float]:
        """Largest force F and moment M on free grains and row D of nodes, over the mean force."""
        worst = {"F": 0.0, "M": 0.0, "D": 0.0}
        for strain in strain_states():
            grains = np.zeros((len(self.kind), 6))
            load, nodes, force, _ = self.inner(grains, np.zeros((self.nodes, 6)), strain)
            mean = np.linalg.norm(force, axis=1).mean()
            q, d = self.pull_back(load, nodes)
            moment = mean * self.d_max
            worst["F"] = max_of(worst["F"], np.linalg.norm(q[:, :3], axis=1).max() / mean)
            worst["M"] = max_of(worst["M"], np.linalg.norm(q[:, 3:], axis=1).max() / moment)
            worst["D"] = max_of(worst["D"], np.linalg.norm(d[:, :3], axis=1).max() / mean)
        return worst

    def stress(self, force: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        """Return 1/V (sum w l f + sum beta V sigma), (3, 3) [Pa]."""
        total = np.einsum("c,ci,cj->ij", self.w, self.branch, force)
        total += np.einsum("q,qij->ij", self.beta * self.volume, sigma.reshape(-1, 3, 3))
        return total / np.prod(self.pack.length)

    def relax(
        self, strain: np.ndarray, tolerance: float = 1e-13, most: int = 6000
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Solve for the periodic rest of the motion; return stress, motion of grains, of nodes."""
        zero_q, zero_d = np.zeros((len(self.free), 6)), np.zeros((self.nodes, 6))
        still = np.zeros((3, 3))

        def apply(q: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return self.pull_back(*self.inner(*self.follow(q, d), still)[:2])

        rq, rd = self.pull_back(*self.inner(*self.follow(zero_q, zero_d), strain)[:2])
        rq, rd = -rq, -rd
        scale_q, scale_d = self.diagonal()
        zq, zd = rq / scale_q, rd / scale_d
        pq, pd, q, d = zq.copy(), zd.copy(), zero_q.copy(), zero_d.copy()
        rz = (rq * zq).sum() + (rd * zd).sum()
        wanted = tolerance**2 * max(rz, 1e-300)
        floor = 1e-28 * self.pack.kn
        for _ in range(most):
            if rz <= max(wanted, floor):
                break
            aq, ad = apply(pq, pd)
            alpha = rz / ((pq * aq).sum() + (pd * ad).sum())
            q, d = q + alpha * pq, d + alpha * pd
            rq, rd = rq - alpha * aq, rd - alpha * ad
            zq, zd = rq / scale_q, rd / scale_d
            old, rz = rz, (rq * zq).sum() + (rd * zd).sum()
            pq, pd = zq + rz / old * pq, zd + rz / old * pd
        grains, nodes = self.follow(q, d)
        _, _, force, sigma = self.inner(grains, nodes, strain)
        return self.stress(force, sigma), grains, nodes

    def diagonal(self) -> tuple[np.ndarray, np.ndarray]:
        """Positive scales of the unknowns."""
        count = np.bincount(self.pair.ravel(), minlength=len(self.kind))[self.free]
        q = np.ones((len(self.free), 6)) * np.maximum(count, 1)[:, None] * self.pack.kn / 3.0
        q[:, 3:] *= 0.25 * self.d_max**2
        d = np.full((self.nodes, 6), 2.0 * self.moduli[0, 0] * self.h.max())
        d[:, 3:] *= 0.1 * self.h.max() ** 2
        return q, d

    def all_moduli(self) -> np.ndarray:
        """Return the 36 moduli of the cell: stress components xx yy zz xy yz zx by states [Pa]."""
        return np.array([six(self.relax(strain)[0]) for strain in strain_states()]).T

    # --- Talus ------------------------------------------------------------------------------
    def write(self, path: Path, method: str, rho: float = 1.0, **more: object) -> None:
        """Write the overlap for `talus-couple FILE.h5 --weights`."""
        empty = np.zeros((len(self.kind), 0))
        polar = self.polar
        slope = np.tile(self.g_slope, (len(self.node), 1, 1))
        none = (len(self.element), 0)
        with h5py.File(path, "w") as file:
            attrs = {"format": "talus-overlap", "version": 1, "nodes": self.nodes,
                     "polar": int(polar), "turning": 2 if polar else 1, "method": method,
                     "depth": self.depth, "d_max": self.d_max, "rho": rho,
                     "radius": self.d_max}  # fmt: skip
            for name, value in attrs.items():
                file.attrs[name] = value
            values = {
                "grains/kind": self.kind.astype("i4"),
                "grains/cell": np.where(self.kind == GHOST, self.cell + 1, 0).astype("i4"),
                "grains/depth": self.distance(self.x),
                "grains/shape_u": self.value,
                "grains/shape_phi": self.value if polar else empty,
                "grains/shape_slope": self.slope.reshape(len(self.kind), -1),
                "contacts/pair": (self.pair + 1).astype("i4"),
                "contacts/arm": self.arms.reshape(-1, 6),
                "contacts/normal": self.normal,
                "contacts/stiffness": np.tile([self.pack.kn, self.pack.ks], (len(self.pair), 1)),
                "elements/node_u": (self.node + 1).astype("i4"),
                "elements/node_phi": (self.node + 1 if polar else self.node[:, :0]).astype("i4"),
                "elements/region": self.of_element.astype("i4"),
                "elements/moduli": np.tile(self.moduli.T.ravel(), (len(self.node), 1)),
                "points/element": (self.element + 1).astype("i4"),
                "points/volume": np.full(len(self.element), self.volume),
                "points/depth": self.distance(self.point),
                "points/slope_u": slope.reshape(len(slope), -1),
                "points/slope_mean": slope.reshape(len(slope), -1),
                "points/value_phi": np.tile(self.g_value, (len(self.node), 1))
                if polar
                else np.zeros(none),
                "points/slope_phi": slope.reshape(len(slope), -1) if polar else np.zeros(none),
            }
            for name, value in (values | more).items():
                file[name] = value

    def weigh(self, case: object, method: str, rho: float = 1.0, expect: int = 0,
              **more: object) -> dict:  # fmt: skip
        """Let Talus choose the weights and take them; return what it says of them."""
        self.write(case.folder / "overlap.h5", method, rho, **more)
        case.run("talus-couple", "overlap.h5", "--weights", expect=expect)
        if expect:
            return {}
        with h5py.File(case.folder / "overlap_weights.h5") as file:
            self.weights(file["w"][...], file["beta"][...])
            return dict(file.attrs) | {k: d[...] for k, d in file.items()}

    def middles(self) -> np.ndarray:
        """Middles of the branches [m]."""
        return self.x[self.pair[:, 0]] + 0.5 * self.branch


def six(t: np.ndarray) -> np.ndarray:
    """Return xx yy zz xy yz zx of the symmetric part."""
    s = 0.5 * (t + t.T)
    return np.array([s[0, 0], s[1, 1], s[2, 2], s[0, 1], s[1, 2], s[2, 0]])


def slab(nx: int, ny: int, hat: int, tilde: int, bar: int) -> np.ndarray:
    """Regions of a slab: free grains between two layers of ghosts, elements beyond."""
    column = [TILDE] * tilde + [HAT] * hat + [TILDE] * tilde + [BAR] * bar
    return np.tile(np.array(column), (nx, ny, 1))


def box(n: int, hat: int, tilde: int) -> np.ndarray:
    """Regions of a box: free grains inside, ghosts around with edges and corners."""
    region = np.full((n, n, n), BAR)
    region[: hat + 2 * tilde, : hat + 2 * tilde, : hat + 2 * tilde] = TILDE
    region[tilde : tilde + hat, tilde : tilde + hat, tilde : tilde + hat] = HAT
    return region


def volume_share(ov: Overlap, pieces: int = 60) -> np.ndarray:
    """Share of each element's contact stiffness that belongs to contacts with a free grain."""
    touch = (ov.kind[ov.pair] == FREE).any(1)
    part = (ov.branch**2).sum(1) / pieces
    sums = np.zeros((2, len(ov.node)))
    for t in (np.arange(pieces) + 0.5) / pieces:
        at = ov.x[ov.pair[:, 0]] + t * ov.branch
        place = np.floor(at / ov.h).astype(int) % ov.shape
        cell = np.ravel_multi_index(place.T, ov.shape)
        np.add.at(sums[1], cell, part)
        np.add.at(sums[0], cell[touch], part[touch])
    share = sums[0] / np.maximum(sums[1], 1e-300)
    return np.where(ov.of_element == TILDE, share, 0.0)[ov.element]


def random_pack(length: np.ndarray, fraction: float, seed: int) -> Pack:
    """Return a jammed pack of spheres of diameter 0.9 to 1.1, without those that touch few."""
    rng = np.random.default_rng(seed)
    many = int(fraction * np.prod(length) / (np.pi / 6.0 * 1.01))
    radius = 0.5 * rng.uniform(0.9, 1.1, many)
    radius *= (fraction * np.prod(length) / (4.0 / 3.0 * np.pi * (radius**3).sum())) ** (1 / 3)
    x = relaxed(rng.uniform(size=(many, 3)) * length, radius, length, 900)
    while True:
        pair, branch = find_contacts(x, radius, length, 0.0)
        kept = np.bincount(pair.ravel(), minlength=len(x)) >= 4
        if kept.all():
            return Pack(length, x, radius, pair, branch)
        x, radius = x[kept], radius[kept]


def relaxed(x: np.ndarray, radius: np.ndarray, length: np.ndarray, rounds: int) -> np.ndarray:
    """Move spheres that push one another by FIRE (Bitzek et al. 2006)."""
    v, many = np.zeros_like(x), len(x)
    dt, mix, good = 0.1, 0.1, 0
    near, home, moved = None, x, np.inf
    for _ in range(rounds):
        if moved > 0.05:
            near, _ = find_contacts(x % length, radius, length, 0.12)
            home, moved = x.copy(), 0.0
        branch = x[near[:, 1]] - x[near[:, 0]]
        branch -= length * np.round(branch / length)
        size = np.linalg.norm(branch, axis=1)
        overlap = np.maximum(radius[near].sum(1) - size, 0.0)
        f = gather(near, (overlap / size)[:, None] * branch, many)
        power = (f * v).sum()
        v = (1.0 - mix) * v + mix * np.linalg.norm(v) / max(np.linalg.norm(f), 1e-300) * f
        good = good + 1 if power > 0.0 else 0
        if good > 5:
            dt, mix = min(1.1 * dt, 0.5), 0.99 * mix
        elif power <= 0.0:
            dt, mix, v = 0.5 * dt, 0.1, np.zeros_like(v)
        v += dt * f
        x = x + dt * v
        moved = 2.0 * np.abs(x - home).max()
    return x % length


def gather(pair: np.ndarray, push: np.ndarray, many: int) -> np.ndarray:
    """Sum pushes on the second grain, and their reactions on the first."""
    out = np.zeros((many, 3))
    for k in range(3):
        out[:, k] = np.bincount(pair[:, 1], push[:, k], many)
        out[:, k] -= np.bincount(pair[:, 0], push[:, k], many)
    return out
