"""The same systems by both solvers."""

import json
import re

import numpy as np
from solid import MATERIAL, distorted_cube, save, shape_of

from talus.mesh import boundary_faces
from talus.verification import Case, field_steps

ELEMENTS = ("hex8_bbar", "hex8_full", "hex20", "hex27", "tet4", "tet10", "wedge6", "hex8/hex8",
            "hex20/hex8", "tet10/tet4")  # fmt: skip
POLAR = (1.0e9, 1.0e9, 0.5e9, 1.0e6, 0.5e6, 2.0e6)


def solve(case: Case, name: str, element: str, material: str, solver: str) -> np.ndarray:
    """Run one deck; return u."""
    fix = "'x', 'y', 'z'" + (", 'rx', 'ry', 'rz'" if "/" in element else "")
    text = (case.folder / "deck.nml").read_text().replace("ELEMENT", element)
    text = text.replace("MATERIAL", material).replace("FIX", fix)
    analysis = f"kind = 'static', solver = '{solver}'"
    if solver == "disk":
        analysis = "kind = 'static', solver = 'direct', factors = 'disk'"
    if solver == "relaxation":
        analysis = "kind = 'relaxation', tolerance = 1.0e-9"
    text = text.replace("SOLVER", analysis)
    (case.folder / f"{name}_{solver}.nml").write_text(text)
    case.run("talus-fem", f"{name}_{solver}.nml")
    return field_steps(case.folder / f"{name}_{solver}.h5")[-1].solid["u"]


def run(case: Case) -> None:
    """Judge all formulations; plot iterations."""
    counts = {}
    variants = [(e, 0.3) for e in ELEMENTS] + [("hex8_bbar", 0.4999)]
    for element, poisson in variants:
        mesh = distorted_cube(4, shape_of(element))
        mesh.nodes["base"] = np.flatnonzero(mesh.x[:, 2] < 1e-9)
        top = [nodes for _, nodes in boundary_faces(mesh.cells).values()
               if (mesh.x[nodes][:, 2] > 1 - 1e-9).all()]  # fmt: skip
        mesh.facets["top"] = np.array(top)
        save(mesh, case.folder / "cube.h5")
        material = f"density = 2000.0, young = 2.0e9, poisson = {poisson!r}"
        if "/" in element:
            material = MATERIAL.format(*POLAR).replace("density = 1.0", "density = 2000.0")
        name = element.replace("/", "_") + f"_{poisson}"
        direct = solve(case, name, element, material, "direct")
        found = solve(case, name, element, material, "iterative")
        off = float(abs(found - direct).max() / abs(direct).max())
        case.below(f"{element}, nu = {poisson}: difference / largest", off, 1e-8)
        found = solve(case, name, element, material, "multigrid")
        off = float(abs(found - direct).max() / abs(direct).max())
        case.below(f"{element}, nu = {poisson}: multigrid, difference / largest", off, 1e-8)
        for solver in ("direct", "iterative", "multigrid"):
            summary = json.loads((case.folder / f"{name}_{solver}_summary.json").read_text())
            left = summary["health"]["residual"]
            case.below(f"{element}, nu = {poisson}: residual, {solver}", left, 1e-8)
        if element in ("hex8_bbar", "tet10", "hex20/hex8") and poisson < 0.4:
            found = solve(case, name, element, material, "relaxation")
            off = float(abs(found - direct).max() / abs(direct).max())
            case.below(f"{element}: relaxation, difference / largest", off, 1e-6)
            found = solve(case, name, element, material, "disk")
            off = float(abs(found - direct).max() / abs(direct).max())
            case.below(f"{element}: factors on disk, difference / largest", off, 1e-12)
        log = (case.folder / f"{name}_iterative.log").read_text()
        counts[name] = int(re.search(r"iterations\s+(\d+)\s+residual", log)[1])
    fig, ax = case.figure()
    ax.barh(list(counts), list(counts.values()), color="0.6")
    ax.set(xlabel="iterations [-]", ylabel="element, Poisson's ratio [-]")
    case.save(fig)
