"""Bodies that move freely: flight, a bounce, a plank on rollers, a plate under a dead load."""

from math import gamma
from pathlib import Path

import numpy as np

from talus.compare import max_of
from talus.verification import Case, read_history, write_packing

G, YOUNG, NU, DENSITY, R = 9.81, 1.0e9, 0.25, 2650.0, 2.0e-3
INERTIA = np.array([3.0e-6, 5.0e-6, 7.0e-6])  # of the body that flies [kg m2]
LEAN = np.array([[2.0, -1.0, 2.0], [2.0, 2.0, -1.0], [-1.0, 2.0, 2.0]]) / 3.0  # a rotation
PLATE, LOAD = 0.05, 5.0  # dead load: mass and force [kg], [N]
ROUNDING = 1.0e-9  # between histories on ranks, over the largest value of their unit


def run(case: Case) -> None:
    """Four runs, each with its own closed form or balance; restart and threads of the last."""
    fly(case)
    fly_by_density(case)
    fly_leaning(case)
    bounce = fall(case)
    ledger = [roll(case), press(case)]
    case.below("ledger of plank and plate", max_of(ledger), 1e-4)
    again(case)
    draw(case, bounce)


def go(case: Case, name: str, text: str, x: np.ndarray, damping: float = 0.0) -> None:
    """Run a deck of the common head and its own text, with spheres at x."""
    write_packing(case.folder / f"{name}_pack.h5", x, np.full((len(x), 3), R))
    head = (case.folder / "deck.nml").read_text()
    head = head.replace("NAME", name).replace("DAMPING", f"{damping}")
    (case.folder / f"{name}.nml").write_text(head + text)
    case.run("talus-dem", f"{name}.nml", "--threads=1")


def fly(case: Case) -> None:
    """Throw a body with three moments of inertia: parabola, and a spin that keeps its momentum."""
    end, spin = 0.2, [20.0, 1.0, 30.0]
    v, load = np.array([1.0, -0.5, 2.0]), np.array([0.0, 0.3, 0.0])
    go(case, "fly", f"""&run title = 'Flight', t_end = {end}, gravity = 0.0, 0.0, -{G} /
&surface id = 'body', rectangle = 0.0, 0.0, 1.0, 0.1, 0.0, 1.0, 0.1, 0.1, 1.0, material = 'grain',
  velocity = {v[0]}, {v[1]}, {v[2]}, spin = {spin[0]}, {spin[1]}, {spin[2]} /
&body surface = 'body', free = 'x', 'y', 'z', 'rx', 'ry', 'rz', mass = 0.1,
  inertia = {INERTIA[0]}, {INERTIA[1]}, {INERTIA[2]}, force = {load[0]}, {load[1]}, {load[2]} /
&fixed ids = 1 /
&dynamics dt = 1.0e-5 /
&history every_time = 1.0e-3 /
""", np.array([[0.0, 0.0, -1.0]]))  # fmt: skip
    rows = read_history(case.folder / "fly_bodies.csv")
    t = rows["time"][:, None]
    place = np.stack([rows[c] for c in "xyz"], -1)
    drop = np.array([0.0, 0.0, -G]) + load / 0.1
    exact = place[0] + v * t + 0.5 * drop * t**2
    case.below("flight less the parabola", float(np.abs(place - exact).max()), 1e-11, "[m]")
    w, *axis = (rows[f"turn_{c}"] for c in "wxyz")
    momentum = INERTIA * body_spin(rows, w, np.stack(axis, -1))
    size = np.linalg.norm(momentum, axis=1)
    case.below("change of the angular momentum", float(np.abs(size / size[0] - 1.0).max()), 1e-12)
    energy = 0.5 * (momentum**2 / INERTIA).sum(1)
    change = np.abs(energy / energy[0] - 1.0)
    case.below("change of the energy of the spin", float(change.max()), 1e-6)
    energy = read_history(case.folder / "fly_energy.csv")
    case.below("ledger of the flight", float(energy["relative_closure"].max()), 1e-9)


