"""Random packs in overlap against the same packs without elements; balance of initial stresses."""

from dataclasses import dataclass

import numpy as np
from overlap_cell import AXIAL, HAT, TILDE, Overlap, Pack, random_pack, six, slab, strain_states

from talus.verification import Case

H, FRACTION, TOLERANCE = 3.0, 0.67, 1e-6
PACKS = ((4, 1), (4, 2), (6, 3), (8, 4))  # elements of free grains across the slab, seed
STATES = {"oedometric": 2, "shear": 5}
RHO_RAMP = "relaxed, ramp with rho"
METHODS = {  # name: method, relaxed moduli, rho, kernel shares
    "twice": ("twice", True, False, False),
    "affine, share": ("share", False, False, True),
    "relaxed, share": ("share", True, False, True),
    "relaxed, ramp": ("ramp", True, False, False),
    RHO_RAMP: ("ramp", True, True, False),
}


@dataclass
class Truth:
    """What the grains alone do: stress by state, motion, relaxed moduli."""

    pack: Pack
    region: np.ndarray
    stress: np.ndarray
    motion: list[np.ndarray]
    moduli: np.ndarray
    rho: float


def alone(hat: int, seed: int) -> Truth:
    """Make a pack and strain it without elements."""
    region = slab(3, 3, hat, 1, 2)
    pack = random_pack(np.array(region.shape) * H, FRACTION, seed)
    affine = pack.moduli()
    grains = Overlap(pack, np.full(3, H), np.full(region.shape, HAT), True, affine)
    found = [grains.relax(strain, TOLERANCE) for strain in strain_states()]
    stress = np.array([six(f[0]) for f in found]).T
    bound = np.array([six((affine @ e.ravel()).reshape(3, 3)) for e in strain_states()]).T
    rho = np.trace(stress) / np.trace(bound)
    full = np.array([(0.5 * (f[0] + f[0].T)).ravel() for f in found]).T
    moduli = full @ np.linalg.pinv(strain_states().reshape(6, 9).T)
    turning = AXIAL.reshape(3, 9) / np.sqrt(2.0)  # the antisymmetric part is affine, times rho
    moduli = moduli + rho * turning.T @ (turning @ affine @ turning.T) @ turning
    return Truth(pack, region, stress, [f[1] for f in found], 0.5 * (moduli + moduli.T), rho)


def compare(case: Case, truth: Truth, name: str) -> dict[str, float]:
    """Errors of stress, and of displacement over the non-affine motion, also 2 d from ghosts."""
    method, relaxed, with_rho, kernel = METHODS[name]
    moduli = truth.moduli if relaxed else truth.pack.moduli()
    ov = Overlap(truth.pack, np.full(3, H), truth.region, True, moduli)
    more = {}
    if kernel:
        more = {"points/x": ov.point, "contacts/middle": ov.middles(),
                "period": truth.pack.length}  # fmt: skip
    ov.weigh(case, method, truth.rho if with_rho else 1.0, **more)
    hat = (truth.region[0, 0] == HAT).sum()
    z = ov.x[ov.free, 2]
    far = np.minimum(z - H, (hat + 1) * H - z) > 2.0
    out = {}
    for state, s in STATES.items():
        stress, grains, _ = ov.relax(strain_states()[s], TOLERANCE)
        out[f"stress, {state}"] = abs(six(stress)[s] / truth.stress[s, s] - 1.0)
        exact = truth.motion[s][ov.keep[ov.free], :3]
        own = grains[ov.free, :3]
        scale = spread(exact)
        out[f"motion, {state}"] = spread(own - exact) / scale
        out[f"motion 2 d inside, {state}"] = spread((own - exact)[far]) / scale
    return out


def spread(u: np.ndarray) -> float:
    """Root mean square about the mean."""
    return float(np.sqrt(((u - u.mean(0)) ** 2).sum(1).mean()))


