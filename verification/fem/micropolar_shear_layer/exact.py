"""Shear of a micropolar layer: fields across it, apparent stiffness, order."""

import numpy as np

from talus.mesh import structured
from talus.verification import Case, field_steps, read_history, write_hex_mesh

MU, KAPPA, GAMMA, H, U = 1.0, 1.0, 0.02, 1.0, 0.01
SHEAR = MU + KAPPA / 2
C = np.sqrt(GAMMA * (MU + KAPPA) / (KAPPA * (2 * MU + KAPPA)))
# phi'' = (phi - phi_0)/c^2 between phi = 0 faces; tau from the displacement of the faces
PART = 1.0 - KAPPA / (MU + KAPPA) * C / H * np.tanh(H / (2 * C))
TAU = SHEAR * U / H / PART


def phi(y: np.ndarray) -> np.ndarray:
    """Micro-rotation about z."""
    return -TAU / (2 * MU + KAPPA) * (1.0 - np.cosh(y / C) / np.cosh(H / (2 * C)))


def slope(y: np.ndarray) -> np.ndarray:
    """Its derivative."""
    return TAU / (2 * MU + KAPPA) * np.sinh(y / C) / (C * np.cosh(H / (2 * C)))


def displacement(y: np.ndarray) -> np.ndarray:
    """u_x: tau = (mu + kappa) u' + kappa phi."""
    wave = C * np.sinh(y / C) / np.cosh(H / (2 * C))
    return TAU / (MU + KAPPA) * (y + KAPPA / (2 * MU + KAPPA) * (y - wave))


def solve(case: Case, n: int) -> dict:
    """Run n elements across the layer; return the last fields and reactions."""
    line = np.array([0.0, 0.1])
    x, hex8 = structured((line, np.linspace(-0.5, 0.5, n + 1), line))
    nodes = {
        "bottom": np.flatnonzero(np.isclose(x[:, 1], -0.5)),
        "top": np.flatnonzero(np.isclose(x[:, 1], 0.5)),
        "faces": np.flatnonzero(np.isclose(abs(x[:, 1]), 0.5)),
    }
    write_hex_mesh(case.folder / "layer.h5", x, hex8, nodes=nodes)
    name = f"layer_{n}"
    (case.folder / f"{name}.nml").write_text((case.folder / "deck.nml").read_text())
    case.run("talus-fem", f"{name}.nml")
    fields = field_steps(case.folder / f"{name}.h5")[-1].solid
    reactions = read_history(case.folder / f"{name}_reactions.csv")
    return fields | {"y": x[:, 1], "tau": reactions["top x"][-1] / 0.01, "n": n}


def run(case: Case) -> None:
    """Judge the finest mesh and the order; plot the micro-rotation."""
    runs = [solve(case, n) for n in (22, 44, 88)]
    fine = runs[-1]
    case.metric("apparent modulus / exact", float(fine["tau"] * H / U / (TAU * H / U)), 1.0, 1e-3)
    case.metric(
        "apparent modulus / that of the reference",
        float(fine["tau"] * H / U) / 1.59187509461,
        1.0,
        1e-3,
    )
    for name, found, wanted in (
        ("displacement", fine["u"][:, 0], displacement(fine["y"])),
        ("micro-rotation", fine["phi"][:, 2], phi(fine["y"])),
    ):
        case.below(
            f"{name}, error / largest", float(abs(found - wanted).max() / abs(wanted).max()), 1e-3
        )
    y = 0.5 * (np.unique(fine["y"])[1:] + np.unique(fine["y"])[:-1])
    m = fine["couple_stress"][:, 5]
    wanted = GAMMA * slope(y)
    case.below(
        "m_yz of the elements, error / largest",
        float(abs(m - wanted).max() / abs(wanted).max()),
        1e-3,
    )
    case.metric(
        "sigma_yx at the middle / exact", float(np.mean(fine["stress"][:, 3])) / TAU, 1.0, 1e-3
    )
    middle = abs(fine["points_x"][:, 1]).argmin()
    found = float(fine["stress_points"][middle, 1])
    case.metric("sigma_xy at the middle / reference", found / 0.015709202983, 1.0, 1e-3)
    errors = [float(abs(r["u"][:, 0] - displacement(r["y"])).max()) for r in runs]
    case.metric("observed order", float(np.log2(errors[0] / errors[2]) / 2), 2.0, 0.2)
    fig, ax = case.figure()
    grid = np.linspace(-0.5, 0.5, 401)
    ax.plot(phi(grid) * 1e3, grid, "k-", lw=1, label="exact")
    for r in runs[:1]:
        ax.plot(r["phi"][:, 2] * 1e3, r["y"], "o", ms=4, label=f"Talus, {r['n']} elements")
    ax.set(xlabel="micro-rotation [mrad]", ylabel="y [m]")
    ax.legend()
    case.save(fig)
