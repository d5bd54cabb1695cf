"""Cantilever 10 x 1 x 1 with an end load, nu = 0: beam theory with shear."""

import numpy as np

from talus import mesh as meshes
from talus.verification import Case, field_steps

LENGTH, DEPTH, YOUNG, LOAD = 10.0, 1.0, 1.0e7, 1.0
SHEAR = 10.0 / 12.0
EXACT = LOAD * LENGTH**3 / (3 * YOUNG / 12.0) + LOAD * LENGTH / (SHEAR * YOUNG / 2.0)


def tip(case: Case, n: int) -> float:
    """Mean deflection of the end face with n elements over the depth."""
    mesh = meshes.box(np.zeros(3), np.array([LENGTH, DEPTH, DEPTH]), (10 * n, 1, n))
    meshes.write_mesh(case.folder / "beam.h5", mesh)
    case.run("talus-fem", "deck.nml")
    u = field_steps(case.folder / "deck.h5")[-1].solid["u"]
    return float(u[mesh.x[:, 0] > LENGTH - 1e-9, 2].mean())


def run(case: Case) -> None:
    """Judge value and order; plot convergence."""
    sizes = [2, 4, 8, 16]
    found = np.array([tip(case, n) for n in sizes])
    case.metric("deflection with 16 elements / beam", found[-1] / EXACT, 1.0, 5e-3)
    order = np.log2((EXACT - found[0]) / (EXACT - found[2])) / 2
    case.metric("observed order", float(order), 2.0, 0.15)
    fig, ax = case.figure()
    ax.loglog(sizes, np.abs(found / EXACT - 1), "o-", label="hex8_bbar")
    ax.loglog(sizes, 0.6 / np.array(sizes, float) ** 2, "k-", lw=1, label="second order")
    ax.set(xlabel="elements over the depth [-]", ylabel="relative error of the deflection [-]")
    ax.legend()
    case.save(fig)
