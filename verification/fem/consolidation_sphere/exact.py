"""Cryer's sphere on an octant of hexahedra."""

import numpy as np

from talus.compare import max_of
from talus.mesh import Mesh, boundary_faces, structured, write_mesh
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

LOAD, INNER = 1.0e4, 0.45
# time, pressure at the centre; its maximum
CENTRE = ((2.0, 13581.7499379), (5.0, 15573.2533069), (10.0, 14755.0538693), (20.0, 9971.52555323),
          (40.0, 4199.95146626))  # fmt: skip
HIGHEST = 15754.2484841


def octant(n: int, kind: str) -> Mesh:
    """Octant of the unit sphere: a cube of n^3 elements and n layers of 3 n^2 around it."""
    line = np.linspace(0.0, 1.0, n + 1)
    unit, cells = structured((line, line, line))
    nodes, elements = [INNER * unit], [cells]
    for axis in range(3):
        flat = np.column_stack([np.ones(len(unit)), unit[:, 1], unit[:, 2]])
        outer = flat / np.linalg.norm(flat, axis=1)[:, None]
        place = (1 - unit[:, :1]) * INNER * flat + unit[:, :1] * outer
        nodes.append(np.roll(place, axis, axis=1))
        elements.append(cells + len(unit) * (axis + 1))
    x = np.concatenate(nodes)
    _, first, back = np.unique(np.round(x, 9), axis=0, return_index=True, return_inverse=True)
    hex8 = back.ravel()[np.concatenate(elements)]
    mesh = converted(Mesh(x[first], hex8, {"all": np.arange(len(hex8))}), kind)
    faces = [q for _, q in boundary_faces(mesh.cells).values()]
    corners = np.linalg.norm(mesh.x, axis=1) > 1 - 1e-9
    outside = np.array([q for q in faces if corners[q[:4]].all()])
    rim = np.unique(outside)
    mesh.x[rim] /= np.linalg.norm(mesh.x[rim], axis=1)[:, None]  # middles of edges, too
    mesh.facets["surface"] = outside
    for axis, name in enumerate(("x0", "y0", "z0")):
        mesh.nodes[name] = np.flatnonzero(np.abs(mesh.x[:, axis]) < 1e-9)
    return mesh


def judge(case: Case, element: str, n: int, ax: object) -> None:
    """Judge the pressure at the centre."""
    kind = element.split("_")[0]
    mesh = octant(n, kind)
    write_mesh(case.folder / f"{kind}.h5", mesh)
    text = (case.folder / "deck.nml").read_text().replace("MESH", kind).replace("ELEMENT", element)
    (case.folder / f"run_{kind}.nml").write_text(text)
    case.run("talus-fem", f"run_{kind}.nml")
    centre = int(np.argmin(np.linalg.norm(mesh.x, axis=1)))
    steps = field_steps(case.folder / f"run_{kind}.h5")
    found = {round(s.time, 6): s.solid["pore_pressure"][centre] for s in steps}
    off = max_of(abs(found[t] / LOAD - p / LOAD) for t, p in CENTRE)
    case.below(f"{element}: pressure at the centre, error / load", off, 0.02)
    table = read_history(case.folder / f"run_{kind}_pore.csv")
    highest = float(table["largest pressure"][table["time"] > 1.0].max())
    case.metric(f"{element}: highest pressure / exact", highest / HIGHEST, 1.0, 0.02)
    lost = abs(table["balance"]).max() / abs(table["surface entered"]).max()
    case.below(f"{element}: liquid unaccounted for", float(lost), 1e-12)
    times = np.array(sorted(found))
    ax.plot(times, [found[t] / LOAD for t in times], "o-", ms=3, mfc="none", label=element)


def run(case: Case) -> None:
    """Judge the sphere; plot the pressure at the centre."""
    fig, ax = case.figure()
    judge(case, "hex20", 5, ax)
    judge(case, "hex8_bbar", 7, ax)
    ax.plot([t for t, _ in CENTRE], [p / LOAD for _, p in CENTRE], "k+", ms=12, label="exact")
    ax.axhline(HIGHEST / LOAD, color="k", lw=1)
    ax.set(xlabel="time [s]", ylabel="p at the centre / load [-]")
    ax.legend()
    case.save(fig)
