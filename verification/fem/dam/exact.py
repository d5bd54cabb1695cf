"""Flow through a rectangular dam against Charny's theorem."""

import numpy as np

from talus import mesh as meshes
from talus.verification import Case, field_steps, read_history

CONDUCTIVITY, WEIGHT, VISCOSITY = 1.0e-5, 9810.0, 1.0e-3
UP, DOWN, LENGTH, FRINGE, ELEMENTS = 1.0, 0.2, 1.0, 0.02, 40
MOST_CORRECTIONS = 6
LOW = 0.6  # head of the full block upstream [m]


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


def signorini(n: int) -> tuple[float, float]:
    """Return flow over conductivity [m] and the exit point of the full block, by differences.

    Heads h with laplace h = 0, held at x = 0, impervious below and above, and at the face h <= z,
    outflow, one of both equal: over-relaxed and cut off at z there.
    """
    z = np.linspace(0, UP, n + 1)
    h = np.full((n + 1, n + 1), LOW)
    even = np.add.outer(np.arange(1, n + 1), np.arange(n + 1)) % 2 == 0
    change, swifter = 1.0, 2 / (1 + np.sin(np.pi / n / 2))
    wider = np.empty((n + 2, n + 3))
    while change > 1e-13:
        change = 0.0
        for turn in (even, ~even):
            wider[:-1, 1:-1] = h
            wider[-1] = wider[-3]  # nothing passes the face but where it holds
            wider[:, 0], wider[:, -1] = wider[:, 2], wider[:, -3]
            mean = wider[2:, 1:-1] + wider[:-2, 1:-1] + wider[1:-1, 2:] + wider[1:-1, :-2]
            new = h[1:] + swifter * (mean / 4 - h[1:])
            new[-1] = np.minimum(new[-1], z)
            change = max(change, float(abs(new - h[1:])[turn].max()))
            h[1:][turn] = new[turn]
    shares = np.ones(n + 1)
    shares[[0, -1]] = 0.5
    return float(shares @ (h[0] - h[1])), float(z[h[-1] >= z - 1e-10].max())


def judge_full(case: Case) -> None:
    """Judge flow and exit point of a block whose pores stay full."""
    text = (case.folder / "full.nml").read_text().replace("MESH", "mesh")
    text = text.replace("PERMEABILITY", repr(CONDUCTIVITY * VISCOSITY / WEIGHT))
    (case.folder / "block.nml").write_text(text)
    case.run("talus-fem", "block.nml")
    books = read_history(case.folder / "block_pore.csv")
    x = meshes.read_mesh(case.folder / "mesh.h5").x
    p = field_steps(case.folder / "block.h5")[-1].solid["pore_pressure"]
    face = np.isclose(x[:, 0], LENGTH)
    flow, top = signorini(160)
    found = -books["x1 seepage inflow"][-1] / (LENGTH / ELEMENTS) / CONDUCTIVITY
    case.metric("full: flow / that of differences", float(found / flow), 1.0, 0.01)
    case.metric("full: exit point [m]", float(x[face & (p >= 0), 2].max()), top, UP / ELEMENTS)
    case.below("full: largest pressure of the face [Pa]", float(p[face].max()), 0.0)
    newton = read_history(case.folder / "block_newton.csv")
    case.below("full: corrections of a step", float(newton["iteration"].max()), MOST_CORRECTIONS)


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
    judge_full(case)
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
