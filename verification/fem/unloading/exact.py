"""Nonlinear statics down to no load at all."""

import h5py
import numpy as np

from talus.mesh import Mesh, structured, write_mesh
from talus.verification import Case

YOUNG, FORCE = 1.0e6, 2.0e5  # Pa, N on a face of 1 m^2
TOLERANCE = 1.0e-8  # of the residual, of the largest load of the run
TINY = 1.0e-8  # of the load, in the first step
LAWS = {
    "neo-Hookean": ("law = 'neo_hookean'", 1.0),
    "Drucker-Prager": (
        "law = 'drucker_prager', cohesion = 5.0e4, friction_deg = 20.0, hardening = 2.0e5",
        -1.0,
    ),
}


def heights(case: Case, law: str, middle: float, last: float) -> tuple[np.ndarray, np.ndarray]:
    """Return times and the displacement of the top [m]."""
    words, sense = LAWS[law]
    name = f"{law[:3].lower()}_{'tiny' if middle < 1.0 else 'off'}"
    loads = "\n".join(
        f"&point_load node = {node}, force = 0.0, 0.0, {sense * FORCE / 4}, curve = 'load' /"
        for node in (5, 6, 7, 8)
    )
    text = (case.folder / "deck.nml").read_text()
    for key, value in (("LAW", words), ("MIDDLE", middle), ("LAST", last), ("LOADS", loads)):
        text = text.replace(key, str(value))
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")
    with h5py.File(case.folder / f"{name}.h5") as file:
        steps = [file["steps"][key] for key in sorted(file["steps"])]
        return (
            np.array([step.attrs["time"] for step in steps]),
            np.array([step["u"][4:, 2].mean() for step in steps]),
        )


def run(case: Case) -> None:
    """Judge the way back to zero and the first small step; plot both laws."""
    line = np.array([0.0, 1.0])
    x, hex8 = structured((line, line, line))
    mesh = Mesh(x, hex8, {"all": np.arange(1)})
    for k, axis in enumerate("xyz"):
        mesh.nodes[f"{axis}0"] = np.flatnonzero(x[:, k] < 0.5)
    write_mesh(case.folder / "cube.h5", mesh)

    fig, ax = case.figure()
    for law, mark in (("neo-Hookean", "o"), ("Drucker-Prager", "s")):
        time, height = heights(case, law, 1.0, 0.0)
        top, end = height[np.argmax(time >= 1.0)], height[-1]
        if law == "neo-Hookean":
            case.below(f"{law}: what is left over the largest", abs(end / top), 2.0 * TOLERANCE)
        else:
            elastic = -FORCE / YOUNG
            case.metric(f"{law}: comes back by F L/(E A) [m]", top - end, elastic, 1.0e-7)
            case.above(f"{law}: plastic part that stays [m]", -end, 0.01)
        load = np.interp(time, [0.0, 1.0, 2.0], [0.0, FORCE / 1e3, 0.0])
        ax.plot(100 * height, load, f"-{mark}", mfc="none", label=law)
        time, height = heights(case, law, TINY, 1.0)
        first = height[np.argmax(time >= 1.0)] / TINY
        linear = LAWS[law][1] * FORCE / YOUNG
        case.metric(f"{law}: at 1e-8 of the load, over it [m]", first, linear, 1.0e-6)
    ax.set(xlabel="displacement of the top [cm]", ylabel="load [kN]")
    ax.legend()
    case.save(fig)
