"""Errors in the mean square on two meshes for every formulation."""

import numpy as np
from solid import MATERIAL, outer_nodes, polar_nodes, save, shape_of

from talus.elements import exponents, reference_nodes
from talus.mesh import box
from talus.orders import converted
from talus.verification import Case, field_steps

MODULI = np.array([1.5, 0.8, 0.5, 0.02, 0.01, 0.05])
A, B = np.array([1.0, -0.7, 0.5]), np.array([0.4, 0.9, -0.6])
LINEAR, QUADRATIC = (4, 8), (3, 6)
# element: meshes, order of u and its band, order of phi (None: classical)
CASES = {
    "hex8_bbar": (LINEAR, 2.0, 0.3, None),
    "hex8_full": (LINEAR, 2.0, 0.3, None),
    "hex8_incompatible": (LINEAR, 2.0, 0.3, None),
    "hex8_one_point": (LINEAR, 2.0, 0.3, None),
    "tet4": (LINEAR, 2.0, 0.4, None),
    "wedge6": (LINEAR, 2.0, 0.4, None),
    "hex20": (QUADRATIC, 3.0, 0.4, None),
    "hex27": (QUADRATIC, 3.0, 0.3, None),
    "tet10": (QUADRATIC, 3.0, 0.4, None),
    "hex8/hex8": (LINEAR, 2.0, 0.3, 2.0),
    "tet4/tet4": (LINEAR, 2.0, 0.4, 2.0),
    "hex20/hex8": (QUADRATIC, 2.5, 0.7, 2.0),
    "hex27/hex8": (QUADRATIC, 2.5, 0.7, 2.0),
    "tet10/tet4": (QUADRATIC, 2.5, 0.7, 2.0),
    "hex20/hex20": (QUADRATIC, 3.0, 0.4, 3.0),
}