def body_spin(rows: dict[str, np.ndarray], w: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Turn the spin into the body's frame by its quaternion (w, u)."""
    spin = np.stack([rows[f"spin_{c}"] for c in "xyz"], -1)
    t = 2.0 * np.cross(-u, spin)
    return spin + w[:, None] * t + np.cross(-u, t)


def fly_by_density(case: Case) -> None:
    """Throw a brick of a mesh, anywhere in space: its mass, place and inertia are its volume's."""
    edge, corner, density = np.array([0.1, 0.06, 0.04]), np.array([2.0, -1.0, 3.0]), 2000.0
    path = case.folder / "brick.stl"
    write_brick(path, corner, edge)
    end, spin, load = 0.1, np.array([20.0, 1.0, 30.0]), np.array([0.0, 3.0, 0.0])
    go(case, "brick", f"""&run title = 'Brick', t_end = {end}, gravity = 0.0, 0.0, -{G} /
&surface id = 'brick', file = 'brick.stl', material = 'grain', scale = 1.0, closed = .true.,
  spin = {spin[0]}, {spin[1]}, {spin[2]} /
&body surface = 'brick', free = 'x', 'y', 'z', 'rx', 'ry', 'rz', density = {density},
  force = {load[0]}, {load[1]}, {load[2]} /
&fixed ids = 1 /
&dynamics dt = 1.0e-5 /
&history every_time = 1.0e-3 /
""", np.array([[0.0, 0.0, -1.0]]))  # fmt: skip
    rows = read_history(case.folder / "brick_bodies.csv")
    mass = density * edge.prod()
    t = rows["time"][:, None]
    place = np.stack([rows[c] for c in "xyz"], -1)
    exact = corner + 0.5 * edge + 0.5 * (np.array([0.0, 0.0, -G]) + load / mass) * t**2
    case.below("brick by its density, flight less the parabola", float(np.abs(place - exact).max()),
               1e-11, "[m]")  # fmt: skip
    inertia = mass / 12.0 * ((edge**2).sum() - edge**2)
    w, *axis = (rows[f"turn_{c}"] for c in "wxyz")
    momentum = inertia * body_spin(rows, w, np.stack(axis, -1))
    size = np.linalg.norm(momentum, axis=1)
    case.below("brick by its density, change of the angular momentum",
               float(np.abs(size / size[0] - 1.0).max()), 1e-12)  # fmt: skip


def fly_leaning(case: Case) -> None:
    """Throw the brick of `fly_by_density` turned: its axes are found, and all turns with it."""
    edge, density = np.array([0.1, 0.06, 0.04]), 2000.0
    end, spin = 0.1, LEAN @ np.array([20.0, 1.0, 30.0])
    write_brick(case.folder / "lean.stl", np.array([0.2, -0.1, 0.3]), edge, LEAN)
    go(case, "lean", f"""&run title = 'Leaning brick', t_end = {end} /
&surface id = 'lean', file = 'lean.stl', material = 'grain', scale = 1.0, closed = .true.,
  spin = {", ".join(f"{w:.16e}" for w in spin)} /
&body surface = 'lean', free = 'x', 'y', 'z', 'rx', 'ry', 'rz', density = {density} /
&fixed ids = 1 /
&dynamics dt = 1.0e-5 /
&history every_time = 1.0e-3 /
&checkpoint every_time = 0.05, keep = 9 /
""", np.array([[0.0, 0.0, -1.0]]))  # fmt: skip
    rows = read_history(case.folder / "lean_bodies.csv")
    turn = np.stack([rows[f"turn_{c}"] for c in "wxyz"], -1)
    inertia = density * edge.prod() / 12.0 * ((edge**2).sum() - edge**2)
    inside = body_spin(rows, turn[:, 0], turn[:, 1:]) @ LEAN
    momentum = (inertia * inside) @ LEAN.T
    back = {f"spin_{c}": momentum[:, k] for k, c in enumerate("xyz")}
    momentum = body_spin(back, turn[:, 0], -turn[:, 1:])
    change = np.linalg.norm(momentum - momentum[0], axis=1) / np.linalg.norm(momentum[0])
    case.below("leaning brick, change of the vector of angular momentum",
               float(change.max()), 1e-11)  # fmt: skip
    other = read_history(case.folder / "brick_bodies.csv")
    spins = [np.stack([r[f"spin_{c}"] for c in "xyz"], -1) for r in (rows, other)]
    apart = np.abs(spins[0] - spins[1] @ LEAN.T).max() / np.abs(spins[1]).max()
    case.below("leaning brick, spin less that of the straight one", float(apart), 1e-9)
    energy = read_history(case.folder / "lean_energy.csv")
    case.below("ledger of the leaning brick", float(energy["relative_closure"].max()), 1e-9)
    kept = {"lean_bodies.csv": (case.folder / "lean_bodies.csv").read_text()}
    case.run("talus-dem", "lean.nml", "--restart=lean.chk.1.h5")
    case.same_histories("restart of the leaning brick", kept, ROUNDING)


def write_brick(
    path: Path, corner: np.ndarray, edge: np.ndarray, turn: np.ndarray | None = None
) -> None:
    """Write the twelve triangles of a brick, turned about the origin, as STL in text."""
    x = corner + np.indices((2, 2, 2)).reshape(3, -1).T * edge
    x = x if turn is None else x @ turn.T
    lines = ["solid brick"]
    faces = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    for a, b, c, d in faces:
        for facet in ((a, b, c), (a, c, d)):
            lines += ["facet normal 0 0 0", "outer loop"]
            lines += ["vertex {:.17g} {:.17g} {:.17g}".format(*x[k]) for k in facet]
            lines += ["endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid brick"]) + "\n")


