"""Cook's membrane as a slice one element thick."""

import numpy as np

from talus.mesh import Mesh, boundary_faces, structured, write_mesh
from talus.orders import converted
from talus.verification import Case, field_steps

EXACT = 21.5902
QUADRATIC = ("hex20", "hex27")


def compliance(
    case: Case, n: int, element: str, poisson: float, grading: float = 1.0
) -> float:
    """Mean vertical displacement of the loaded edge on an n x n mesh; graded: s**grading from the
    clamped edge on and from both of its corners."""
    s = np.linspace(0.0, 1.0, n + 1)
    across = np.where(s <= 0.5, 0.5 * (2 * s) ** grading, 1.0 - 0.5 * (2 - 2 * s) ** grading)
    x, hex8 = structured((s**grading, across, np.array([0.0, 1.0])))
    bottom, top = 44.0 * x[:, 0], 44.0 + 16.0 * x[:, 0]
    x = np.column_stack([48.0 * x[:, 0], bottom + (top - bottom) * x[:, 1], x[:, 2]])
    right = np.isclose(x[:, 0], 48.0)
    facets = np.array([q for _, q in boundary_faces(hex8).values() if right[q].all()])
    groups = {"left": np.flatnonzero(np.isclose(x[:, 0], 0.0))}
    mesh = Mesh(x, hex8, {"all": np.arange(len(hex8))}, {"right": facets}, groups)
    mesh = converted(mesh, element.split("_")[0])
    write_mesh(case.folder / "cook.h5", mesh)
    deck = (case.folder / "deck.nml").read_text()
    name = f"cook_{n}_{element}_{poisson:.4f}_{grading:.0f}.nml"
    text = deck.replace("hex8_bbar", element).replace("0.333333333333", str(poisson))
    (case.folder / name).write_text(text)
    case.run("talus-fem", name)
    u = field_steps(case.folder / name.replace(".nml", ".h5"))[-1].solid["u"]
    weight = np.zeros(len(mesh.x))  # shares of a uniform traction
    for quad in mesh.facets["right"]:
        area = np.ptp(mesh.x[quad[:4]][:, 1])  # of a slice of thickness one
        weight[quad[:4]] += area / 4 if len(quad) == 4 else -area / 12
        weight[quad[4:]] += area / 3
    return float((u[:, 1] * weight).sum() / weight.sum())


def order(coarse: float, fine: float) -> float:
    """Observed order from two meshes, the second four times as fine."""
    return float(np.log2((EXACT - coarse) / (EXACT - fine)) / 2)


def singular_order(poisson: float) -> float:
    """Order that the clamped upper corner leaves: twice Williams' exponent (1952) of its angle."""
    angle = np.pi / 2 + np.arctan2(16.0, 48.0)
    kappa = 3.0 - 4.0 * poisson
    low, high = 0.5, 1.0
    for _ in range(60):
        m = 0.5 * (low + high)
        off = np.sin(m * angle) ** 2 - (0.25 * (kappa + 1) ** 2 - (m * np.sin(angle)) ** 2) / kappa
        low, high = (m, high) if off < 0.0 else (low, m)
    return 2.0 * low


def run(case: Case) -> None:
    """Judge the finest mesh, the order, and locking; plot convergence."""
    sizes = [8, 16, 32, 64]
    bricks = ("hex8_bbar", "hex8_full", "hex8_incompatible")
    values = {e: [compliance(case, n, e, 1.0 / 3.0) for n in sizes] for e in bricks}
    for element, found in values.items():
        case.metric(f"{element} 64 x 64 / converged", found[-1] / EXACT, 1.0, 3e-3)
        case.metric(
            f"{element}: observed order",
            order(found[1], found[3]),
            1.6,
            0.5,
            "corner singularities lower it from 2",
        )
    quadratic = {e: [compliance(case, n, e, 1.0 / 3.0) for n in (8, 16, 32)] for e in QUADRATIC}
    for element, found in quadratic.items():
        seen = float(np.log2((EXACT - found[1]) / (EXACT - found[2])))
        case.metric(f"{element}: observed order", seen, singular_order(1.0 / 3.0), 0.1)
        rate = 2.0 ** singular_order(1.0 / 3.0)
        limit = (rate * found[2] - found[1]) / (rate - 1.0)
        case.metric(f"{element}: extrapolated / converged", limit / EXACT, 1.0, 2e-4)
        fine = compliance(case, 32, element, 1.0 / 3.0, 2.0)
        case.metric(f"{element} 32 x 32, graded / converged", fine / EXACT, 1.0, 1e-3)
    case.metric("hex27 32 x 32 / converged", quadratic["hex27"][-1] / EXACT, 1.0, 1e-3)
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
    for element, found in quadratic.items():
        ax.plot(sizes[:3], found, "s-", label=element)
    ax.set(xlabel="elements along an edge [-]", ylabel="compliance [length/force]", xscale="log")
    ax.legend()
    case.save(fig)
