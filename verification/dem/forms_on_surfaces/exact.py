"""Forms on triangles against the analytic plane; a bed of them among surfaces of all kinds."""

import numpy as np
import same_bits
from triangle_nets import pyramids, rough_net, write_stl

from talus.compare import max_of
from talus.generate import random_quaternions
from talus.packing import make_packing, write_h5
from talus.verification import Case, field_steps, read_history

AXES = [2.5e-3, 2.0e-3, 1.5e-3]
FORMS = {
    "poly-ellipsoid": ([0.3, -0.2, 0.1], 2.0),
    "superquadric": ([0.0, 0.0, 0.0], 4.0),
    "both": ([-0.2, 0.1, 0.2], 3.0),
}
WALL = "&wall id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'quartz' /\n"
SURFACE = "&surface id = 'floor', file = 'floor.stl', material = 'quartz' /\n"
ONE = "&dynamics dt = 2.0e-6 /\n&output every_time = 1.0e-3 /\n&history every_time = 1.0e-3 /\n"
CHAMBER = """&surface id = 'floor', file = 'pyramids.stl', material = 'quartz' /
&cylinder id = 'chamber', side = 'inside', radius = 9.8e-3, centre = 0.0, 0.0, 0.0,
          axis = 0.0, 0.0, 1.0, material = 'quartz' /
&penetrometer id = 'cone', tip = 0.0, 0.0, 9.0e-3, axis = 0.0, 0.0, 1.0, apex_deg = 60.0,
          diameter = 4.0e-3, shaft = 0.05, material = 'quartz' /
&dynamics dt_factor = 0.07 /
&history every_time = 1.0e-3 /
&output every_time = 0.03, fields = 'contacts' /
&checkpoint every_time = 0.03, keep = 2 /
"""
COLUMNS = ("friction", "contact_damping", "tangential_relaxation")


def write_deck(case: Case, name: str, pack: str, end: float, text: str) -> None:
    """Write the common deck with its own end."""
    deck = (case.folder / "deck.nml").read_text().replace("PACK", pack).replace("END", str(end))
    (case.folder / f"{name}.nml").write_text(deck + text)


def throw(case: Case, shape: str, floor: str, text: str) -> tuple[np.ndarray, ...]:
    """Throw a grain onto a floor; return time [s], position, velocity and spin (n, 3)."""
    packing = make_packing(
        np.array([[-9.0e-3, -8.0e-3, 3.5e-3]]), np.array([AXES]),
        np.array([[0.9, 0.3, -0.2, np.sqrt(1.0 - 0.94)]]),
    )  # fmt: skip
    packing.v[:] = [0.25, 0.2, -0.1]
    packing.omega[:] = [3.0, -5.0, 20.0]
    packing.skew[0], packing.exponent[0] = FORMS[shape]
    write_h5(case.folder / "grain.h5", packing)
    name = f"{shape}_{floor}".replace("-", "_")
    write_deck(case, name, "grain", 0.04, text + ONE)
    case.run("talus-dem", f"{name}.nml")
    steps = field_steps(case.folder / f"{name}.h5")
    return np.array([s.time for s in steps]), *(
        np.array([s.grains[key][0] for s in steps]) for key in ("x", "v", "omega")
    )


def throws(case: Case, ax: object) -> None:
    """Judge motion on triangles against the plane."""
    write_stl(case.folder / "floor.stl", rough_net())
    for shape in FORMS:
        time, x, v, w = throw(case, shape, "wall", WALL)
        _, x1, v1, w1 = throw(case, shape, "triangles", SURFACE)
        off = max_of(np.abs(x1 - x).max() / AXES[0], np.abs(v1 - v).max(),
                  np.abs(w1 - w).max() * AXES[0])  # fmt: skip
        case.below(f"{shape}: place / size, velocity, spin x size off the plane's", off, 1e-10)
        case.above(f"{shape}: way over the triangles [mm]",
                   1e3 * np.linalg.norm(x1[-1] - x1[0]), 8.0)  # fmt: skip
        (line,) = ax.plot(1e3 * time, 1e3 * x[:, 2], "-", label=f"{shape}, plane")
        ax.plot(1e3 * time[::3], 1e3 * x1[::3, 2], "o", ms=4, color=line.get_color(),
                label="triangles")  # fmt: skip
    ax.set(xlabel="time [ms]", ylabel="height of the centre [mm]")
    ax.legend(fontsize=8)


def bed(case: Case, ax: object) -> None:
    """Judge ledger, threads and restart of a bed among surfaces."""
    write_stl(case.folder / "pyramids.stl", pyramids())
    rng = np.random.default_rng(3)
    i, j, k = np.meshgrid(np.arange(3), np.arange(3), np.arange(4), indexing="ij")
    x = np.column_stack([i.ravel() - 1, j.ravel() - 1, k.ravel()]) * [5.2e-3, 5.2e-3, 5.5e-3]
    x = x + [0.0, 0.0, 6.0e-3]
    x = x[np.hypot(x[:, 0], x[:, 1]) > 1e-3]
    axes = np.tile([2.2e-3, 1.8e-3, 1.4e-3], (len(x), 1))
    kind = np.arange(len(x)) % 4
    axes[kind == 0] = 2.0e-3
    packing = make_packing(x, axes, random_quaternions(rng, len(x)))
    packing.skew[kind == 2] = rng.uniform(-0.3, 0.3, (8, 3))
    packing.exponent[kind == 3] = rng.uniform(2.5, 6.0, 8)
    write_h5(case.folder / "bed.h5", packing)
    write_deck(case, "chamber", "bed", 0.06, CHAMBER)
    case.run("talus-dem", "chamber.nml", "--threads=1")
    rows = read_history(case.folder / "chamber_energy.csv")
    scale = np.abs(rows["gravity"]).max()
    spent = rows["kinetic"] - rows["kinetic"][0] + rows["elastic"]
    for name in COLUMNS:
        spent = spent + rows[name]
    error = np.abs(rows["gravity"] + rows["boundary"] + rows["curvature"] - spent) / scale
    case.below("bed: largest closure error / work of gravity", float(error.max()), 1e-4)
    last = field_steps(case.folder / "chamber.h5")[-1]
    ids = last.contacts["ids"]
    met = {int(a) for a, b in ids if a < 0} | {int(b) for a, b in ids if b < 0}
    case.above("bed: surfaces with contacts at the end", len(met), 1.5)
    case.below("bed: greatest distance from the axis [mm]",
               1e3 * np.hypot(*last.grains["x"][:, :2].T).max(), 9.8)  # fmt: skip
    case.above("bed: least height [mm]", 1e3 * last.grains["x"][:, 2].min(), 0.5)
    same_bits.judge(case, "chamber", "bed: ")
    ax.plot(rows["time"], rows["gravity"], "-", label="work of gravity")
    for name in ("kinetic", "elastic", "curvature", *COLUMNS):
        ax.plot(rows["time"], rows[name], "--", label=name.replace("_", " "))
    ax.set(xlabel="time [s]", ylabel="energy [J]")
    ax.legend(fontsize=8)


def run(case: Case) -> None:
    """Judge throws and the bed; plot both."""
    fig, axes = case.figure(ncols=2, figsize=(9.0, 3.8))
    throws(case, axes[0])
    bed(case, axes[1])
    case.save(fig)
