"""Stress, stiffness and rotation of an fcc lattice in a periodic cell, against closed sums."""

import itertools

import numpy as np

from talus.compare import max_of
from talus.packing import make_packing, write_h5
from talus.verification import Case, read_history

RADIUS, YOUNG, POISSON = 1.0e-3, 29.0e9, 0.25
OVERLAP = 1.0e-2  # of the diameter
EDGE = 2.0 * np.sqrt(2.0) * RADIUS * (1.0 - OVERLAP)
MODULUS = 0.5 * YOUNG / (1.0 - POISSON**2)
DEPTH = 2.0 * RADIUS * OVERLAP
KN = 2.0 * MODULUS * np.sqrt(0.5 * RADIUS * DEPTH)
KS = KN * 2.0 * (1.0 - POISSON) / (2.0 - POISSON)
FORCE = 2.0 / 3.0 * KN * DEPTH
NINE = [a + b for a in "xyz" for b in "xyz"]
# three cubes by three by three, and a slanted cell of the same lattice
CUBE = np.diag(np.full(3, 3.0 * EDGE))
SLANTED = EDGE * np.array([[3.5, 0.5, 0.0], [3.0, 3.5, 0.5], [-0.5, 2.0, 4.5]])
STRAIN, STEPS = 1.0e-6, 200  # small strain, and the steps that it takes
TURN, OMEGA = np.pi / 6.0, 200.0  # angle and speed of the rotation [rad/s]


def neighbours() -> np.ndarray:
    """Branches to the twelve neighbours [m]."""
    signs = itertools.product((-1.0, 1.0), repeat=2)
    half = [(0, a, b) for a, b in signs]
    rows = [np.roll(v, k) for v in half for k in range(3)]
    return 0.5 * EDGE * np.array(rows)


def closed_forms() -> tuple[float, np.ndarray]:
    """Pressure [Pa] and stiffness C_ijkl [Pa]: half of twelve contacts for each of the spheres.

    dsigma_ij = (1/V) sum l_i (K_jl + what the turning of the force adds) l_k L_lk - sigma_ij tr L
    + L_ik sigma_kj for a small strain; in terms of the velocity gradient L_lk = dv_l/dx_k.
    """
    volume = EDGE**3 / 4.0
    c = np.zeros((3, 3, 3, 3))
    sigma = np.zeros((3, 3))
    for branch in neighbours():
        n = branch / np.linalg.norm(branch)
        across = np.eye(3) - np.outer(n, n)
        force = -FORCE * n  # on the first from the second
        spring = KN * np.outer(n, n) + (KS - FORCE / np.linalg.norm(branch)) * across
        c += 0.5 * np.einsum("i,jl,k->ijlk", branch, spring, branch) / volume
        c += 0.5 * np.einsum("il,k,j->ijlk", np.eye(3), branch, force) / volume
        sigma += 0.5 * np.outer(branch, force) / volume
    c -= np.einsum("ij,lk->ijlk", sigma, np.eye(3))
    return float(-np.trace(sigma) / 3.0), c


def lattice(cell: np.ndarray) -> np.ndarray:
    """Centres of the lattice that lie in a cell whose rows are its edges [m]."""
    reach = range(-30, 31)
    base = np.array([[0, 0, 0], [0, 1, 1], [1, 0, 1], [1, 1, 0]]) * 0.5
    at = np.array(list(itertools.product(reach, repeat=3)), float)
    x = EDGE * (base[None] + at[:, None]).reshape(-1, 3)
    inside = x @ np.linalg.inv(cell)
    return x[((inside > -1e-9) & (inside < 1.0 - 1e-9)).all(axis=1)]


def simulate(
    case: Case, name: str, cell: np.ndarray, rates: dict[str, float], dt: float, steps: int,
    spin: np.ndarray | None = None,
) -> dict[str, np.ndarray]:  # fmt: skip
    """Strain a cell of the lattice; return the rows of the cell and of the measures."""
    x = lattice(cell)
    omega = None if spin is None else np.tile(spin, (len(x), 1))
    write_h5(case.folder / f"{name}.h5", make_packing(x, np.full((len(x), 3), RADIUS), omega=omega))
    groups = [f"&cell_rate component = '{k}', rate = {v:.17g} /" for k, v in rates.items()]
    deck = (case.folder / "deck.nml").read_text()
    words = {
        "T_END": f"{steps * dt:.17g}", "T_ROW": f"{steps // 10 * dt:.17g}", "DT": f"{dt:.17g}",
        "VECTORS": ", ".join(f"{v:.17g}" for v in cell.ravel()), "RATES": "\n".join(groups),
        "PACK": f"{name}.h5",
    }  # fmt: skip
    for word, value in words.items():
        deck = deck.replace(word, value)
    (case.folder / f"{name}.nml").write_text(deck)
    case.run("talus-dem", f"{name}.nml", "--threads=1")
    rows = read_history(case.folder / f"{name}_cell.csv")
    rows |= {
        f"all_{k}": v for k, v in read_history(case.folder / f"{name}_measure_all.csv").items()
    }
    energy = read_history(case.folder / f"{name}_energy.csv")
    return rows | {"closure": energy["closure_error"], "work": energy["boundary"]}


