"""Corner displacement of a cube under oblique gravity, other codes' figures."""

import numpy as np

from talus import mesh as meshes
from talus.verification import Case, field_steps

OTHERS = np.array([3.232744e-7, 2.153866e-9, -2.646318e-7])
FINE = np.array([3.276303e-7, 1.350232e-9, -2.659191e-7])  # hex27 20^3


def run(case: Case) -> None:
    """Judge three components; plot the approach to the quadratic element's value."""
    found = {}
    for element in ("hex8_full", "hex8_bbar"):
        for n in (5, 10, 20):
            mesh = meshes.box(np.zeros(3), np.ones(3), (n, n, n))
            meshes.write_mesh(case.folder / "cube.h5", mesh)
            name = f"{element}_{n}.nml"
            (case.folder / name).write_text(
                (case.folder / "deck.nml").read_text().replace("hex8_full", element)
            )
            case.run("talus-fem", name)
            u = field_steps(case.folder / name.replace(".nml", ".h5"))[-1].solid["u"]
            found[element, n] = u[np.linalg.norm(mesh.x - 1.0, axis=1) < 1e-9][0]
    for k, letter in enumerate("xyz"):
        case.metric(
            f"u_{letter} of the corner / others",
            float(found["hex8_full", 10][k] / OTHERS[k]),
            1.0,
            1e-6,
            "seven digits are printed",
        )
    near = np.abs(found["hex8_bbar", 20][[0, 2]] / FINE[[0, 2]] - 1).max()
    case.below("hex8_bbar 20^3 against hex27 20^3, u_x and u_z", float(near), 0.01)
    fig, ax = case.figure()
    for element in ("hex8_full", "hex8_bbar"):
        values = [found[element, n][0] * 1e7 for n in (5, 10, 20)]
        ax.plot([5, 10, 20], values, "o-", label=element)
    ax.axhline(FINE[0] * 1e7, color="k", lw=1, label="hex27 20$^3$, another code")
    ax.set(xlabel="elements along an edge [-]", ylabel="u$_x$ of the corner [1e-7 m]")
    ax.legend()
    case.save(fig)
