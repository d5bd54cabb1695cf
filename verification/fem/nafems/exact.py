"""Stress at the tip of the hole of two elliptic plates, against NAFEMS' targets."""

import numpy as np
from solid import save

from talus.mesh import Mesh, boundary_faces, structured
from talus.orders import converted
from talus.verification import Case, field_steps

INNER, OUTER = np.array([2.0, 1.0]), np.array([3.25, 2.75])  # semi-axes [m]
THICK = {"plate": 0.6, "membrane": 0.02}  # m; half of the membrane is modelled
TARGET = {"plate": -5.38e6, "membrane": 92.7e6}  # Pa
MESHES = {"plate": ((4, 6, 2), (8, 12, 4), (12, 20, 6)),
          "membrane": ((4, 6, 1), (8, 12, 1), (16, 24, 1))}  # fmt: skip


def elliptic(kind: str, counts: tuple[int, int, int]) -> Mesh:
    """Quarter between two ellipses: elements along the radius, around, and through."""
    lines = tuple(np.linspace(0.0, 1.0, n + 1) for n in counts)
    s, hex8 = structured(lines)
    mesh = Mesh(s, hex8, {"all": np.arange(len(hex8))})
    for name, axis in (("edge", 0), ("top", 2)):
        mesh.facets[name] = np.array(
            [q for _, q in boundary_faces(hex8).values() if np.isclose(s[q][:, axis], 1.0).all()]
        )
    mesh = converted(mesh, "hex20")
    s = mesh.x
    for name, axis, at in (("y0", 1, 0.0), ("x0", 1, 1.0), ("outer", 0, 1.0), ("z0", 2, 0.0)):
        mesh.nodes[name] = np.flatnonzero(np.isclose(s[:, axis], at))
    mesh.nodes["middle"] = np.flatnonzero(np.isclose(s[:, 0], 1.0) & np.isclose(s[:, 2], 0.5))
    angle = 0.5 * np.pi * s[:, 1]
    axes = INNER + s[:, :1] * (OUTER - INNER)
    around = np.column_stack([np.cos(angle), np.sin(angle)])
    mesh.x = np.column_stack([axes * around, THICK[kind] * (s[:, 2] - 0.5)])
    return mesh


def stress(case: Case, kind: str, counts: tuple[int, int, int]) -> float:
    """Run one mesh; return the stress yy at the tip of the hole, on the top [Pa]."""
    mesh = elliptic(kind, counts)
    save(mesh, case.folder / f"{kind}.h5")
    name = f"{kind}_{counts[1]}"
    (case.folder / f"{name}.nml").write_text((case.folder / f"{kind}.nml").read_text())
    case.run("talus-fem", f"{name}.nml")
    tip = np.array([INNER[0], 0.0, 0.5 * THICK[kind]])
    node = int(np.argmin(np.linalg.norm(mesh.x - tip, axis=1)))
    return float(field_steps(case.folder / f"{name}.h5")[-1].solid["stress_nodal"][node, 1])


def run(case: Case) -> None:
    """Judge the finest meshes and how the meshes close in; plot all."""
    fig, ax = case.figure()
    for kind, meshes in MESHES.items():
        found = [stress(case, kind, counts) / TARGET[kind] for counts in meshes]
        label = {"plate": "LE10", "membrane": "LE1"}[kind]
        case.metric(f"{label}: stress yy at D / target", found[-1], 1.0, 0.02)
        change = [abs(b - a) for a, b in zip(found, found[1:], strict=False)]
        case.below(f"{label}: last change / the one before", change[1] / change[0], 0.5)
        ax.plot([n[1] for n in meshes], found, "o-", label=label)
    ax.axhline(1.0, color="k", lw=1, label="target")
    ax.set(xlabel="elements around a quarter [-]", ylabel="stress at D / target [-]")
    ax.legend()
    case.save(fig)