def stress(rows: dict[str, np.ndarray], k: int) -> np.ndarray:
    """Stress of a row (3, 3) [Pa]."""
    return np.array([rows[f"stress_{a}"][k] for a in NINE]).reshape(3, 3)


def run(case: Case) -> None:
    """Compare stress, stiffness and rotation."""
    pressure, stiffness = closed_forms()
    dt = 2.0e-8
    still = {}
    for name, cell in (("cube", CUBE), ("slanted", SLANTED)):
        still[name] = simulate(case, name, cell, {}, dt, 10)
        error = np.abs(stress(still[name], -1) + pressure * np.eye(3)).max() / pressure
        case.below(f"stress, {name} cell, error / pressure", float(error), 1e-12)
        case.metric(f"coordination, {name} cell", still[name]["all_coordination"][-1], 12.0, 1e-12)
        case.metric(
            f"affine bulk modulus / closed sum, {name} cell",
            float(still[name]["all_affine_bulk"][-1] / affine_bulk()), 1.0, 1e-12,
        )  # fmt: skip
    first = stress(still["slanted"], -1)
    errors = []
    for k, component in enumerate(NINE):
        rate = STRAIN / (STEPS * dt)
        rows = simulate(case, f"strain_{component}", SLANTED, {component: rate}, dt, STEPS)
        found = (stress(rows, -1) - first) / STRAIN
        exact = stiffness[:, :, k // 3, k % 3]
        errors.append(np.abs(found - exact).max() / np.abs(stiffness).max())
    case.below("stiffness, nine strains, largest error / C_xxxx", float(max_of(errors)), 2e-4,
               "strain 1e-6 against an overlap of 1e-2")  # fmt: skip
    turned = [rotate(case, steps, pressure) for steps in (8000, 16000)]
    case.below("rotation by 30 degrees, change of stress / pressure, 16000 steps", turned[1], 2e-3)
    order = float(np.log2(turned[0] / turned[1]))
    case.metric("order of that in the step", order, 1.0, 0.2)
    sheared(case, dt)


def affine_bulk() -> float:
    """Bulk modulus of the affine sum [Pa]."""
    return float(12.0 * 4.0 / EDGE**3 / 18.0 * KN * (EDGE / np.sqrt(2.0)) ** 2)


def rotate(case: Case, steps: int, pressure: float) -> float:
    """Turn cell and grains about z; return what the stress changes [of the pressure]."""
    rates = {"xy": -OMEGA, "yx": OMEGA}
    dt = TURN / OMEGA / steps
    rows = simulate(case, f"turn{steps}", SLANTED, rates, dt, steps, np.array([0.0, 0.0, OMEGA]))
    return float(np.abs(stress(rows, -1) - stress(rows, 0)).max() / pressure)


def sheared(case: Case, dt: float) -> None:
    """Shear by 0.1, draw the stress, and look at the ledger."""
    rows = simulate(case, "shear", CUBE, {"xz": 0.1 / (4000 * dt)}, dt, 4000)
    work = np.abs(rows["work"]).max()
    case.below("ledger of a shear of 0.1 / work", float(np.abs(rows["closure"]).max() / work), 1e-4)
    case.below("volume", float(np.abs(rows["volume"] / rows["volume"][0] - 1.0).max()), 1e-12)
    _, stiffness = closed_forms()
    fig, ax = case.figure()
    gamma = rows["deform_xz"]
    line = np.array([0.0, 0.02])
    ax.plot(line, 1e-9 * stiffness[2, 0, 0, 2] * line, label="closed stiffness")
    ax.plot(gamma, 1e-9 * rows["stress_zx"], "o", label=r"$\sigma_{zx}$")
    ax.set(xlabel="shear [-]", ylabel="stress [GPa]")
    ax.legend()
    case.save(fig)
