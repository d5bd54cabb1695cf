"""Uniform stress, layers and a yielding body by multigrid."""

import json
import re

import numpy as np
from solid import distorted_cube, save

from talus.mesh import Mesh, boundary_faces
from talus.verification import Case, field_steps

STRESS, YOUNG, POISSON = 1.0e3, 1.0e6, 0.3
STIFF = 1.0e10
SIZES = (10, 20)


def give_groups(mesh: Mesh) -> None:
    """Name the nodes of three faces and the facets of the top."""
    for axis, name in enumerate(("x0", "y0", "z0")):
        mesh.nodes[name] = np.flatnonzero(mesh.x[:, axis] < 1e-9)
    mesh.nodes["edge"] = np.flatnonzero((mesh.x[:, 2] > 1 - 1e-9) & (mesh.x[:, 0] < 0.5))
    faces = [nodes for _, nodes in boundary_faces(mesh.cells).values()]
    mesh.facets["top"] = np.array([q for q in faces if (mesh.x[q][:, 2] > 1 - 1e-9).all()])


def iterations(case: Case, name: str) -> list[int]:
    """Iterations of every step."""
    text = (case.folder / f"{name}.log").read_text()
    return [int(n) for n in re.findall(r"iterations\s+(\d+)\s+residual", text)]


def uniform(case: Case) -> list[int]:
    """Judge the displacement of distorted cubes; return the iterations of each."""
    counts = []
    for n in SIZES:
        mesh = distorted_cube(n, "hex8")
        give_groups(mesh)
        save(mesh, case.folder / f"cube{n}.h5")
        text = (case.folder / "deck.nml").read_text().replace("MESH", f"cube{n}")
        (case.folder / f"uniform{n}.nml").write_text(text)
        case.run("talus-fem", f"uniform{n}.nml")
        last = field_steps(case.folder / f"uniform{n}.h5")[-1].solid
        exact = STRESS / YOUNG * mesh.x * [-POISSON, -POISSON, 1.0]
        error = np.abs(last["u"] - exact).max() / np.abs(exact).max()
        case.below(f"{n}^3: displacement error / largest", float(error), 1e-8)
        counts += iterations(case, f"uniform{n}")
    case.below("iterations of 20^3 over those of 10^3", counts[1] / counts[0], 1.5)
    return counts


def layers(case: Case) -> None:
    """Judge a soft layer below a stiff one."""
    mesh = distorted_cube(8, "hex8", amount=0.0)
    give_groups(mesh)
    middle = mesh.x[mesh.cells["hex8"]].mean(axis=1)[:, 2]
    mesh.volumes = {"lower": np.flatnonzero(middle < 0.5), "upper": np.flatnonzero(middle > 0.5)}
    save(mesh, case.folder / "strata.h5")
    case.run("talus-fem", "layers.nml")
    u = field_steps(case.folder / "layers.h5")[-1].solid["u"]
    z = mesh.x[:, 2]
    exact = STRESS * (np.minimum(z, 0.5) / YOUNG + np.maximum(z - 0.5, 0.0) / STIFF)
    error = max(np.abs(u[:, 2] - exact).max(), np.abs(u[:, :2]).max()) / exact.max()
    case.below("layers: displacement error / largest", float(error), 1e-6)


def yielding(case: Case) -> None:
    """Judge a yielding body by that of factors."""
    mesh = distorted_cube(8, "hex8")
    give_groups(mesh)
    save(mesh, case.folder / "cube.h5")
    found, tangents = {}, {}
    for solver in ("direct", "multigrid"):
        text = (case.folder / "yielding.nml").read_text().replace("SOLVER", solver)
        (case.folder / f"yielding_{solver}.nml").write_text(text)
        case.run("talus-fem", f"yielding_{solver}.nml")
        found[solver] = field_steps(case.folder / f"yielding_{solver}.h5")[-1].solid["u"]
        summary = json.loads((case.folder / f"yielding_{solver}_summary.json").read_text())
        tangents[solver] = summary["health"]["factorisations"]
    error = np.abs(found["multigrid"] - found["direct"]).max() / np.abs(found["direct"]).max()
    case.below("yielding: difference to factors / largest", float(error), 1e-7)
    more = tangents["multigrid"] - tangents["direct"]
    case.below("yielding: tangents more than with factors", float(abs(more)), 1.0)


def run(case: Case) -> None:
    """Judge all three; plot the iterations."""
    counts = uniform(case)
    layers(case)
    yielding(case)
    fig, ax = case.figure()
    ax.plot([n**3 for n in SIZES], counts, "o", ms=4, label="multigrid")
    ax.plot([n**3 for n in SIZES], [counts[0] * n / SIZES[0] for n in SIZES], "-", color="0.6",
            label="as the levels of elements")  # fmt: skip
    ax.set(xlabel="elements [-]", ylabel="iterations [-]", xscale="log")
    ax.set_ylim(bottom=0.0)
    ax.legend()
    case.save(fig)
