"""Thick sphere under inner pressure: stress at the nodes near incompressibility."""

import numpy as np
from solid import save

from talus.elements import CORNERS
from talus.mesh import Mesh, boundary_faces, structured
from talus.orders import converted
from talus.verification import Case, field_steps

YOUNG, PRESSURE, INNER, OUTER = 1.0e6, 1.0e3, 1.0, 2.0
RATIOS = (0.3, 0.49, 0.4999, 0.499999)
LINEAR = ("'linear_elastic'", "")
STATE = ("'drucker_prager'", ", cohesion = 1.0e9, friction_deg = 0.0")


def eighth(kind: str, n: int) -> Mesh:
    """Three blocks of n^3 cells round the diagonal, bent to the sphere in every node."""
    line = np.linspace(0.0, 1.0, n + 1)
    s, hex8 = structured((line, line, line))
    blocks = []
    for turn in range(3):
        # corners of a third of the octant's face: axis, middles of two edges, centre
        axis, second, third = np.roll(np.eye(3), turn, axis=1)
        a, b = axis + second, axis + third
        c = axis + second + third
        u, v = s[:, 0:1], s[:, 1:2]
        way = (1 - u) * (1 - v) * axis + u * (1 - v) * a + u * v * c + (1 - u) * v * b
        way /= np.linalg.norm(way, axis=1)[:, None]
        blocks.append(way * (INNER + (OUTER - INNER) * s[:, 2:3]))
    x = np.vstack(blocks)
    cells = np.vstack([hex8 + k * len(s) for k in range(3)])
    keys = np.round(x, 9) + 0.0
    _, first, same = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    x, cells = x[first], same.reshape(-1)[cells]
    mesh = Mesh(x, cells, {"all": np.arange(len(cells))})
    radius = np.linalg.norm(x, axis=1)
    faces = [q for _, q in boundary_faces(cells).values() if np.allclose(radius[q], INNER)]
    mesh.facets["inner"] = np.array(faces)
    mesh = converted(mesh, kind)
    bend(mesh, kind)
    for name, column in zip(("x0", "y0", "z0"), mesh.x.T, strict=True):
        mesh.nodes[name] = np.flatnonzero(np.isclose(column, 0.0, atol=1e-9))
    return mesh


def bend(mesh: Mesh, kind: str) -> None:
    """Put middle nodes at the mean radius of their corners, so that both spheres are smooth."""
    cells = mesh.cells[kind]
    corners = cells[:, : CORNERS[kind]]
    radius = np.linalg.norm(mesh.x, axis=1)
    wanted = radius.copy()
    layers = np.unique(np.round(radius[np.unique(corners)], 6))
    middles = np.setdiff1d(np.unique(cells), np.unique(corners))
    halves = np.sort(np.concatenate([layers, 0.5 * (layers[1:] + layers[:-1])]))
    # a chord lies below its arc by less than a quarter of a layer
    for node in middles:
        above = halves[halves >= radius[node] - 1e-9]
        wanted[node] = above[0] if len(above) else layers[-1]
    mesh.x *= (wanted / radius)[:, None]


def errors_of(case: Case, element: str, n: int, ratio: float, law: tuple[str, str]) -> tuple:
    """Run a sphere; largest errors of hoop stress, radial stress and displacement, relative."""
    kind = element.split("_")[0]
    stem = f"{element}_{n}"
    mesh = eighth(kind, n)
    save(mesh, case.folder / f"{stem}.h5")
    text = (case.folder / "deck.nml").read_text()
    for word, value in (("ELEMENT", element), ("RATIO", repr(ratio)), ("MESH", stem),
                        ("LAW", law[0]), ("CONSTANTS", law[1])):  # fmt: skip
        text = text.replace(word, value)
    (case.folder / "sphere.nml").write_text(text)
    case.run("talus-fem", "sphere.nml")
    found = field_steps(case.folder / "sphere.h5")[-1].solid
    r = np.linalg.norm(mesh.x, axis=1)
    n_r = mesh.x / r[:, None]
    xx, yy, zz, xy, yz, zx = found["stress_nodal"].T
    full = np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])
    radial = np.einsum("ijn,ni,nj->n", full, n_r, n_r)
    hoop = 0.5 * (xx + yy + zz - radial)
    share = PRESSURE * INNER**3 / (OUTER**3 - INNER**3)
    exact_radial, exact_hoop = share * (1 - OUTER**3 / r**3), share * (1 + 0.5 * OUTER**3 / r**3)
    exact_u = share * r / YOUNG * (1 - 2 * ratio + 0.5 * (1 + ratio) * OUTER**3 / r**3)
    u = np.einsum("ni,ni->n", found["u"], n_r)
    largest = exact_hoop.max()
    return (
        float(abs(hoop - exact_hoop).max() / largest),
        float(abs(radial - exact_radial).max() / largest),
        float(abs(u - exact_u).max() / exact_u.max()),
    )


def run(case: Case) -> None:
    """Judge errors over Poisson's ratio and size; plot them."""
    sizes = (2, 4, 8)
    fine = {}
    for ratio in RATIOS:
        coarse = errors_of(case, "hex27_bbar", 4, ratio, LINEAR)
        fine[ratio] = errors_of(case, "hex27_bbar", 8, ratio, LINEAR)
        case.below(f"hex27_bbar, {ratio}: hoop stress, error / largest", fine[ratio][0], 0.015)
        case.below(f"hex27_bbar, {ratio}: displacement, error / largest", fine[ratio][2], 2e-5)
        order = float(np.log2(coarse[0] / fine[ratio][0]))
        case.metric(f"hex27_bbar, {ratio}: order of the hoop stress", order, 1.9, 0.3)
        order = float(np.log2(coarse[2] / fine[ratio][2]))
        case.above(f"hex27_bbar, {ratio}: order of the displacement", order, 2.8)
    share = fine[0.499999][0] / fine[0.3][0]
    case.metric("hex27_bbar: hoop stress, error at 0.499999 / at 0.3", share, 1.0, 0.1)
    stateful = errors_of(case, "hex27_bbar", 4, 0.4999, STATE)
    linear = errors_of(case, "hex27_bbar", 4, 0.4999, LINEAR)
    off = max(abs(a / b - 1) for a, b in zip(stateful, linear, strict=True))
    case.below("hex27_bbar, law with a state: errors / those of the linear law - 1", off, 1e-3)
    curves = {"hex27_bbar": [errors_of(case, "hex27_bbar", n, 0.4999, LINEAR)[0] for n in sizes]}
    for element in ("tet10", "hex27", "hex20"):
        curves[element] = [errors_of(case, element, n, 0.4999, LINEAR)[0] for n in sizes[:2]]
        case.above(f"{element}, 0.4999: hoop stress, error / largest", curves[element][-1], 0.2)
        warned = "W301" in (case.folder / "sphere.log").read_text()
        case.metric(f"{element}, 0.4999: warned of", float(warned), 1.0, 0.0)
    fig, ax = case.figure()
    for (element, values), mark in zip(curves.items(), "os^d", strict=True):
        ax.loglog(sizes[: len(values)], values, mark + "-", lw=0.8, label=element)
    ax.loglog(sizes, 0.5 / np.array(sizes) ** 2, "k-", lw=1, label="second order")
    ax.set(xlabel="elements through the wall", ylabel="error of the nodal hoop stress [-]")
    ax.set_title("Poisson's ratio 0.4999")
    ax.legend()
    case.save(fig)
