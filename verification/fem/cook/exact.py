"""Cook's membrane as a slice one element thick."""

import numpy as np

from talus.mesh import boundary_faces, structured
from talus.verification import Case, field_steps, write_hex_mesh

EXACT = 21.5902


def compliance(case: Case, n: int, element: str, poisson: float) -> float:
    """Mean vertical displacement of the loaded edge on an n x n mesh."""
    s = np.linspace(0.0, 1.0, n + 1)
    x, hex8 = structured((s, s, np.array([0.0, 1.0])))
    bottom, top = 44.0 * x[:, 0], 44.0 + 16.0 * x[:, 0]
    x = np.column_stack([48.0 * x[:, 0], bottom + (top - bottom) * x[:, 1], x[:, 2]])
    right = np.isclose(x[:, 0], 48.0)
    facets = np.array([q for _, q in boundary_faces(hex8).values() if right[q].all()])
    groups = {"left": np.flatnonzero(np.isclose(x[:, 0], 0.0))}
    write_hex_mesh(case.folder / "cook.h5", x, hex8, facets={"right": facets}, nodes=groups)
    deck = (case.folder / "deck.nml").read_text()
    name = f"cook_{n}_{element}_{poisson:.4f}.nml"
    text = deck.replace("hex8_bbar", element).replace("0.333333333333", str(poisson))
    (case.folder / name).write_text(text)
    case.run("talus-fem", name)
    u = field_steps(case.folder / name.replace(".nml", ".h5"))[-1].solid["u"]
    weight = np.zeros(len(x))
    for quad in facets:
        weight[quad] += np.linalg.norm(x[quad[2]] - x[quad[0]]) * 0.25
    return float((u[:, 1] * weight).sum() / weight.sum())


def run(case: Case) -> None:
    """Judge the finest mesh, the order, and locking; plot convergence."""
    sizes = [8, 16, 32, 64]
    values = {
        e: [compliance(case, n, e, 1.0 / 3.0) for n in sizes] for e in ("hex8_bbar", "hex8_full")
    }
    for element, found in values.items():
        case.metric(f"{element} 64 x 64 / converged", found[-1] / EXACT, 1.0, 3e-3)
        order = np.log2((EXACT - found[1]) / (EXACT - found[3])) / 2
        case.metric(
            f"{element}: observed order",
            float(order),
            1.6,
            0.5,
            "corner singularities lower it from 2",
        )
    soft = compliance(case, 32, "hex8_bbar", 0.4999)
    locked = compliance(case, 32, "hex8_full", 0.4999)
    finer = compliance(case, 64, "hex8_bbar", 0.4999)
    case.metric("nu = 0.4999: hex8_bbar 32 / 64", soft / finer, 1.0, 0.03, "no locking")
    case.below(
        "nu = 0.4999: hex8_full / hex8_bbar",
        locked / soft,
        0.95,
        "plain integration locks, as known",
    )
    fig, ax = case.figure()
    ax.axhline(EXACT, color="k", lw=1, label="converged")
    for element, found in values.items():
        ax.plot(sizes, found, "o-", label=element)
    ax.set(xlabel="elements along an edge [-]", ylabel="compliance [length/force]", xscale="log")
    ax.legend()
    case.save(fig)
