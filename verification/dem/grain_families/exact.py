"""Fragments of an ellipsoid, a poly-ellipsoid and a superquadric against another program."""

import json
from math import gamma

import numpy as np

from talus.packing import Packing, make_packing, read_h5, write_h5
from talus.verification import Case, read_history

DENSITY, APART, DEPTH = 2650.0, 20.0e-3, 1.0e-6  # [kg/m3], between grains, of the touch [m]
TOUCH = 0.95e-3  # radius of the spheres that touch [m]
SPIN = 2.0e3  # [rad/s]
SHRUNK = {2.0: 1.0 - 1.0e-9, 4.0: 1.0 - 2.0e-4}  # by exponent


def dirichlet(p: float, i: int, j: int, k: int) -> float:
    """Integrate x^(i-1) y^(j-1) z^(k-1) over an octant of the unit ball of exponent p."""
    return gamma(i / p) * gamma(j / p) * gamma(k / p) / (p**3 * gamma(1.0 + (i + j + k) / p))


def volume(upper: np.ndarray, lower: np.ndarray, p: float) -> np.ndarray:
    """Volumes of shapes with semi-axes (n, 3) [m3]."""
    return (upper + lower).prod(-1) * dirichlet(p, 1, 1, 1)


def centre(upper: np.ndarray, lower: np.ndarray, p: float) -> np.ndarray:
    """Centres of mass from the origins of the octants (n, 3) [m]."""
    return dirichlet(p, 2, 1, 1) / dirichlet(p, 1, 1, 1) * (upper - lower)


def sides(pack: Packing) -> tuple[np.ndarray, np.ndarray]:
    """Semi-axes on both sides of all grains (n, 3) [m]."""
    return pack.axes * (1.0 + pack.skew), pack.axes * (1.0 - pack.skew)


def rotation(q: np.ndarray) -> np.ndarray:
    """Return the matrix of a quaternion w x y z."""
    w, x, y, z = q / np.linalg.norm(q)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross


class Grain:
    """One grain of the start: semi-axes on both sides, exponent, load, what is known of it."""

    def __init__(self, upper: list, lower: list, p: float, load: list, family: dict) -> None:
        """Take the semi-axes [m] and the direction of the load, and read the reference."""
        self.upper, self.lower, self.p = np.array(upper), np.array(lower), p
        self.load = np.array(load) / np.linalg.norm(load)
        rows = family["fragments"]
        self.origin = np.array([row["origin"] for row in rows])
        self.above, self.below = (
            np.array([row[side] for row in rows]) for side in ("upper", "lower")
        )
        self.kept = family["kept"]

    def touched(self) -> np.ndarray:
        """Return where a sphere touches it, from the origin of the octants [m]."""
        side = np.where(self.load > 0.0, self.upper, self.lower)
        point = self.load / (np.abs(self.load / side) ** self.p).sum() ** (1.0 / self.p)
        normal = np.sign(self.load) * np.abs(point / side) ** (self.p - 1.0) / side
        return point + (TOUCH - DEPTH) * normal / np.linalg.norm(normal)


def grains_of(reference: dict, kind: str) -> list[Grain]:
    """Grains of a run, in the order of their ids: the ellipsoid first, as its turn is that of 1."""
    found = []
    if kind == "fourteen":
        turned = reference["turned"]
        axes, size = np.array(turned["axes"]), np.array(turned["radii_share"])
        family = {"kept": float((size**3).sum()), "fragments": [
            {"origin": c, "upper": r * axes, "lower": r * axes}
            for c, r in zip(turned["centres_in_principal_axes"], size, strict=True)]}  # fmt: skip
        found.append(Grain(axes, axes, 2.0, [1.0, 0.0, 0.0], family))
    # loads by which the axis of the reference is the longest across
    loads = {0: [0.0, 1.0, 0.0], 2: [1.0, 1.0, 0.0]}
    for family in reference["families"]:
        if family["kind"] == kind:
            found.append(Grain(family["upper"], family["lower"], family["exponent"],
                               loads[family.get("axis", 0)], family))  # fmt: skip
    return found


