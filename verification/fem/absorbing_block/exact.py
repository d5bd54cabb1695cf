"""Velocity of a stiff block on dashpots against its exponential decay."""

import numpy as np
from solid import save

from talus.mesh import Mesh, boundary_faces, structured
from talus.verification import Case, field_steps, read_history

YOUNG, POISSON, SOFT, STIFF, LAYER, SPEED = 1.0e8, 0.25, 1000.0, 2000.0, 1.0e-3, 0.5
SHEAR = YOUNG / (2 * (1 + POISSON))
WAVE = {
    "z": np.sqrt(YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON)) / SOFT),
    "x": np.sqrt(SHEAR / SOFT),
}
KINDS = {
    "newmark": "kind = 'newmark', dt = 1.0e-4",
    "hht": "kind = 'hht', dt = 1.0e-4, alpha = -0.05",
}


def block() -> Mesh:
    """A layer of 1 mm under a block of 1 m, area 1 m2."""
    x, hex8 = structured((np.array([0.0, 1.0]), np.array([0.0, 1.0]), np.array([0.0, LAYER, 1.0])))
    mesh = Mesh(x, hex8, {"all": np.arange(2), "layer": np.array([0]), "block": np.array([1])})
    mesh.facets["z0"] = np.array(
        [q for _, q in boundary_faces(hex8).values() if (x[q][:, 2] < 1e-9).all()]
    )
    return mesh


def run(case: Case) -> None:
    """Judge the decay and the ledger of both directions; plot the velocities."""
    save(block(), case.folder / "block.h5")
    mass = SOFT * LAYER + STIFF * (1.0 - LAYER)
    fig, ax = case.figure()
    for axis, wave in WAVE.items():
        for kind, analysis in KINDS.items():
            text = (case.folder / "deck.nml").read_text().replace("ANALYSIS", analysis)
            text = text.replace("AXIS", axis)
            text = text.replace("ACROSS", ", ".join(f"'{c}'" for c in "xyz" if c != axis))
            name = f"{axis}_{kind}"
            (case.folder / f"{name}.nml").write_text(text)
            case.run("talus-fem", f"{name}.nml")
            steps = field_steps(case.folder / f"{name}.h5")
            t = np.array([s.time for s in steps])
            v = np.array([s.solid["v"][-1, "xyz".index(axis)] for s in steps])
            exact = SPEED * np.exp(-SOFT * wave * t / mass)
            off = float(abs(v - exact).max() / SPEED)
            case.below(f"{axis}, {kind}: velocity, error / at the start", off, 0.005)
            energy = read_history(case.folder / f"{name}_energy.csv")
            start = float(energy["kinetic"][0])
            case.below(
                f"{axis}, {kind}: ledger, error / energy at the start",
                float(abs(energy["closure"]).max() / start), 1e-9,
            )  # fmt: skip
            case.metric(
                f"{axis}, {kind}: absorbed / lost", float(
                    energy["damping"][-1] / (start - energy["kinetic"][-1])), 1.0, 0.005,
            )  # fmt: skip
            if kind == "newmark":
                ax.plot(t * 1e3, exact, "-", label=f"along {axis}, exact")
                ax.plot(t[::5] * 1e3, v[::5], "o", ms=4, label=f"along {axis}, Talus")
    ax.set(xlabel="time [ms]", ylabel="velocity [m/s]")
    ax.legend()
    case.save(fig)
