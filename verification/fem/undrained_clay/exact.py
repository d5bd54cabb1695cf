"""Undrained triaxial compression of Cam-clay whose pores are full, against the closed form."""

import numpy as np

from talus import mesh as meshes
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

M, LAMBDA, KAPPA, P0 = 1.2, 0.2, 0.05, 1.0e5
CAP = 1 - KAPPA / LAMBDA


def pressure(eta: np.ndarray) -> np.ndarray:
    """Mean effective stress of the path from isotropic normal consolidation [Pa]."""
    return P0 * (1 + eta**2 / M**2) ** -CAP


def judge(case: Case, element: str, n: int, ax: object) -> None:
    """Judge effective path, pore pressure, volume and iterations."""
    kind = element.split("_")[0]
    mesh = converted(meshes.box(np.zeros(3), np.ones(3), (n, n, n)), kind)
    meshes.write_mesh(case.folder / f"{kind}.h5", mesh)
    text = (case.folder / "deck.nml").read_text()
    for key, value in (("MESH", kind), ("ELEMENT", element), ("STEP", "0.005")):
        text = text.replace(key, value)
    (case.folder / f"run_{kind}.nml").write_text(text)
    case.run("talus-fem", f"run_{kind}.nml")
    steps = field_steps(case.folder / f"run_{kind}.h5")[1:]
    stress = np.array([s.solid["stress"].mean(axis=0) for s in steps])
    p, q = -stress[:, :3].mean(axis=1), stress[:, 0] - stress[:, 2]
    off = float(np.abs(p / pressure(q / p) - 1).max())
    case.below(f"{element}: effective path, error", off, 1e-4)
    case.metric(f"{element}: p at the end / critical", float(p[-1] / (P0 * 2**-CAP)), 1.0, 5e-3)
    pore = np.array([s.solid["pore_pressure"] for s in steps])
    wanted = (P0 + q / 3 - p)[:, None]
    off = float(np.abs(pore - wanted).max() / P0)
    case.below(f"{element}: pore pressure, error / p0", off, 1e-6)
    table = read_history(case.folder / f"run_{kind}_pore.csv")
    case.below(f"{element}: change of volume", float(np.abs(table["content"]).max()), 1e-12)
    newton = read_history(case.folder / f"run_{kind}_newton.csv")
    case.below(f"{element}: most iterations of a step", float(newton["iteration"].max()), 6.0)
    ax.plot(p / 1e3, q / 1e3, "o" if kind == "hex20" else "x", ms=4, mfc="none", label=element)
    ax.plot((P0 + q / 3) / 1e3, q / 1e3, ":", lw=1)


def run(case: Case) -> None:
    """Judge cubes of quadratic and of stabilised linear elements; plot the paths."""
    fig, ax = case.figure()
    judge(case, "hex20", 1, ax)
    judge(case, "hex8_bbar", 2, ax)
    eta = np.linspace(0.0, M, 200)
    ax.plot(pressure(eta) / 1e3, eta * pressure(eta) / 1e3, "k-", lw=1, label="exact")
    ax.set(xlabel="mean stress [kPa], dotted: total", ylabel="deviatoric stress q [kPa]")
    ax.legend()
    case.save(fig)
