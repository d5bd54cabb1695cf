"""Cylindrical bending: the exact field by mixed pairs, order of the equal one."""

import numpy as np
from solid import polar_nodes, save, shape_of

from talus.mesh import box, facet_parts
from talus.orders import converted
from talus.verification import Case, field_steps

LAMBDA, MU, KAPPA, GAMMA, BETA = 1e9, 1e9, 0.5e9, 2e6, 0.5e3
CURVATURE, H, L, B = 0.01, 0.5, 2.0, 0.25
TWICE = 2 * MU + KAPPA
YOUNG = TWICE * (3 * LAMBDA + TWICE) / (2 * LAMBDA + TWICE)
POISSON = LAMBDA / (2 * LAMBDA + TWICE)
MODULUS = YOUNG / (1 - POISSON**2)


def field(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Displacement and micro-rotation of the closed form."""
    u, phi = np.zeros_like(x), np.zeros_like(x)
    u[:, 0] = -CURVATURE * x[:, 0] * x[:, 2]
    side = POISSON / (1 - POISSON) * CURVATURE * x[:, 2] ** 2 / 2
    u[:, 2] = CURVATURE * x[:, 0] ** 2 / 2 + side
    phi[:, 1] = -CURVATURE * x[:, 0]
    return u, phi


def monomials(r: np.ndarray, nodes: int) -> np.ndarray:
    """Monomials that span the shape functions of a facet."""
    a, b = r[..., 0], r[..., 1]
    full = {
        3: (a**0, a, b),
        4: (a**0, a, b, a * b),
        6: (a**0, a, b, a * a, a * b, b * b),
        8: (a**0, a, b, a * a, a * b, b * b, a * a * b, a * b * b),
        9: (a**0, a, b, a * a, a * b, b * b, a * a * b, a * b * b, a * a * b * b),
    }
    return np.stack(full[nodes], axis=-1)


def end_loads(mesh: object) -> str:
    """Consistent nodal forces of the traction -E K z/(1 - nu^2) at x = L, as point loads."""
    force = np.zeros(len(mesh.x))
    g, w = np.polynomial.legendre.leggauss(4)
    for facets in facet_parts(mesh.facets["x1"]).values():
        for nodes in facets:
            p = mesh.x[nodes][:, 1:]
            inverse = np.linalg.inv(monomials(p, len(nodes)))
            low, high = p.min(axis=0), p.max(axis=0)
            for i, a in enumerate(g):
                for j, b in enumerate(g):
                    s, t = (1 + a) / 2, (1 + b) / 2
                    weight = w[i] * w[j] / 4
                    if len(nodes) in (3, 6):
                        corner = p[:3]
                        r = (
                            corner[0]
                            + s * (corner[1] - corner[0])
                            + t * (1 - s) * (corner[2] - corner[0])
                        )
                        e, f = corner[1] - corner[0], corner[2] - corner[0]
                        weight *= (1 - s) * abs(e[0] * f[1] - e[1] * f[0])
                    else:
                        r = low + np.array([s, t]) * (high - low)
                        weight *= np.prod(high - low)
                    shape = monomials(r, len(nodes)) @ inverse
                    force[nodes] += -MODULUS * CURVATURE * r[1] * weight * shape
    return "".join(
        f"&point_load node = {n + 1}, force = {float(f)!r}, 0.0, 0.0 /\n"
        for n, f in enumerate(force) if f != 0.0
    )  # fmt: skip


def solve(case: Case, element: str, cells: tuple[int, int, int]) -> dict:
    """Run one mesh; return fields, and errors relative to the largest exact value."""
    mesh = box(np.array([0.0, 0.0, -H / 2]), np.array([L, B, H / 2]), cells)
    mesh = converted(mesh, shape_of(element))
    u, phi = field(mesh.x)
    end = np.flatnonzero(mesh.x[:, 0] < 1e-9)
    has = np.zeros(len(mesh.x), bool)
    has[polar_nodes(mesh, element)] = True
    lines = ["&curve    id = 'on', times = 0.0, 1.0, values = 0.0, 1.0 /\n"]
    for n in end:
        mesh.nodes[f"n{n}"] = np.array([n])
        parts = [("x", u[n, 0]), ("z", u[n, 2])] + ([("ry", phi[n, 1])] if has[n] else [])
        for c, v in parts:
            start = f"&motion group = 'n{n}', component = '{c}', curve = 'on'"
            lines.append(f"{start}, scale = {float(v)!r} /\n")
    save(mesh, case.folder / "slab.h5")
    name = element.replace("/", "_") + f"_{cells[0]}"
    text = (case.folder / "deck.nml").read_text().replace("ELEMENT", element)
    (case.folder / f"{name}.nml").write_text(text + "".join(lines) + end_loads(mesh))
    case.run("talus-fem", f"{name}.nml")
    last = field_steps(case.folder / f"{name}.h5")[-1].solid
    z = last["points_x"][:, 2]
    moment = float(
        mesh.x[end, 2] @ last["reaction"][end, 0] + last["reaction_couple"][end, 1].sum()
    )
    sigma, m = last["stress_points"], last["couple_stress_points"]
    return {
        "u": float(np.abs(last["u"] - u).max() / np.abs(u).max()),
        "phi": float(np.abs(last["phi"] - phi).max() / np.abs(phi).max()),
        "sigma": float(
            np.abs(sigma[:, 0] + MODULUS * CURVATURE * z).max() / (MODULUS * CURVATURE * H / 2)
        ),
        "m_xy": float(np.abs(m[:, 1] + GAMMA * CURVATURE).max() / (GAMMA * CURVATURE)),
        "m_yx": float(np.abs(m[:, 3] + BETA * CURVATURE).max() / (BETA * CURVATURE)),
        "moment": moment / (MODULUS * CURVATURE * H**3 / 12 * B),
    }


def run(case: Case) -> None:
    """Judge the mixed pairs to round-off and the order of hex8/hex8; plot both."""
    for element in ("hex20/hex8", "hex27/hex8", "tet10/tet4"):
        found = solve(case, element, (4, 1, 2))
        for name in ("u", "phi", "sigma", "m_xy"):
            case.below(f"{element}: {name}, error / largest", found[name], 1e-9)
        case.below(f"{element}: m_yx, error / exact", found["m_yx"], 1e-6, "4000 times smaller")
        case.metric(
            f"{element}: moment of the reactions / classical", found["moment"], 1.02986666667, 1e-9
        )
    sizes = (4, 8, 16)
    errors = [solve(case, "hex8/hex8", (n, 1, n // 2))["u"] for n in sizes]
    order = float(np.log2(errors[1] / errors[2]))
    case.metric("hex8/hex8: observed order of u", order, 2.0, 0.3)
    fig, ax = case.figure()
    ax.loglog(sizes, errors, "ko-", label="hex8/hex8")
    ax.loglog(
        sizes, [errors[0] * (sizes[0] / n) ** 2 for n in sizes], "k:", lw=1, label="second order"
    )
    ax.set(xlabel="elements along the slab [-]", ylabel="error of u / largest u [-]")
    ax.legend()
    case.save(fig)
