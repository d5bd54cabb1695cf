"""One ghost on a half space against Boussinesq, many in a cavity against Lame."""

import numpy as np
from coupled import write_deck

from talus.mesh import structured
from talus.verification import Case, field_steps, write_hex_mesh, write_packing

SHEAR, POISSON, STIFFNESS = 4.0e6, 0.25, 1.0e6
RADIUS = 0.4e-3
WIDE, HALF = 0.15, 13  # half width of the ground [m], elements of it
INNER, OUTER, PIECES, PRESSURE = 0.01, 0.02, 10, 1.0e4


def young(shear: float) -> float:
    """Young's modulus [Pa]."""
    return 2 * shear * (1 + POISSON)


def load(case: Case, points: np.ndarray, inward: np.ndarray, force: np.ndarray) -> None:
    """Write ghosts at points, each pressed along `inward` by a grain with a force [N]."""
    n = len(points)
    away = (2 * RADIUS - force / STIFFNESS)[:, None] * inward
    x = np.vstack([points, points - away])
    ids = np.arange(1, 2 * n + 1)
    kind = np.repeat([1, 0], n)
    write_packing(
        case.folder / "pack.h5", x, np.full((2 * n, 3), RADIUS), kind=kind, ids=ids,
        groups={"ghosts": ids[:n]},
    )  # fmt: skip


