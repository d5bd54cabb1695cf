"""Stress concentration factors against the closed form."""

import numpy as np
from solid import MATERIAL, save

from talus.mesh import Mesh, boundary_faces, structured
from talus.orders import converted
from talus.verification import Case, field_steps

TABLE = {
    1.0: 2.39123605187,
    2.0: 2.60162851517,
    3.0: 2.73321424868,
    5.0: 2.86316753707,
    10.0: 2.95550906783,
}
POISSON, WIDTH, ANGLES, RATIO = 0.3, 40.0, 24, 1.16


def bessel_ratio(z: float) -> float:
    """K0(z)/K1(z) by the integral of exp(-z cosh t) cosh(n t)."""
    t = np.linspace(0.0, 12.0, 4001)
    e = np.exp(-z * (np.cosh(t) - 1))
    return float(np.trapezoid(e, t) / np.trapezoid(e * np.cosh(t), t))


def closed_form(ratio: float) -> float:
    """Kt for N^2 = 1/2 and a/c = ratio."""
    f = 8 * (1 - POISSON) * 0.5 / (4 + ratio**2 + 2 * ratio * bessel_ratio(ratio))
    return (3 + f) / (1 + f)


def plate() -> Mesh:
    """Quarter plate of hex20 between the hole and a square, graded towards the hole."""
    rows = [0.0]
    while rows[-1] < 1.0:
        rows.append(rows[-1] + 0.03 / WIDTH * RATIO ** (len(rows) - 1))
    radial = np.array(rows) / rows[-1]
    s, hex8 = structured((radial, np.linspace(0.0, 1.0, ANGLES + 1), np.array([0.0, 0.2])))
    angle = s[:, 1] * np.pi / 2
    direction = np.column_stack([np.cos(angle), np.sin(angle)])
    reach = WIDTH / np.abs(direction).max(axis=1)
    x = np.column_stack([direction * (1 + s[:, :1] * (reach[:, None] - 1)), s[:, 2]])
    mesh = Mesh(x, hex8, {"all": np.arange(len(hex8))})
    far = [q for _, q in boundary_faces(hex8).values() if np.isclose(x[q][:, 0], WIDTH).all()]
    mesh.facets["far"] = np.array(far)
    mesh = converted(mesh, "hex20")
    radius = np.linalg.norm(mesh.x[:, :2], axis=1)
    hole = radius < 1 + 1e-6
    mesh.x[hole, :2] /= radius[hole, None]
    mesh.nodes["x0"] = np.flatnonzero(np.isclose(mesh.x[:, 0], 0.0, atol=1e-9))
    mesh.nodes["y0"] = np.flatnonzero(np.isclose(mesh.x[:, 1], 0.0, atol=1e-9))
    return mesh


def run(case: Case) -> None:
    """Judge five ratios; plot the factor."""
    mesh = plate()
    save(mesh, case.folder / "plate.h5")
    top = np.flatnonzero(np.isclose(mesh.x[:, 0], 0.0, atol=1e-9) & np.isclose(mesh.x[:, 1], 1.0))
    found = {}
    for ratio, exact in TABLE.items():
        kappa = 1.0
        moduli = (
            0.75 * kappa,
            0.0,
            kappa,
            0.0,
            0.0,
            kappa / ratio**2,
        )  # mu = 0: N^2 = 1/2, nu = 0.3
        text = (case.folder / "deck.nml").read_text().replace("MATERIAL", MATERIAL.format(*moduli))
        name = f"ratio_{ratio:.0f}"
        (case.folder / f"{name}.nml").write_text(text)
        case.run("talus-fem", f"{name}.nml")
        stress = field_steps(case.folder / f"{name}.h5")[-1].solid["stress_nodal"]
        found[ratio] = float(stress[top, 0].mean())
        case.metric(f"a/c = {ratio}: Kt / exact", found[ratio] / exact, 1.0, 1e-2)
        case.metric(f"a/c = {ratio}: closed form / table", closed_form(ratio) / exact, 1.0, 1e-6)
    fig, ax = case.figure()
    grid = np.geomspace(0.5, 20.0, 80)
    ax.semilogx(grid, [closed_form(g) for g in grid], "k-", lw=1, label="closed form")
    ax.semilogx(list(found), list(found.values()), "o", label="Talus")
    ax.axhline(3.0, color="0.6", lw=1, ls=":")
    ax.set(xlabel="radius / characteristic length a/c [-]", ylabel="stress concentration [-]")
    ax.legend()
    case.save(fig)
