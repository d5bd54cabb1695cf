"""Compliance of the membrane for three pairs of interpolations and two coupling numbers."""

import numpy as np
from plane import plane_compliance
from solid import MATERIAL, save, shape_of

from talus.mesh import Mesh, boundary_faces, facet_parts, structured
from talus.orders import converted
from talus.verification import Case, field_steps

SHEAR, POISSON = 1.0 / (2 * (1 + 1 / 3)), 1 / 3
# kappa, l_b: converged compliance; relative errors of Q1/Q1 and Q2/Q1 on 4, 8, 16 quadrangles
STATES = {
    (100.0, 4.0): (15.8732359385, [-0.90621, -0.72016, -0.40933], [-0.03521, -0.01093, -0.00363]),
    (100.0, 0.5): (21.3473820992, [-0.92873, -0.77856, -0.49606], [-0.05178, -0.01893, -0.00681]),
}
SIZES = (4, 8, 16)
# kappa = 0.2 (N = 0.46), l_b = 4, whose converged compliance is not given
WEAK = ([-0.2079, -0.06934, -0.0204], [-0.01235, -0.00396, -0.00136])


def compliance(case: Case, n: int, element: str, kappa: float, length: float) -> float:
    """Mean vertical displacement of the loaded edge on an n x n mesh."""
    s = np.linspace(0.0, 1.0, n + 1)
    x, hex8 = structured((s, s, np.array([0.0, 1.0])))
    bottom, top = 44.0 * x[:, 0], 44.0 + 16.0 * x[:, 0]
    x = np.column_stack([48.0 * x[:, 0], bottom + (top - bottom) * x[:, 1], x[:, 2]])
    mesh = Mesh(x, hex8, {"all": np.arange(len(hex8))})
    mesh.nodes["left"] = np.flatnonzero(np.isclose(x[:, 0], 0.0))
    right = [q for _, q in boundary_faces(hex8).values() if np.isclose(x[q][:, 0], 48.0).all()]
    mesh.facets["right"] = np.array(right)
    mesh = converted(mesh, shape_of(element))
    save(mesh, case.folder / "cook.h5")
    gamma = 4 * SHEAR * length**2
    moduli = (2 * SHEAR * POISSON / (1 - 2 * POISSON), SHEAR - kappa / 2, kappa, 0.0, 0.0, gamma)
    text = (case.folder / "deck.nml").read_text().replace("ELEMENT", element)
    name = f"{element.replace('/', '_')}_{n}_{length}"
    (case.folder / f"{name}.nml").write_text(text.replace("MATERIAL", MATERIAL.format(*moduli)))
    case.run("talus-fem", f"{name}.nml")
    u = field_steps(case.folder / f"{name}.h5")[-1].solid["u"][:, 1]
    total = area = 0.0
    for facets in facet_parts(mesh.facets["right"]).values():
        for nodes in facets:  # the edge is straight: Simpson's rule or the trapezoidal one
            weight = edge_weights(len(nodes))
            size = np.ptp(mesh.x[nodes][:, 1])
            total += size * float(weight @ u[nodes])
            area += size
    return total / area


def edge_weights(nodes: int) -> np.ndarray:
    """Integrals of the shape functions of a facet over its area."""
    return {
        4: np.full(4, 1 / 4),
        8: np.array([-1 / 12] * 4 + [1 / 3] * 4),
        9: np.array([1 / 36] * 4 + [1 / 9] * 4 + [4 / 9]),
    }[nodes]


def judge_weak(case: Case) -> None:
    """Judge the weak coupling. The finest mixed mesh and its error give the converged value; the
    other code takes more quadrature points, which matters for coarse hex8/hex8 alone: a second
    program confirms both rules."""
    equal, mixed = ([compliance(case, n, e, 0.2, 4.0) for n in SIZES]
                    for e in ("hex8/hex8", "hex27/hex8"))  # fmt: skip
    reference = mixed[-1] / (1.0 + WEAK[1][-1])
    for n, f, w in zip(SIZES, mixed[:-1], WEAK[1], strict=False):
        case.metric(f"N = 0.46: hex27/hex8, {n} x {n}: error", f / reference - 1.0, w, 2e-4)
    moduli = (2 * SHEAR * POISSON / (1 - 2 * POISSON), SHEAR - 0.1, 0.2, 4 * SHEAR * 16.0)
    for n, f, w in zip(SIZES, equal, WEAK[0], strict=True):
        same = plane_compliance(n, 2, moduli)
        case.metric(f"N = 0.46: hex8/hex8, {n} x {n} / second program", f / same, 1.0, 1e-9)
        more = plane_compliance(n, 4, moduli) / reference - 1.0
        case.metric(f"N = 0.46: its error with 4 points, {n} x {n}", more, w, 6e-5)
    error = equal[-1] / reference - 1.0
    case.metric("N = 0.46: hex8/hex8, 16 x 16: error", error, WEAK[0][-1], 2e-4)


def run(case: Case) -> None:
    """Judge errors against those of another code; plot locking."""
    fig, ax = case.figure()
    for (kappa, length), (reference, equal, mixed) in STATES.items():
        found = {
            e: [compliance(case, n, e, kappa, length) / reference - 1 for n in SIZES]
            for e in ("hex8/hex8", "hex27/hex8", "hex20/hex8")
        }
        for n, f, w in zip(SIZES, found["hex8/hex8"], equal, strict=True):
            case.metric(f"l_b = {length}: hex8/hex8, {n} x {n}: error", f, w, 2e-4, "locks")
        for n, f, w in zip(SIZES, found["hex27/hex8"], mixed, strict=True):
            case.metric(f"l_b = {length}: hex27/hex8, {n} x {n}: error", f, w, 2e-4)
        case.below(
            f"l_b = {length}: hex20/hex8, 16 x 16: |error|", abs(found["hex20/hex8"][-1]), 0.02
        )
        for (element, values), mark in zip(found.items(), "os^", strict=True):
            ax.loglog(
                SIZES,
                np.abs(values),
                mark + "-",
                ms=5,
                mfc="none",
                label=f"{element}, l_b = {length} m",
            )
    judge_weak(case)
    ax.set(xlabel="elements along an edge [-]", ylabel="error of the compliance [-]")
    ax.legend()
    case.save(fig)