def start(case: Case, grains: list[Grain], spin: np.ndarray) -> None:
    """Write the grains, turned in several ways, each with a fixed sphere that touches it."""
    n = len(grains)
    rng = np.random.default_rng(5)
    quat = rng.normal(size=(n, 4))
    quat /= np.linalg.norm(quat, axis=1)[:, None]
    x, touch = np.zeros((n, 3)), np.zeros((n, 3))
    for k, grain in enumerate(grains):
        r = rotation(quat[k])
        x[k] = [APART * k, 0.0, 0.0]
        inner = centre(grain.upper, grain.lower, grain.p)
        touch[k] = x[k] + r @ (grain.touched() - inner)
    upper, lower = (np.array([getattr(g, side) for g in grains]) for side in ("upper", "lower"))
    one = np.zeros((n, 4)) + [1.0, 0.0, 0.0, 0.0]
    pack = make_packing(
        np.vstack([x, touch]), np.vstack([0.5 * (upper + lower), np.full((n, 3), TOUCH)]),
        quat=np.vstack([quat, one]), kind=np.repeat([0, 1], n).astype(np.int32),
        omega=np.vstack([np.einsum("nij,nj->ni", [rotation(q) for q in quat], spin),
                         np.zeros((n, 3))]))  # fmt: skip
    pack.skew = np.vstack([(upper - lower) / (upper + lower), np.zeros((n, 3))])
    pack.exponent = np.concatenate([[g.p for g in grains], np.full(n, 2.0)])
    write_h5(case.folder / "pack.h5", pack)


def go(case: Case, kind: str, name: str) -> tuple[Packing, Packing, dict, dict]:
    """Run a deck; return packings of start and end, histories of breakage and energy."""
    text = (case.folder / "deck.nml").read_text().replace("FAMILY", kind)
    (case.folder / f"{name}.nml").write_text(text.replace("end.h5", f"{name}_end.h5"))
    case.run("talus-dem", f"{name}.nml", "--threads=1")
    rows, energy = (read_history(case.folder / f"{name}_{k}.csv") for k in ("breakage", "energy"))
    return read_h5(case.folder / "pack.h5"), read_h5(case.folder / f"{name}_end.h5"), rows, energy


def check_family(case: Case, reference: dict, kind: str) -> list:
    """Judge places, semi-axes, volumes and masses of all fragments of a run."""
    grains = grains_of(reference, kind)
    n, each = len(grains), {"fourteen": 14, "halves": 2}[kind]
    start(case, grains, np.zeros((n, 3)))
    first, last, rows, _ = go(case, kind, kind)
    born = np.argsort(last.id)[last.id[np.argsort(last.id)] > 2 * n]
    case.metric(f"{kind}: fragments", len(born), n * each, 0)
    above, below = sides(last)
    drawn = []
    for k, grain in enumerate(grains):
        mine = born[each * k : each * (k + 1)]
        label = f"{kind}, " + {2.0: "poly-ellipsoid", 4.0: "superquadric"}[grain.p] + f" {k + 1}"
        if np.allclose(grain.upper, grain.lower) and grain.p == 2.0:
            label = f"{kind}, ellipsoid turned by its id"
        size = grain.upper.max()
        r = rotation(first.quat[k])
        inner = centre(grain.upper, grain.lower, grain.p)
        there = grain.origin + centre(above[mine], below[mine], grain.p)
        off = np.abs((last.x[mine] - first.x[k]) @ r + inner - there).max()
        case.below(f"{label}: places / semi-axis", off / size, 1e-12)
        small = SHRUNK[grain.p]
        off = max(np.abs(above[mine] / small - grain.above).max(),
                  np.abs(below[mine] / small - grain.below).max())  # fmt: skip
        case.below(f"{label}: semi-axes / semi-axis", off / size, 1e-12)
        kept = volume(above[mine], below[mine], grain.p).sum() / small**3
        whole = volume(grain.upper, grain.lower, grain.p)
        case.metric(f"{label}: volume kept", kept / whole, grain.kept, 1e-12)
        turn = np.abs(last.quat[mine] @ first.quat[k]).min()
        case.metric(f"{label}: axes of the fragments", turn, 1.0, 1e-12)
        drawn.append((grain, grain.origin, above[mine], below[mine]))
    before = DENSITY * sum(volume(g.upper, g.lower, g.p) for g in grains)
    rows_of = zip(above[born], below[born], last.exponent[born], strict=True)
    after = DENSITY * sum(volume(*row) for row in rows_of)
    case.metric(f"{kind}: mass of grains and fines / start",
                (after + rows["fines_mass"][-1]) / before, 1.0, 1e-14)  # fmt: skip
    return drawn


