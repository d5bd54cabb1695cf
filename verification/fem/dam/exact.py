"""Flow through a rectangular dam against Charny's theorem."""

import numpy as np

from talus import mesh as meshes
from talus.verification import Case, field_steps, read_history

CONDUCTIVITY, WEIGHT, VISCOSITY = 1.0e-5, 9810.0, 1.0e-3
UP, DOWN, LENGTH, FRINGE, ELEMENTS = 1.0, 0.2, 1.0, 0.02, 40
MOST_CORRECTIONS = 6


def build(case: Case) -> meshes.Mesh:
    """Write the mesh, its face downstream split at the level."""
    n = ELEMENTS
    mesh = meshes.box(np.zeros(3), np.array([LENGTH, LENGTH / n, UP]), (n, 1, n))
    side = np.asarray(mesh.facets["x1"])
    middle = mesh.x[side][:, :, 2].mean(axis=1)
    mesh.facets |= {"toe": side[middle < DOWN], "face": side[middle > DOWN]}
    meshes.write_mesh(case.folder / "mesh.h5", mesh)
    return mesh


def baiocchi(n: int) -> np.ndarray:
    """Return the shares of Charny's flow that leave downstream above n + 1 heights, without fringe.

    Baiocchi's w(x, z), the pressure head summed from z to the top, solves laplace w = 1 where w > 0
    with known values on the rectangle: an obstacle problem. Over-relaxed and cut off at 0.
    """
    z = np.linspace(0, UP, n + 1)
    w = np.zeros((n + 1, n + 1))
    w[0] = (UP - z) ** 2 / 2
    w[-1] = np.maximum(DOWN - z, 0) ** 2 / 2
    w[:, 0] = UP**2 / 2 - (UP**2 - DOWN**2) * z / (2 * LENGTH)
    even = np.add.outer(np.arange(1, n), np.arange(1, n)) % 2 == 0
    inner = w[1:-1, 1:-1]
    change, swifter = 1.0, 2 / (1 + np.sin(np.pi / n))
    while change > 1e-14:
        change = 0.0
        for turn in (even, ~even):
            mean = (w[:-2, 1:-1] + w[2:, 1:-1] + w[1:-1, :-2] + w[1:-1, 2:] - 1 / n**2) / 4
            new = np.maximum(0, inner + swifter * (mean - inner))
            change = max(change, float(abs(new - inner)[turn].max()))
            inner[turn] = new[turn]
    return -(3 * w[-1] - 4 * w[-2] + w[-3]) * n * LENGTH / (UP**2 - DOWN**2)


def potential(head: np.ndarray) -> np.ndarray:
    """Integral of the relative permeability over the pressure head [m]."""
    return np.where(head > 0, head, FRINGE * np.expm1(np.minimum(head, 0) / FRINGE))


def judge_flow(case: Case, z: np.ndarray, head: np.ndarray) -> None:
    """Judge the flow by heads of the face downstream, and what the face lets out."""
    books = read_history(case.folder / "run_pore.csv")
    width = LENGTH / ELEMENTS
    flow = books["x0 inflow"][-1] / width
    charny = CONDUCTIVITY * (UP**2 - DOWN**2) / (2 * LENGTH)
    case.metric("flow / Charny's", float(flow / charny), 1.0, 0.03)
    fringe = CONDUCTIVITY / LENGTH * (UP**2 / 2 - np.trapezoid(potential(head), z))
    case.metric("flow / that with its fringe", float(flow / fringe), 1.0, 0.01)
    case.below("face: largest inflow [m3/s]", float(books["face seepage inflow"].max()), 0.0)
    above = z > DOWN + 1e-9
    case.below("face: pressure head / level", float(head[above].max() / UP), 0.0)
    face = -books["face seepage inflow"][-1] / width
    out = face - books["toe inflow"][-1] / width
    fine, size = 160, UP / ELEMENTS
    shares = baiocchi(fine)
    heights = np.linspace(0, UP, fine + 1)
    share = np.interp(DOWN + size / 2, heights, shares)  # the node at the level has its own half
    case.metric("flow of the face / that of Baiocchi", float(face / out / share), 1.0, 0.05)
    top = float(heights[shares > 1e-3].max())
    exit_at = float(z[above & (head >= 0)].max())
    case.metric("exit point [m]", exit_at, top, FRINGE + size)
    case.metric("flow out / in", float(out / flow), 1.0, 1e-3)
    off = abs(books["balance"]).max() / abs(books["x0 entered"]).max()
    case.below("liquid unaccounted for", float(off), 1e-12)


def run(case: Case) -> None:
    """Judge flow, face and corrections; plot heads and the face."""
    mesh = build(case)
    text = (case.folder / "deck.nml").read_text()
    values = {"MESH": "mesh", "PERMEABILITY": repr(CONDUCTIVITY * VISCOSITY / WEIGHT),
              "GARDNER": repr(1 / (FRINGE * WEIGHT))}  # fmt: skip
    for key, value in values.items():
        text = text.replace(key, value)
    (case.folder / "run.nml").write_text(text)
    case.run("talus-fem", "run.nml")
    head = field_steps(case.folder / "run.h5")[-1].solid["pore_pressure"] / WEIGHT
    plane = np.flatnonzero(np.isclose(mesh.x[:, 1], 0.0))
    face = plane[np.isclose(mesh.x[plane, 0], LENGTH)]
    face = face[np.argsort(mesh.x[face, 2])]
    judge_flow(case, mesh.x[face, 2], head[face])
    newton = read_history(case.folder / "run_newton.csv")
    case.below("corrections of a step", float(newton["iteration"].max()), MOST_CORRECTIONS)
    fig, (ax, bx) = case.figure(ncols=2)
    x, z = mesh.x[plane, 0], mesh.x[plane, 2]
    shown = ax.tricontourf(x, z, head[plane] + z, levels=np.linspace(0.2, 1.0, 9))
    ax.tricontour(x, z, head[plane], levels=[0.0], colors="k")
    fig.colorbar(shown, ax=ax, label="head [m]")
    ax.set(xlabel="x [m]", ylabel="z [m]", title="phreatic line", aspect="equal")
    bx.plot(np.maximum(DOWN - mesh.x[face, 2], 0.0), mesh.x[face, 2], "k-", lw=1, label="water")
    bx.plot(head[face], mesh.x[face, 2], "o", ms=4, mfc="none", label="face")
    bx.set(xlabel="pressure head [m]", ylabel="z [m]")
    bx.legend(loc="lower left")
    case.save(fig)
