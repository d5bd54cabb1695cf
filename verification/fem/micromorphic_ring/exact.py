"""Thick micromorphic rings that yield: orders of displacement, stress and micro-deformation."""

import numpy as np
from solid import save

from talus.mesh import Mesh, boundary_faces, structured
from talus.verification import Case, field_steps, read_history

INNER, OUTER = 1.0, 2.0
SIZES = (4, 8, 16, 32)
ELASTIC = """&micromorphic id = 'soil', density = 1600.0, micro_inertia = 1.0e-3, lambda = 8.0e6,
              mu = 10.0e6, eta = 20.0e6, tau = 2.5e6, kappa = 15.0e6, nu = 10.0e6, sigma = 5.0e6,
              taus = 0, 0, 0, 0, 0, 0, 1.0e6, 0, 0, 0, 0 /
"""
LAWS = {
    "ellipse": "".join(
        f"&cone level = '{level}', kind = 'ellipse', critical_slope = 1.2, preconsolidation = "
        f"{cap}, tension = 5.0e3, exponent = 30.0 /\n"
        for level, cap in (("macro", 1.001e5), ("micro", 1.001e5))
    ),
    "breakage": """&cone level = 'macro', kind = 'breakage', critical_slope = 1.2, tension = 1.0e3,
      breakage_energy = 4.0e2, breakage_angle_deg = 60.0, grain_size_max = 2.0e-3,
      grain_size_min = 2.0e-5 /
""",
}  # fmt: skip
LOADS = {"ellipse": ("1.3e5, 1.55e5, 1.8e5", "1.2e5, 1.35e5, 1.5e5"),
         "breakage": ("1.25e5, 1.35e5, 1.45e5", "1.2e5, 1.28e5, 1.36e5")}  # [Pa]


def quarter(n: int) -> Mesh:
    """Return a quarter of the ring, n cells through the wall and along."""
    line = np.linspace(0.0, 1.0, n + 1)
    s, cells = structured((line, line, np.array([0.0, 1.0 / n])))
    mesh = Mesh(s, cells, {"all": np.arange(len(cells))})
    faces = [q for _, q in boundary_faces(cells).values()]
    for name, at in (("inner", 0.0), ("outer", 1.0)):
        mesh.facets[name] = np.array([q for q in faces if np.isclose(s[q][:, 0], at).all()])
    r, angle = INNER + (OUTER - INNER) * s[:, 0], 0.5 * np.pi * s[:, 1]
    mesh.x = np.column_stack([r * np.cos(angle), r * np.sin(angle), s[:, 2]])
    for name, k in (("x0", 0), ("y0", 1)):
        mesh.nodes[name] = np.flatnonzero(np.isclose(mesh.x[:, k], 0.0, atol=1e-9))
    mesh.nodes["z"] = np.arange(len(mesh.x))
    return mesh


def values_of(case: Case, name: str, n: int) -> np.ndarray:
    """Run a ring; return displacement, radial micro-deformation and mean stress at the hole."""
    mesh = quarter(n)
    stem = f"{name}_{n}"
    save(mesh, case.folder / f"{stem}.h5m")
    words = {"MESH.h5": f"{stem}.h5m", "LAW": ELASTIC + LAWS[name], "NAME": name,
             "INNER": LOADS[name][0], "OUTER": LOADS[name][1]}  # fmt: skip
    text = (case.folder / "deck.nml").read_text()
    for word, value in words.items():
        text = text.replace(word, value)
    (case.folder / f"{stem}.nml").write_text(text)
    case.run("talus-fem", f"{stem}.nml")
    steps = field_steps(case.folder / f"{stem}.h5")
    if not all(step.solid["yield"].min() >= 1 for step in steps[1:]):
        raise RuntimeError(f"{stem}: not all of the ring yields in three steps")
    if not np.allclose(read_history(case.folder / f"{stem}_newton.csv")["share of the step"], 1.0):
        raise RuntimeError(f"{stem}: a step was cut")
    last = steps[-1].solid
    hole = np.flatnonzero(np.isclose(np.linalg.norm(mesh.x[:, :2], axis=1), INNER))
    normal = mesh.x[hole, :2] / INNER
    u = (last["u"][hole, :2] * normal).sum(1).mean()
    chi = last["phi"].reshape(-1, 3, 3)[hole, :2, :2]
    radial = np.einsum("ni,nij,nj->n", normal, chi, normal).mean()
    middle = np.linalg.norm(mesh.x[mesh.cells["hex8"]].mean(1)[:, :2], axis=1)
    axial = (middle * last["stress"][:, 8]).sum() / middle.sum()
    return np.array([u, radial, axial])


def run(case: Case) -> None:
    """Judge the orders of both laws; plot the differences."""
    fig, axes = case.figure(ncols=2, figsize=(9.4, 3.8))
    for name, ax in zip(LAWS, axes, strict=True):
        found = np.array([values_of(case, name, n) for n in SIZES])
        change = np.abs(np.diff(found, axis=0))
        orders = np.log2(change[-2] / change[-1])
        for title, order, part, last, mark in zip(
            ("displacement of the hole", "micro-deformation at the hole", "mean axial stress"),
            orders, change.T, found[-1], "osd", strict=True,
        ):  # fmt: skip
            case.metric(f"{name}: order of the {title}", float(order), 2.0, 0.2)
            ax.loglog(SIZES[1:], part / abs(last), mark + "-", mfc="none", label=title)
        ax.loglog(SIZES[1:], 0.2 / np.square(SIZES[1:]), "k-", lw=1, label="second order")
        ax.set(xlabel="elements through the wall", ylabel="change from the coarser mesh [-]",
               title=name)  # fmt: skip
        ax.legend(fontsize=7)
    case.save(fig)