def check_inertia(case: Case, reference: dict) -> None:
    """Judge what the fines of spinning grains of even sides take along."""
    grains = [g for g in grains_of(reference, "fourteen") if np.allclose(g.upper, g.lower)]
    for axis in range(3):
        for k, grain in enumerate(grains):
            spin = np.zeros((1, 3))
            spin[0, axis] = SPIN
            start(case, [grain], spin)
            _, _, rows, _ = go(case, "fourteen", f"spin_{k}_{axis}")
            a, p = grain.upper, grain.p
            mean = dirichlet(p, 3, 1, 1) / dirichlet(p, 1, 1, 1)  # of x^2 in the unit ball
            r = grain.above[:, 0] / a[0]
            c2 = ((grain.origin / a) ** 2).sum(1) / 3.0
            kept = SHRUNK[p] ** 3 * (r**3 * (SHRUNK[p] ** 2 * r**2 * mean + c2)).sum() / mean
            if p == 2.0:
                case.metric(f"inertia kept, not shrunk, about {'abc'[axis]}",
                            float((r**3 * (r**2 * mean + c2)).sum() / mean),
                            reference["kept_inertia"][axis], 1e-12)  # fmt: skip
            inertia = DENSITY * volume(a, a, p) * mean * (a @ a - a[axis] ** 2)
            lost = rows["fines"][-1] / (0.5 * inertia * SPIN**2)
            name = "ellipsoid" if p == 2.0 else "superquadric"
            case.metric(f"{name}, spin about {'abc'[axis]}: energy of fines / 1/2 I w^2", lost,
                        1.0 - kept, 1e-9)  # fmt: skip


def run(case: Case) -> None:
    """Judge both families, then spinning grains."""
    reference = json.loads((case.folder / "reference.json").read_text())
    drawn = check_family(case, reference, "fourteen") + check_family(case, reference, "halves")
    check_inertia(case, reference)
    draw(case, drawn)


def outline(upper: np.ndarray, lower: np.ndarray, p: float, at: float) -> np.ndarray:
    """Section of a shape by a plane y = at, from the origin of its octants, x and z (2, n) [m]."""
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    n = np.array([np.cos(angle), np.sin(angle)])
    side = np.where(n.T > 0.0, upper[[0, 2]], lower[[0, 2]]).T
    left = max(1.0 - abs(at / (upper[1] if at > 0.0 else lower[1])) ** p, 0.0)
    return n * (left / (np.abs(n / side) ** p).sum(0)) ** (1.0 / p)


def draw(case: Case, drawn: list) -> None:
    """Draw sections of all grains and their fragments through the origins of the octants."""
    fig, axes = case.figure(ncols=len(drawn), figsize=(2.0 * len(drawn), 2.6))
    for ax, (grain, origin, above, below) in zip(axes, drawn, strict=True):
        ax.plot(*1e3 * outline(grain.upper, grain.lower, grain.p, 0.0), "k-", lw=1.0)
        for c, a, b in zip(origin, above, below, strict=True):
            if -a[1] < c[1] < b[1]:
                section = outline(a, b, grain.p, -c[1]) + c[[0, 2], None]
                ax.plot(*1e3 * section, "C0-", lw=0.8)
        ax.set(aspect="equal", xlabel="x [mm]")
    axes[0].set_ylabel("z [mm]")
    case.save(fig)
