"""A micropolar layer sheared and turned by the friction of drifting grains on its ghosts."""

import numpy as np
from coupled import audit_of, write_deck

from talus.mesh import box, read_mesh, write_mesh
from talus.orders import converted
from talus.verification import Case, field_steps, write_packing

MU, KAPPA, GAMMA, H, WIDTH = 1.0e7, 1.0e7, 60.0, 0.02, 0.01
RADIUS, OVERLAP, K_T, SPEED, T_END = 2.0e-3, 1.0e-7, 5.0e4, 1.0e-3, 1.0e-3
C = np.sqrt(GAMMA * (MU + KAPPA) / (KAPPA * (2 * MU + KAPPA)))
PAIRS = {
    "mixed": ("hex20/hex8", 40, 2e-3),
    "equal": ("hex20/hex20", 40, 1e-4),
    "linear": ("hex8/hex8", 80, 1e-3),
}


class Layer:
    """Closed form for a drift `delta` of the grains [m]; u(0) = phi(0) = 0.

    tau = (mu + kappa) u' + kappa phi, gamma phi'(H) = couple per area; at each of four contacts of
    arm r the force is k_t (delta - u(H) + r phi(H)) along x, the moment -r times it about z.
    """

    def __init__(self, delta: float, moments: float = 1.0) -> None:
        """Solve for shear and couple; `moments` = 0 leaves the couples out."""
        arm, area = RADIUS - 0.5 * OVERLAP, WIDTH**2
        # unknown: tau and b of phi = -tau/s (1 - cosh(y/c)) + b sinh(y/c)
        unit = [self.fields(1.0, 0.0, np.array([H])), self.fields(0.0, 1.0, np.array([H]))]
        slip = np.array([(-u + arm * phi)[0] for u, phi, _ in unit])
        bend = np.array([GAMMA * slope[0] for _, _, slope in unit])
        rows = np.array(
            [[area, 0.0] - 4 * K_T * slip, area * bend + moments * 4 * K_T * arm * slip]
        )
        right = np.array([4 * K_T * delta, -moments * 4 * K_T * arm * delta])
        self.tau, self.b = np.linalg.solve(rows, right)
        self.moment = area * float(bend @ [self.tau, self.b])
        self.force = area * self.tau

    @staticmethod
    def fields(tau: float, b: float, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Displacement [m], micro-rotation and its slope [1/m]."""
        top = -tau / (2 * MU + KAPPA)
        phi = top * (1 - np.cosh(y / C)) + b * np.sinh(y / C)
        slope = (-top * np.sinh(y / C) + b * np.cosh(y / C)) / C
        area = top * (y - C * np.sinh(y / C)) + b * C * (np.cosh(y / C) - 1)
        return (tau * y - KAPPA * area) / (MU + KAPPA), phi, slope

    def at(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement [m] and micro-rotation."""
        return self.fields(self.tau, self.b, y)[:2]


def run(case: Case) -> None:
    """Judge the change over the second half of the run, when nothing lags any more."""
    write_grains(case)
    exact = Layer(0.5 * SPEED * T_END)
    without = Layer(0.5 * SPEED * T_END, moments=0.0)
    top = np.array([H])
    case.above(
        "micro-rotation of the face without moments, off",
        abs(without.at(top)[1][0] / exact.at(top)[1][0] - 1),
        0.2,
        "moments matter",
    )
    fig, ax = case.figure()
    y = np.linspace(0.0, H, 201)
    ax.plot(1e6 * exact.at(y)[1], 1e3 * y, "k-", lw=1, label="exact")
    ax.plot(1e6 * without.at(y)[1], 1e3 * y, "k:", lw=1, label="without the moments")
    for name, mark in zip(PAIRS, "os^", strict=True):
        phi, place = judge(case, name, exact)
        label = f"Talus, {PAIRS[name][0]}"
        ax.plot(1e6 * phi[::8], 1e3 * place[::8], mark, ms=4, mfc="none", label=label)
    ax.set(xlabel="micro-rotation [µrad]", ylabel="y [mm]")
    ax.legend()
    case.save(fig)


def judge(case: Case, name: str, exact: Layer) -> tuple[np.ndarray, np.ndarray]:
    """Run one pair of fields; return micro-rotation and place of the corner nodes."""
    pair, layers, limit = PAIRS[name]
    mesh = box(np.zeros(3), np.array([WIDTH, H, WIDTH]), (1, layers, 1))
    mesh = mesh if pair == "hex8/hex8" else converted(mesh, "hex20")
    write_mesh(case.folder / f"{name}.h5", mesh)
    for side in ("grains", "solid"):
        write_deck(case, f"{name}_{side}.nml", f"{side}.nml", name=name, pair=pair)
    case.run("talus-couple", write_deck(case, f"{name}.nml", "coupled.nml", name=name, pair=pair))
    half, end = (s.solid for s in field_steps(case.folder / f"{name}_solid.h5")[-2:])
    x = read_mesh(case.folder / f"{name}.h5").x
    u, phi = (end["u"] - half["u"])[:, 0], (end["phi"] - half["phi"])[:, 2]
    corner = np.isclose(x[:, 0] % WIDTH, 0) & np.isclose(x[:, 2] % WIDTH, 0)
    corner &= np.isclose(x[:, 1] / H * layers, np.rint(x[:, 1] / H * layers))
    wanted_u, wanted_phi = exact.at(x[:, 1])
    why = "elements of c/4, linear ones c/8"
    scale = abs(wanted_u).max()
    case.below(f"{pair}: displacement", abs(u - wanted_u)[corner].max() / scale, limit, why)
    scale = abs(wanted_phi).max()
    case.below(f"{pair}: micro-rotation", abs(phi - wanted_phi)[corner].max() / scale, limit, why)
    quat = [s.grains["quat"] for s in field_steps(case.folder / f"{name}_grains.h5")[-2:]]
    turn = 2.0 * (quat[1][:4, 3] - quat[0][:4, 3])
    face = phi[corner & np.isclose(x[:, 1], H)].mean()
    case.below(f"{pair}: rotation of ghosts off the face's", abs(turn / face - 1).max(), 1e-8)
    audit = audit_of(case, name)
    middle = len(audit["time"]) // 2 - 1
    for label, column, wanted in (
        ("force", "force_on_solid_x", exact.force),
        ("moment", "moment_on_solid_z", exact.moment),
    ):
        found = audit[column][-1] - audit[column][middle]
        case.metric(f"{pair}: {label} / exact", found / wanted, 1.0, 5e-4)
    works = audit["interface_work_on_grains"] + audit["interface_work_on_solid"]
    turnover = np.abs(np.diff(audit["interface_work_on_grains"])).sum()
    case.below(f"{pair}: works at the interface", np.abs(works).max() / turnover, 1e-10)
    order = np.argsort(x[corner, 1])
    return phi[corner][order], x[corner, 1][order]


def write_grains(case: Case) -> None:
    """Ghosts at the Gauss points of the face, a grain over each: equal forces keep it even."""
    near, far = WIDTH * (0.5 - 0.5 / np.sqrt(3.0)), WIDTH * (0.5 + 0.5 / np.sqrt(3.0))
    ghosts = np.array([[a, H, b] for a in (near, far) for b in (near, far)])
    heavy = ghosts + [0.0, 2 * RADIUS - OVERLAP, 0.0]
    write_packing(
        case.folder / "pack.h5",
        np.vstack([ghosts, heavy]),
        np.full((8, 3), RADIUS),
        kind=np.repeat([1, 0], 4),
        v=np.repeat([[0.0, 0.0, 0.0], [SPEED, 0.0, 0.0]], 4, axis=0),
        groups={"ghosts": np.arange(1, 5)},
    )