def judge_initial(case: Case, truth: Truth) -> None:
    """The pack at rest under a squeeze, its mean stress in all elements: corrected."""
    shape = truth.region.shape
    grains = Overlap(truth.pack, np.full(3, H), np.full(shape, HAT), True, truth.moduli)
    squeeze = -0.01 * np.eye(3)
    sigma, motion, nodes = grains.relax(squeeze, 1e-14)
    whole = grains.inner(motion, nodes, squeeze)[2]
    ov = Overlap(truth.pack, np.full(3, H), truth.region, True, truth.moduli)
    kept = np.zeros(len(truth.pack.x), bool)
    kept[ov.keep] = True
    force = whole[kept[truth.pack.pair].all(1)]
    stress = np.tile(sigma.ravel(), (len(ov.element), 1))
    rows = 2 * ov.nodes
    said = ov.weigh(
        case, "ramp", truth.rho,
        **{"contacts/force": force, "points/stress": stress,
           "points/couple": np.zeros_like(stress), "blocks/load": np.zeros((rows, 3)),
           "blocks/free": np.ones((rows, 3), "i4"),
           "elements/chosen": (ov.of_element == TILDE).astype("i4")},
    )  # fmt: skip
    mean = np.linalg.norm(force, axis=1).mean()
    for when, limit, t, m in (("before", None, stress, 0.0 * stress),
                              ("after", 1e-10, said["stress"], said["couple"])):  # fmt: skip
        q, d = ov.rows_of(force, t.reshape(-1, 3, 3), m.reshape(-1, 3, 3))
        for who, rest in (("free grains", q), ("nodes", d)):
            value = float(np.linalg.norm(rest[:, :3], axis=1).max() / mean)
            if limit is None:
                case.above(f"initial stress: {who} {when}", value, 0.1, "mean contact force")
            else:
                case.below(f"initial stress: {who} {when}", value, limit)
    case.below("initial stress: rest that Talus reports", float(said["initial_after"]), 1e-10)
    case.below("initial stress: largest change / p", float(said["initial_change"]), 0.5)


def run(case: Case) -> None:
    """Compare all weights on the first pack, the ramps on all."""
    table: dict[str, list[dict[str, float]]] = {name: [] for name in METHODS}
    for k, (hat, seed) in enumerate(PACKS):
        truth = alone(hat, seed)
        for name in METHODS if k == 0 else (RHO_RAMP, "relaxed, share"):
            table[name].append(compare(case, truth, name))
        if k == 0:
            judge_initial(case, truth)
            case.metric("relaxed / affine moduli", truth.rho, 0.85, 0.03)
    for k, found in enumerate(table[RHO_RAMP]):
        worst = max(found[f"stress, {state}"] for state in STATES)
        case.below(f"pack {k + 1}: stress", worst, 0.02, RHO_RAMP)
    for what, limit in (("motion", 0.35), ("motion 2 d inside", 0.25)):
        mean = np.mean([f[f"{what}, {state}"] for f in table[RHO_RAMP] for state in STATES])
        case.below(f"mean of all packs: {what}", float(mean), limit, RHO_RAMP)
    twice, affine = table["twice"][0], table["affine, share"][0]
    case.above("counted twice: motion", twice["motion, shear"], 2.0)
    case.above("counted twice: stress", twice["stress, shear"], 0.1)
    case.above("affine moduli: stress", affine["stress, shear"], 0.06)
    case.above("affine moduli: motion", affine["motion, oedometric"], 1.0)
    case.above("ramp without rho: stress", table["relaxed, ramp"][0]["stress, shear"], 0.025)
    draw(case, table)


def draw(case: Case, table: dict[str, list[dict[str, float]]]) -> None:
    """Draw errors of stress and motion by weights."""
    fig, ax = case.figure()
    for mark, what in zip("os^v", ("stress, oedometric", "stress, shear", "motion, oedometric",
                                   "motion, shear"), strict=True):  # fmt: skip
        for k, name in enumerate(METHODS):
            values = [found[what] for found in table[name]]
            label = what if k == 0 else None
            ax.semilogy([k] * len(values), values, mark, label=label,
                        color=f"C{'os^v'.index(mark)}")  # fmt: skip
    ax.axhline(0.02, color="C1", lw=0.8)
    ax.axhline(0.35, color="C3", lw=0.8)
    ax.set_xticks(range(len(METHODS)), [name.replace(", ", ",\n") for name in METHODS])
    ax.tick_params(axis="x", labelsize=7)
    ax.set(xlabel="moduli, weights [-]", ylabel="error against grains alone [-]")
    ax.legend(fontsize=7)
    case.save(fig)
