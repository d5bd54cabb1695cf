"""Closed bodies in a saturated bed: a plug, a ball held, free or at rest, a block pushed in."""

from pathlib import Path

import numpy as np
from same_bits import judge
from triangle_nets import write_triangles

from talus.packing import FIXED, make_packing, write_h5
from talus.verification import Case, read_history

D = 1.0e-3
BOX, RADIUS = 0.03, 7.5e-3
CELLS = 40  # of the reference, along half the box
MOBILITY, DROP = 1.0e-9, 300.0


def block(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the triangles of a block, normals outwards."""
    p = [[(low, high)[i >> k & 1][k] for k in range(3)] for i in range(8)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    corners = [(f[0], f[k], f[k + 1]) for f in faces for k in (1, 2)]
    return np.array(p)[np.array(corners)]


def ball(times: int) -> np.ndarray:
    """Return the triangles of a ball of the volume of the radius, halved so many times."""
    tri = np.array(
        [[[x, 0, 0], [0, y, 0], [0, 0, z]] for x in (1, -1) for y in (1, -1) for z in (1, -1)],
        float,
    )
    flipped = np.prod(tri.sum(1), axis=1) < 0.0
    tri[flipped] = tri[flipped][:, ::-1]
    for _ in range(times):
        a, b, c = tri[:, 0], tri[:, 1], tri[:, 2]
        ab, bc, ca = (0.5 * (s + t) for s, t in ((a, b), (b, c), (c, a)))
        parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        tri = np.concatenate([np.stack(part, 1) for part in parts])
        tri /= np.linalg.norm(tri, axis=2, keepdims=True)
    volume = np.einsum("ij,ij->i", tri[:, 0], np.cross(tri[:, 1], tri[:, 2])).sum() / 6.0
    return tri * RADIUS * (4.0 * np.pi / 3.0 / volume) ** (1.0 / 3.0) + 0.5 * BOX


def lattice(*count: int) -> np.ndarray:
    """Return the centres of a simple cubic lattice [m]."""
    places = np.meshgrid(*(np.arange(k) for k in count), indexing="ij")
    return D * (np.stack(places, -1).reshape(-1, 3) + 0.5)


def write_bed(path: Path, x: np.ndarray, fixed: bool) -> None:
    """Write spheres that are fixed or free."""
    kind = np.full(len(x), FIXED) if fixed else None
    write_h5(path, make_packing(x, np.full((len(x), 3), 0.5 * D), kind=kind))


def around_ball() -> tuple[float, float]:
    """Return the force on a ball held, over V grad p, and against its motion, over V U/kappa.

    An eighth of the box in cubes: Laplace's equation, no flow through ball and sides; p = 0 in the
    middle plane, and at the end -1 for the first, 0 for the second.
    """
    edge = 0.5 * BOX / CELLS
    at = edge * (np.arange(CELLS) + 0.5)
    x, y, z = np.meshgrid(at, at, at, indexing="ij")
    open_cell = x**2 + y**2 + z**2 > RADIUS**2
    links = [
        open_cell.take(range(1, CELLS), k) & open_cell.take(range(CELLS - 1), k) for k in range(3)
    ]
    last = open_cell[:, :, -1]
    first = open_cell[:, :, 0]

    def flow(p: np.ndarray) -> np.ndarray:
        out = np.zeros_like(p)
        for k in range(3):
            low = tuple(slice(0, CELLS - 1) if j == k else slice(None) for j in range(3))
            high = tuple(slice(1, CELLS) if j == k else slice(None) for j in range(3))
            q = links[k] * (p[high] - p[low])
            out[low] -= q
            out[high] += q
        out[:, :, 0] += 2.0 * first * p[:, :, 0]
        out[:, :, -1] += 2.0 * last * p[:, :, -1]
        return out * open_cell + ~open_cell * p

    def solve(rhs: np.ndarray) -> np.ndarray:
        p = np.zeros_like(rhs)
        r = rhs - flow(p)
        s, rho = r.copy(), (r * r).sum()
        while rho > 1e-20 * (rhs * rhs).sum():
            q = flow(s)
            step = rho / (s * q).sum()
            p += step * s
            r -= step * q
            rho, before = (r * r).sum(), rho
            s = r + rho / before * s
        return p

    above = open_cell.copy()  # cells over the ball
    above[:, :, 1:] &= ~open_cell[:, :, :-1]
    above[:, :, 0] = False
    volume = np.pi / 6.0 * RADIUS**3  # of an eighth of the ball
    rhs = np.zeros_like(x)
    rhs[:, :, -1] = -2.0 * last
    held = -solve(rhs)[above].sum() * edge**2 / (volume / (0.5 * BOX))
    p = solve(above * edge)  # for U/kappa = 1 each cell takes U edge^2
    moved = -(p[above] + 0.5 * edge).sum() * edge**2 / volume
    return float(held), float(-moved)


def run(case: Case) -> None:
    """Plug, ball and push."""
    plug(case)
    balls(case)
    push(case)


def plug(case: Case) -> None:
    """Press on a block across a bed."""
    x = lattice(12, 12, 36)
    low, high = 0.0145, 0.0215
    write_bed(case.folder / "column.h5", x[(x[:, 2] < low) | (x[:, 2] > high)], True)
    write_triangles(
        case.folder / "plug.stl", block([-0.01, -0.01, low + 5e-4], [0.022, 0.022, high - 5e-4])
    )
    case.run("talus-dem", "plug.nml", "--threads=1")
    row = {k: v[-1] for k, v in read_history(case.folder / "plug_tools.csv").items()}
    off = abs(row["force_z"] / (1.0e3 * 0.012**2) - 1.0)
    case.below("plug: force / (dp A), error", float(off), 1e-3)
    case.below("plug: volume in the grid, error", abs(row["volume"] / (0.012**2 * 6e-3) - 1), 0.01)


def balls(case: Case) -> None:
    """Hold a ball in a flow, let it drift, let it rest."""
    held, moved = around_ball()
    x = lattice(30, 30, 30)
    away = np.linalg.norm(x - 0.5 * BOX, axis=1)
    write_bed(case.folder / "bed.h5", x[away > RADIUS + 0.5 * D + 5e-5], True)
    write_triangles(case.folder / "ball.stl", ball(4))
    case.run("talus-dem", "ball.nml", "--threads=1")
    tools = read_history(case.folder / "ball_tools.csv")
    volume = 4.0 / 3.0 * np.pi * RADIUS**3
    found = tools["force_z"][-1] / (volume * DROP / BOX)
    case.below("ball held: force / exact, error", float(abs(found / held - 1.0)), 0.05)
    across = np.hypot(tools["force_x"][-1], tools["force_y"][-1])
    case.below("ball held: force across / along", float(across / tools["force_z"][-1]), 1e-3)
    text = (case.folder / "ball.nml").read_text()
    free = "&body surface = 'ball', free = 'x', 'y', 'z', density = 1000.0 /\n"
    drift(case, text + free, held / moved)
    still = text.replace("t_end = 2.0e-4", "t_end = 2.0e-4, gravity = 0.0, 0.0, -9.81")
    (case.folder / "rest.nml").write_text(still.replace("300.0", "0.0") + free)
    case.run("talus-dem", "rest.nml", "--threads=1")
    speed = np.abs(read_history(case.folder / "rest_bodies.csv")["velocity_z"]).max()
    case.below("ball at rest: velocity / (g t)", float(speed / (9.81 * 2.0e-4)), 1e-9)


def drift(case: Case, text: str, exact: float) -> None:
    """Let the ball go in bricks of three sizes: it drifts with a velocity that converges."""
    fine = 2.0 / 3.0 * lattice(45, 45, 45)
    away = np.linalg.norm(fine - 0.5 * BOX, axis=1)
    fine = fine[away > RADIUS + D / 3.0 + 5e-5]
    axes_of = np.full((len(fine), 3), D / 3.0)
    write_h5(case.folder / "fine.h5", make_packing(fine, axes_of, kind=np.full(len(fine), FIXED)))
    fig, axes = case.figure(figsize=(5.0, 3.6))
    found = []
    for bricks in (5, 10, 15):
        now = text.replace("bricks = 10, 10, 10", f"bricks = {bricks}, {bricks}, {bricks}")
        (case.folder / "drift.nml").write_text(
            now.replace("bed.h5", "fine.h5" if bricks > 10 else "bed.h5")
        )
        case.run("talus-dem", "drift.nml", "--threads=1")
        body = read_history(case.folder / "drift_bodies.csv")
        found.append(float(body["velocity_z"][-1] / (MOBILITY * DROP / BOX)))
        axes.plot(1e6 * body["time"], body["velocity_z"] / (MOBILITY * DROP / BOX), "o", ms=3,
                  label=f"ball, R = {bricks / 4} bricks")  # fmt: skip
        energy = read_history(case.folder / "drift_energy.csv")["relative_closure"]
        case.below(f"ball free, {bricks} bricks: closure of the ledger", float(energy.max()), 1e-4)
    rate = np.log((found[1] - exact) / (found[2] - exact)) / np.log(1.5)
    case.metric("ball free: order in the size of bricks", float(rate), 1.0, 0.3)
    limit = found[2] - (found[1] - found[2]) / (1.5 - 1.0)
    case.below(
        "ball free: velocity for small bricks / exact, error", abs(limit / exact - 1.0), 0.05
    )
    axes.plot([0.0, 200.0], [exact] * 2, color="black", label="exact")
    axes.set(xlabel="time [us]", ylabel="velocity / (kappa grad p) [-]")
    axes.legend(fontsize=8)
    case.save(fig)


def push(case: Case) -> None:
    """Push a block into a sealed box; restart; two threads."""
    x = lattice(12, 12, 16)
    inside = (np.abs(x[:, :2] - 0.006) < 3.5e-3).all(1) & (x[:, 2] > 0.0095)
    write_bed(case.folder / "loose.h5", x[~inside], False)
    write_triangles(
        case.folder / "block.stl", block([0.003, 0.0035, 0.0105], [0.0087, 0.009, 0.02])
    )
    area = 5.7e-3 * 5.5e-3
    case.run("talus-dem", "push.nml", "--threads=1")
    rows = read_history(case.folder / "push_pore.csv")
    case.below("push: liquid from nowhere / pores", float(rows["balance"].max()), 1e-12)
    swept = rows["swept"][-1] / (area * 0.05 * 4.5e-4)
    case.below("push: volume that is swept, error", float(abs(swept - 1.0)), 1e-6)
    tools = read_history(case.folder / "push_tools.csv")
    pressure = 0.5 * (rows["least_pressure"][-1] + rows["most_pressure"][-1])
    off = abs(tools["force_z"][-1] / (pressure * area) - 1.0)
    case.below("push: force on the block / (p A), error", float(off), 0.01)
    closure = read_history(case.folder / "push_energy.csv")["relative_closure"].max()
    case.below("push: closure of the ledger", float(closure), 1e-4)
    bits(case, x[~inside])


def bits(case: Case, x: np.ndarray) -> None:
    """Let a rod go below the block: the ledger, a restart within an exchange, two threads."""
    from_axis = np.hypot(x[:, 0] - 0.006, x[:, 2] - 0.005)
    write_bed(
        case.folder / "rod.h5",
        x[(from_axis > 2.55e-3) | (np.abs(x[:, 1] - 0.006) > 3.55e-3)],
        False,
    )
    text = (case.folder / "push.nml").read_text().replace("loose.h5", "rod.h5")
    text = text.replace("t_end = 1.0e-3", "t_end = 1.0e-3, gravity = 0.0, 0.0, -9.81")
    rod = (
        "&cylinder id = 'rod', centre = 0.006, 0.006, 0.005, axis = 0.0, 1.0, 0.0, radius = 0.002, "
    )
    rod += "length = 0.006, side = 'outside', material = 'grain', spin = 0.0, 40.0, 0.0 /\n"
    body = "&body surface = 'rod', free = 'x', 'y', 'z', 'rx', 'ry', 'rz', density = 3000.0 /\n"
    (case.folder / "bits.nml").write_text(text + rod + body)
    case.run("talus-dem", "bits.nml", "--threads=1")
    rows = read_history(case.folder / "bits_pore.csv")
    case.below(
        "rod below the block: liquid from nowhere / pores", float(rows["balance"].max()), 1e-12
    )
    closure = read_history(case.folder / "bits_energy.csv")["relative_closure"].max()
    case.below("rod below the block: closure of the ledger", float(closure), 1e-4)
    judge(case, "bits", "rod below the block, ")
