"""Cook's membrane in plane strain at large strain: one value for all elements that do not lock."""

import numpy as np
from solid import save, shape_of

from talus.mesh import Mesh, boundary_faces, structured
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

RUNS = {"hex8_bbar": (16, 32, 64), "hex20": (8, 16, 32), "hex27": (8, 16, 32), "tet10": (8, 16, 32),
        "hex8_full": (16, 32, 64)}  # fmt: skip


def membrane(n: int, kind: str) -> Mesh:
    """Return the membrane with n x n cells, one through the thickness."""
    line = np.linspace(0.0, 1.0, n + 1)
    x, hex8 = structured((line, line, np.array([0.0, 1.0])))
    a, b = x[:, 0], x[:, 1]
    x = np.column_stack([48 * a, 44 * a + (44 - 28 * a) * b, 48 / n * x[:, 2]])
    mesh = converted(Mesh(x, hex8, {"all": np.arange(len(hex8))}), kind)
    mesh.nodes["left"] = np.flatnonzero(np.isclose(mesh.x[:, 0], 0.0))
    mesh.nodes["flat"] = np.arange(len(mesh.x))
    faces = [nodes for _, nodes in boundary_faces(mesh.cells).values()]
    mesh.facets["right"] = np.array([q for q in faces if np.isclose(mesh.x[q][:, 0], 48.0).all()])
    return mesh


def lift(case: Case, element: str, n: int) -> float:
    """Run a mesh; return the lift of the upper tip."""
    mesh = membrane(n, shape_of(element))
    name = f"{element}_{n}"
    save(mesh, case.folder / f"mesh_{name}.h5")
    text = (case.folder / "deck.nml").read_text().replace("MESH", f"mesh_{name}")
    (case.folder / f"{name}.nml").write_text(text.replace("ELEMENT", element))
    case.run("talus-fem", f"{name}.nml")
    tip = np.isclose(mesh.x[:, 0], 48.0) & np.isclose(mesh.x[:, 1], 60.0)
    return float(field_steps(case.folder / f"{name}.h5")[-1].solid["u"][tip, 1].mean())


def run(case: Case) -> None:
    """Judge that the finest meshes agree; plot the lifts over the meshes."""
    fig, ax = case.figure()
    found = {}
    for (element, meshes), mark in zip(RUNS.items(), "os^vD", strict=True):
        found[element] = [lift(case, element, n) for n in meshes]
        ax.semilogx(meshes, found[element], mark + "-", mfc="none", label=element)
    reference = found["hex27"][-1]
    for element in ("hex8_bbar", "hex20", "tet10"):
        case.metric(f"{element}: lift of the tip / that of hex27", found[element][-1] / reference,
                    1.0, 0.005)  # fmt: skip
    steps = np.diff(found["hex27"])
    case.below("hex27: change of the lift with the last halving over that before",
               steps[1] / steps[0], 0.6)  # fmt: skip
    case.below("hex8_full: lift of the coarsest mesh / that of hex27",
               found["hex8_full"][0] / reference, 0.9)  # fmt: skip
    case.above("lift over the edge", reference / 16, 0.4)
    table = read_history(case.folder / "hex8_bbar_32_newton.csv")
    orders = []
    for t in np.unique(table["time"]):
        r = table["residual"][np.isclose(table["time"], t)]
        r = r[r > 1e-10]  # round-off follows
        if len(r) >= 4:
            orders.append(np.log(r[-1] / r[-2]) / np.log(r[-2] / r[-3]))
        print("residuals:", " ".join(f"{v:.1e}" for v in r))
    case.above("order of Newton's last iterations, median", float(np.median(orders)), 1.7)
    ax.set(xlabel="cells along an edge", ylabel="lift of the tip", xticks=[8, 16, 32, 64])
    ax.legend()
    case.save(fig)
