"""Linear displacement, constant micro-rotation: fields and stresses must be exact."""

import numpy as np
from solid import MATERIAL, distorted_cube, outer_nodes, polar_nodes, prescribe, save, shape_of

from talus.verification import Case, field_steps

A = np.array([[1e-3, 3e-4, -2e-4], [5e-4, -7e-4, 4e-4], [-6e-4, 1e-4, 8e-4]])
MODULI = (1.0e9, 1.0e9, 0.5e9, 1.0e3, 0.5e3, 2.0e3)
YOUNG, POISSON = 2.5e9, 0.25  # lambda = mu = 1e9
STATES = {
    "i": (
        [-1.5e-4, 2e-4, 1e-4],
        [[3.6e6, 1e6, -1e6], [1e6, -6.5e5, 6.25e5], [-1e6, 6.25e5, 3.1e6]],
        [0.0, 0.0, 0.0],
    ),
    "ii": (
        [2e-4, -5e-4, 7e-4],
        [[3.6e6, 7e5, -1.35e6], [1.3e6, -6.5e5, 4.5e5], [-6.5e5, 8e5, 3.1e6]],
        [3.5e5, -7e5, 6e5],
    ),
}
PAIRS = ("hex8/hex8", "hex20/hex8", "hex27/hex8", "hex20/hex20", "tet4/tet4", "tet10/tet4")
CLASSICAL = ("hex8_bbar", "hex8_full", "hex8_incompatible", "hex8_one_point", "hex20", "hex27",
             "tet4", "tet10", "wedge6")  # fmt: skip


def errors_of(case: Case, element: str, state: str) -> tuple[float, float, float]:
    """Run one patch; relative errors of displacement, micro-rotation and stress."""
    turn, stress, couple = STATES[state]
    mesh = distorted_cube(2 if shape_of(element) in ("hex20", "hex27") else 3, shape_of(element))
    u = mesh.x @ A.T
    phi = np.tile(turn, (len(u), 1))
    polar = polar_nodes(mesh, element)
    material = MATERIAL.format(*MODULI)
    if len(polar) == 0:
        material = f"density = 1.0, young = {YOUNG!r}, poisson = {POISSON!r}"
    text = (case.folder / "deck.nml").read_text().replace("ELEMENT", element)
    text = text.replace("MATERIAL", material) + prescribe(mesh, outer_nodes(mesh), u, phi, polar)
    if state == "ii":
        text += f"&body_load group = 'all', couple = {', '.join(repr(c) for c in couple)} /\n"
    save(mesh, case.folder / "patch.h5")
    name = element.replace("/", "_") + "_" + state
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")
    last = field_steps(case.folder / f"{name}.h5")[-1].solid
    found = last["stress_points"]
    wanted = np.ravel(stress)
    turned = 0.0
    if len(polar) == 0:
        strain = 0.5 * (A + A.T)
        wanted = 1e9 * (np.trace(strain) * np.eye(3) + 2 * strain)
        wanted = wanted[[0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]]
    else:
        turned = float(np.abs(last["phi"] - phi).max() / np.abs(phi).max())
    off = float(np.abs(found - wanted).max() / np.abs(wanted).max())
    return float(np.abs(last["u"] - u).max() / np.abs(u).max()), turned, off


def run(case: Case) -> None:
    """Judge every element; plot the largest error of the stress."""
    marks = {}
    for element in PAIRS:
        for state in STATES:
            u, phi, stress = errors_of(case, element, state)
            case.below(f"{element} ({state}): displacement", u, 1e-11)
            case.below(f"{element} ({state}): micro-rotation", phi, 1e-9)
            case.below(f"{element} ({state}): stress at every point", stress, 1e-9)
            marks[f"{element} {state}"] = stress
    for element in CLASSICAL:
        u, _, stress = errors_of(case, element, "i")
        case.below(f"{element}: displacement", u, 1e-11)
        case.below(f"{element}: stress at every point", stress, 1e-10)
        marks[element] = stress
    fig, ax = case.figure()
    ax.barh(list(marks), [max(v, 1e-17) for v in marks.values()], color="0.6")
    ax.set(
        xscale="log",
        xlabel="largest error of the stress / largest stress [-]",
        ylabel="element [-]",
    )
    case.save(fig)