def fall(case: Case) -> dict[str, np.ndarray]:
    """Drop a plate on a fixed sphere without damping; return its rows."""
    mass, speed, end = 0.02, 0.5, 1.0e-3
    stiff = 4.0 / 3.0 * YOUNG / (2.0 * (1.0 - NU**2)) * np.sqrt(R)
    deep = (1.25 * mass * speed**2 / stiff) ** 0.4
    lasts = 2.0 * np.sqrt(np.pi) * gamma(1.4) / gamma(0.9) * deep / speed
    go(case, "fall", f"""&run title = 'Plate on a fixed sphere', t_end = {end} /
&surface id = 'plate', rectangle = -0.01, -0.01, {2 * R}, 0.01, -0.01, {2 * R}, 0.01, 0.01, {2 * R},
  material = 'smooth', velocity = 0.0, 0.0, -{speed} /
&body surface = 'plate', free = 'z', mass = {mass} /
&fixed ids = 1 /
&dynamics dt = 2.0e-8 /
&history every_time = 2.0e-6 /
""", np.array([[0.0, 0.0, R]]))  # fmt: skip
    rows = read_history(case.folder / "fall_bodies.csv")
    force = read_history(case.folder / "fall_surfaces.csv")["force_z"]
    case.metric("deepest overlap / Hertz", float((2 * R - rows["z"].min()) / deep), 1.0, 2e-5)
    case.metric("time of contact / Hertz", impulse_time(rows["time"], force) / lasts, 1.0, 2e-3)
    case.metric("rebound", float(rows["velocity_z"][-1] / speed), 1.0, 1e-5)
    energy = read_history(case.folder / "fall_energy.csv")
    case.below("ledger of the bounce", float(energy["relative_closure"].max()), 1e-5)
    return rows | {"force": force, "deep": np.array(deep), "lasts": np.array(lasts)}


def impulse_time(time: np.ndarray, force: np.ndarray) -> float:
    """Length of the time with a force, from row to row, and one row more [s]."""
    touched = np.flatnonzero(force > 0.0)
    return float(time[touched[-1]] - time[touched[0]] + (time[1] - time[0]))


def roll(case: Case) -> float:
    """Pull a plank on four balls that roll on a floor; return the closure of the ledger."""
    mass, pull, end = 0.05, 0.02, 0.1
    ball = DENSITY * 4.0 / 3.0 * np.pi * R**3
    x = np.array([[a, b, R - 1.3e-6] for a in (-0.02, 0.02) for b in (-0.02, 0.02)])
    top = 2.0 * R - 2.6e-6
    go(case, "roll", f"""&run title = 'Plank on balls', t_end = {end}, gravity = 0.0, 0.0, -{G} /
&wall id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'grain' /
&surface id = 'plank', rectangle = -0.05, -0.05, {top}, 0.05, -0.05, {top}, 0.05, 0.05, {top},
  material = 'grain' /
&body surface = 'plank', free = 'x', 'z', mass = {mass}, force = {pull}, 0.0, 0.0, curve = 'ramp' /
&curve id = 'ramp', times = 0.02, 0.04, values = 0.0, 1.0 /
&dynamics dt_factor = 0.2 /
&history every_time = 1.0e-4 /
""", x, 0.05)  # fmt: skip
    rows = read_history(case.folder / "roll_bodies.csv")
    late = rows["time"] > 0.05
    slope = np.polyfit(rows["time"][late], rows["velocity_x"][late], 1)[0]
    exact = pull / (mass + 4 * ball * 1.4 / 4.0)
    case.metric("acceleration of the plank / exact", float(slope / exact), 1.0, 1e-4)
    return float(read_history(case.folder / "roll_energy.csv")["relative_closure"].max())