def shapes(kind: str, xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shape functions (points, nodes) and derivatives (points, nodes, 3)."""
    power = exponents(kind)
    inverse = np.linalg.inv(np.prod(reference_nodes(kind)[:, None, :] ** power, axis=2))
    slope = []
    for axis in range(3):
        lower = power.copy()
        lower[:, axis] = np.maximum(lower[:, axis] - 1, 0)
        slope.append(np.prod(xi[:, None, :] ** lower, axis=2) * power[:, axis] @ inverse)
    return np.prod(xi[:, None, :] ** power, axis=2) @ inverse, np.stack(slope, axis=2)


def points(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Products of five Gauss points, folded into wedges and tetrahedra."""
    g, w = np.polynomial.legendre.leggauss(5)
    a, b, c = (v.ravel() for v in np.meshgrid(g, g, g, indexing="ij"))
    weight = np.einsum("i,j,k->ijk", w, w, w).ravel()
    if kind.startswith("hex"):
        return np.column_stack([a, b, c]), weight
    r, s, t = (1 + a) / 2, (1 + b) / 2, (1 + c) / 2
    if kind == "wedge6":
        return np.column_stack([r, s * (1 - r), c]), weight * (1 - r) / 4
    x = r
    y = s * (1 - r)
    z = t * (1 - r) * (1 - s)
    return np.column_stack([x, y, z]), weight / 8 * (1 - r) ** 2 * (1 - s)


def wave(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """S, its gradient (n, 3) and second derivatives (n, 3, 3)."""
    s, c = np.sin(np.pi * x), np.cos(np.pi * x)
    value = s.prod(axis=1)
    first = np.empty_like(x)
    second = np.empty((len(x), 3, 3))
    for i in range(3):
        parts = [c[:, k] if k == i else s[:, k] for k in range(3)]
        first[:, i] = np.pi * np.prod(parts, axis=0)
        for j in range(3):
            parts = [c[:, k] if k in (i, j) else s[:, k] for k in range(3)]
            second[:, i, j] = np.pi**2 * np.prod(parts, axis=0)
        second[:, i, i] = -(np.pi**2) * value
    return value, first, second


def body_forces(x: np.ndarray, moduli: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force and couple per volume that the fields need."""
    lam, mu, kappa, alpha, beta, gamma = moduli
    value, first, second = wave(x)
    laplace = np.trace(second, axis1=1, axis2=2)
    curl_phi = np.cross(first, B)
    curl_u = np.cross(first, A)
    force = -((lam + mu) * second @ A + (mu + kappa) * laplace[:, None] * A + kappa * curl_phi)
    couple = -((alpha + beta) * second @ B + gamma * laplace[:, None] * B)
    return force, couple - kappa * curl_u + 2 * kappa * value[:, None] * B


def solve(case: Case, element: str, n: int) -> tuple[float, float]:
    """Mean square errors of u and phi on n^3 cubes."""
    kind = shape_of(element)
    mesh = converted(box(np.zeros(3), np.ones(3), (n, n, n)), kind)
    cells, x = mesh.cells[kind], mesh.x
    polar = polar_nodes(mesh, element)
    moduli = MODULI if len(polar) else np.array([1.5, 0.8, 0, 0, 0, 0])
    xi, weight = points(kind)
    shape, slope = shapes(kind, xi)
    turn_kind = element.split("/")[1] if len(polar) else kind
    turn, _ = shapes(turn_kind, xi)
    turning = cells[:, : turn.shape[1]]
    at = np.einsum("qa,eai->eqi", shape, x[cells])
    volume = np.linalg.det(np.einsum("qaj,eai->eqij", slope, x[cells])) * weight
    force, couple = (v.reshape(at.shape) for v in body_forces(at.reshape(-1, 3), moduli))
    loads, turns = np.zeros_like(x), np.zeros_like(x)
    np.add.at(loads, cells, np.einsum("qa,eq,eqi->eai", shape, volume, force))
    np.add.at(turns, turning, np.einsum("qa,eq,eqi->eai", turn, volume, couple))
    mesh.nodes["surface"] = outer_nodes(mesh)
    free = np.setdiff1d(np.arange(len(x)), mesh.nodes["surface"])
    has = np.zeros(len(x), bool)
    has[polar] = True
    lines = []
    for k in free:
        text = f"&point_load node = {k + 1}, force = " + ", ".join(repr(float(v)) for v in loads[k])
        if has[k]:
            text += ", couple = " + ", ".join(repr(float(v)) for v in turns[k])
        lines.append(text + " /\n")
    material = MATERIAL.format(*(float(v) for v in moduli))
    if not len(polar):
        lam, mu = moduli[:2]
        young, poisson = mu * (3 * lam + 2 * mu) / (lam + mu), lam / (2 * (lam + mu))
        material = f"density = 1.0, young = {float(young)!r}, poisson = {float(poisson)!r}"
    fix = "'x', 'y', 'z'" + (", 'rx', 'ry', 'rz'" if len(polar) else "")
    text = (case.folder / "deck.nml").read_text().replace("MATERIAL", material)
    text = text.replace("ELEMENT", element).replace("FIX", fix)
    save(mesh, case.folder / "cube.h5")
    name = f"{element.replace('/', '_')}_{n}"
    (case.folder / f"{name}.nml").write_text(text + "".join(lines))
    case.run("talus-fem", f"{name}.nml")
    last = field_steps(case.folder / f"{name}.h5")[-1].solid
    exact = wave(at.reshape(-1, 3))[0].reshape(volume.shape)
    errors = []
    for values, table, nodes, vector in (("u", shape, cells, A), ("phi", turn, turning, B)):
        if values not in last:
            errors.append(0.0)
            continue
        found = np.einsum("qa,eai->eqi", table, last[values][nodes])
        square = ((found - exact[..., None] * vector) ** 2).sum(axis=2)
        errors.append(float(np.sqrt((square * volume).sum())))
    return errors[0], errors[1]


def run(case: Case) -> None:
    """Judge the order of every formulation; plot the errors of u."""
    fig, ax = case.figure()
    for element, (sizes, order, band, turn_order) in CASES.items():
        errors = np.array([solve(case, element, n) for n in sizes])
        rate = float(np.log2(errors[0, 0] / errors[1, 0]))
        case.metric(f"{element}: order of u", rate, order, band)
        if turn_order is not None:
            rate = float(np.log2(errors[0, 1] / errors[1, 1]))
            case.metric(f"{element}: order of phi", rate, turn_order, 0.4)
        ax.loglog(sizes, errors[:, 0], "o-", ms=4, label=element)
    ax.set(xlabel="elements along an edge [-]", ylabel="mean square error of u [-]")
    ax.legend(fontsize="x-small", loc="center left", bbox_to_anchor=(1.0, 0.5))
    case.save(fig)