def solve(case: Case, shear: float, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Run; return nodes, displacements, and what the ghosts were pressed with."""
    for path in (*case.folder.glob("grains.h5"), *case.folder.glob("solid.h5")):
        path.unlink()
    text = (case.folder / "solid.nml").read_text()
    write_deck(case, "solid.nml", "solid.nml", young=f"{young(shear):.17g}")
    case.run("talus-couple", write_deck(case, f"{name}.nml", "coupled.nml"))
    (case.folder / "solid.nml").write_text(text)
    import h5py

    with h5py.File(case.folder / "solid.h5") as file:
        x = file["mesh/x"][...]
    grains = field_steps(case.folder / "grains.h5")[0].grains
    return x, field_steps(case.folder / "solid.h5")[-1].solid["u"], grains["force"]


def half_space(case: Case, ax: object) -> None:
    """Judge the displacement of the surface: A/r - B, as the far faces stand still."""
    lines = []
    for n in (2 * HALF + 1, HALF):
        k = np.arange(n + 1) - (0 if n == HALF else HALF + 0.5)
        growth = 0.28
        scale = WIDE / np.sinh(growth * (HALF + 0.5))
        lines.append(scale * np.sinh(growth * k))
    across, depth = lines[0], -lines[1][::-1] * WIDE / lines[1][-1]
    x, hex8 = structured((across, across, depth))
    far = (np.abs(x[:, :2]).max(1) > 0.999 * WIDE) | (x[:, 2] < -0.999 * WIDE)
    top = np.isclose(x[:, 2], 0.0)
    upper = hex8[top[hex8].sum(1) == 4][:, 4:]
    write_hex_mesh(
        case.folder / "ground.h5", x, hex8, facets={"face": upper},
        nodes={"outer": np.flatnonzero(far)},
    )  # fmt: skip
    force = 0.05
    load(case, np.zeros((1, 3)), np.array([[0.0, 0.0, -1.0]]), np.array([force]))
    x, u, given = solve(case, SHEAR, "half_space")
    case.metric("half space: force on the ghost [N]", float(-given[0, 2]), force, 1e-6)
    r = np.hypot(x[:, 0], x[:, 1])
    step = across[HALF + 1] - across[HALF]
    ring = np.isclose(x[:, 2], 0.0) & (r > 3 * step) & (r < 0.25 * WIDE)
    fit = np.linalg.lstsq(np.stack([1 / r[ring], np.ones(ring.sum())], 1), -u[ring, 2], rcond=None)
    exact = (1 - POISSON) * force / (2 * np.pi * SHEAR)
    case.metric("half space: A over Boussinesq's", float(fit[0][0] / exact), 1.0, 0.02)
    left = (-u[ring, 2] - fit[0][1]) * r[ring] / exact
    case.below("half space: r u_z off the point load", float(np.abs(left - 1).max()), 0.05, "mesh")
    near = np.geomspace(2 * step, 0.25 * WIDE, 200)
    ax.loglog(1e3 * near, exact / near, label="Boussinesq")
    ax.loglog(1e3 * r[ring], -u[ring, 2] - fit[0][1], ".", ms=4, label="Talus")
    ax.set(xlabel="distance from the ghost [mm]", ylabel="settlement of the surface [m]")
    ax.legend()


def shell(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes, hexahedra and inner facets of a spherical shell: six blocks of n x n x n."""
    angle = np.linspace(-np.pi / 4, np.pi / 4, n + 1)
    radius = np.geomspace(INNER, OUTER, n + 1)
    points, cells = [], []
    for axis in range(3):
        for sign in (1.0, -1.0):
            x, hex8 = structured((angle, angle, radius))
            normal, one = np.zeros(3), np.zeros(3)
            normal[axis], one[(axis + 1) % 3] = sign, 1.0
            two = np.cross(normal, one)
            way = normal + np.tan(x[:, :1]) * one + np.tan(x[:, 1:2]) * two
            points.append(x[:, 2:] * way / np.linalg.norm(way, axis=1)[:, None])
            cells.append(hex8 + len(x) * len(cells))
    x, hex8 = np.vstack(points), np.vstack(cells)
    _, first, number = np.unique(
        np.rint(x / (1e-6 * INNER)).astype(int), axis=0, return_index=True, return_inverse=True
    )
    x, hex8 = x[first], number.ravel()[hex8]
    inside = np.isclose(np.linalg.norm(x, axis=1), INNER)
    return x, hex8, hex8[inside[hex8].sum(1) == 4][:, :4]


def cavity(case: Case) -> None:
    """Judge how far pressure opens the tuned shell, and one that is not tuned."""
    x, hex8, face = shell(PIECES)
    outer = np.flatnonzero(np.isclose(np.linalg.norm(x, axis=1), OUTER))
    write_hex_mesh(
        case.folder / "ground.h5", x, hex8, facets={"face": face}, nodes={"outer": outer}
    )
    middle = x[face].mean(1)
    diagonals = x[face[:, 2]] - x[face[:, 0]], x[face[:, 3]] - x[face[:, 1]]
    area = 0.5 * np.linalg.norm(np.cross(*diagonals), axis=1)
    way = middle / np.linalg.norm(middle, axis=1)[:, None]
    load(case, middle, way, PRESSURE * area)
    volume, beta = (INNER / OUTER) ** 3, 2 * (1 + POISSON) / (1 - 2 * POISSON)
    factor = 4 * (1 - volume) / (4 + beta * volume)
    for name, shear in (("tuned", SHEAR * factor), ("not_tuned", SHEAR)):
        x, u, given = solve(case, shear, f"cavity_{name}")
        inside = np.isclose(np.linalg.norm(x, axis=1), INNER)
        opened = (u[inside] * x[inside]).sum(1) / INNER
        pressure = (given[: len(way)] * way).sum() / (4 * np.pi * INNER**2)
        stiffness = pressure / opened.mean() * INNER / (4 * SHEAR)
        label = f"cavity, {name.replace('_', ' ')}: stiffness over 4 G/a"
        if name == "tuned":
            case.metric(label, float(stiffness), 1.0, 0.02, "facets are flat")
            case.below("cavity: roundness", float(np.ptp(opened) / opened.mean()), 0.1, "mesh")
        else:
            case.metric(label, float(stiffness), 1 / factor, 0.02 / factor, "Lame's shell")


def run(case: Case) -> None:
    """Judge both."""
    fig, ax = case.figure()
    half_space(case, ax)
    case.save(fig)
    cavity(case)