def bed() -> np.ndarray:
    """Spheres on a jittered grid, two layers."""
    step = 2.1 * R
    side = (np.arange(4) + 0.5) * step
    x = np.stack(np.meshgrid(side, side, (np.arange(2) + 0.5) * step, indexing="ij"), -1)
    x = x.reshape(-1, 3)
    shift = np.random.default_rng(4).uniform(-0.04 * R, 0.04 * R, x.shape)
    return x + shift


def press(case: Case) -> float:
    """Let a plate, free in all directions, down on a bed; return the closure of the ledger."""
    side, top = 4 * 2.1 * R, 2 * 2.1 * R + 0.1 * R
    walls = "".join(
        f"&wall id = '{name}', point = {p[0]}, {p[1]}, {p[2]}, normal = {n[0]}, {n[1]}, {n[2]}, "
        "material = 'grain' /\n"
        for name, p, n in (
            ("floor", (0, 0, 0), (0, 0, 1)), ("west", (0, 0, 0), (1, 0, 0)),
            ("east", (side, 0, 0), (-1, 0, 0)), ("south", (0, 0, 0), (0, 1, 0)),
            ("north", (0, side, 0), (0, -1, 0))))  # fmt: skip
    inertia = PLATE * side**2 / 12.0
    go(case, "press", f"""&run title = 'Dead load', t_end = 0.1, gravity = 0.0, 0.0, -{G} /
{walls}&surface id = 'plate',
  rectangle = 0.0, 0.0, {top}, {side}, 0.0, {top}, {side}, {side}, {top}, material = 'grain' /
&body surface = 'plate', free = 'x', 'y', 'z', 'rx', 'ry', 'rz', mass = {PLATE},
  inertia = {inertia}, {inertia}, {2 * inertia}, force = 0.0, 0.0, -{LOAD}, curve = 'ramp' /
&curve id = 'ramp', times = 0.0, 0.05, values = 0.0, 1.0 /
&dynamics dt_factor = 0.05 /
&history every_time = 1.0e-3 /
&checkpoint every_time = 0.03, keep = 9 /
&output every_time = 1.0 /
""", bed(), 0.6)  # fmt: skip
    rows = read_history(case.folder / "press_surfaces.csv")
    weight = LOAD + PLATE * G
    mean = rows["force_z"][rows["time"] > 0.08].mean()
    case.metric("force under the dead load / load and weight", float(mean / weight), 1.0, 1e-3)
    return float(read_history(case.folder / "press_energy.csv")["relative_closure"].max())


def again(case: Case) -> None:
    """Go on from a checkpoint, and run on two threads: the same histories."""
    names = ("press_surfaces.csv", "press_bodies.csv", "press_energy.csv")
    kept = {name: (case.folder / name).read_text() for name in names}
    for title, option in (("restart", "--restart=press.chk.2.h5"), ("two threads", "--threads=2")):
        case.run("talus-dem", "press.nml", option)
        case.same_histories(title, kept, ROUNDING)


def draw(case: Case, bounce: dict[str, np.ndarray]) -> None:
    """Bounce, plank and plate over time."""
    fig, (left, middle, right) = case.figure(ncols=3, figsize=(11.0, 3.2))
    left.plot(1e3 * bounce["time"][::20], 1e6 * (bounce["z"][::20] - 2 * R), "o", mfc="none")
    left.axhline(-1e6 * bounce["deep"], color="black", lw=0.8)
    left.set(xlabel="time [ms]", ylabel="place of the plate [µm]")
    rows = read_history(case.folder / "roll_bodies.csv")
    middle.plot(1e3 * rows["time"], 1e3 * rows["velocity_x"])
    middle.set(xlabel="time [ms]", ylabel="velocity of the plank [mm/s]")
    rows = read_history(case.folder / "press_surfaces.csv")
    right.plot(1e3 * rows["time"], rows["force_z"])
    right.axhline(LOAD + PLATE * G, color="black", lw=0.8)
    right.set(xlabel="time [ms]", ylabel="force on the plate [N]")
    case.save(fig)
