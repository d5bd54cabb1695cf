"""Wheels on a bed of balls: given slip, given weight, given torque."""

import h5py
import numpy as np

from talus.verification import Case, read_history, write_packing

G, BALL, LONG, BROAD = 9.81, 2.5e-3, 0.16, 0.02
RADIUS, SPEED, SPAN, JUDGED = 0.025, 0.2, 0.25, 0.12  # [m], [m/s], [s], [s]
SLIPS = [-0.4, 0.1, 0.6]
LIGHT, HEAVY = 0.04, 0.08  # [kg]
INERTIA, TORQUE = 2.5e-5, 0.002  # [kg m2], [N m]


def run(case: Case) -> None:
    """Settle a bed; run wheels over it; judge balances and trends."""
    write_packing(case.folder / "start.h5", *loose())
    head = (case.folder / "bed.nml").read_text()
    head = head.replace("LONG", f"{LONG}").replace("BROAD", f"{BROAD}")
    (case.folder / "bed_run.nml").write_text(head)
    case.run("talus-dem", "bed_run.nml")
    with h5py.File(case.folder / "settled.h5") as file:
        x = file["grains/x"][...]
    top = float(x[np.abs(x[:, 0] - 0.045) < RADIUS, 2].max() + BALL)
    runs = {}
    for slip in SLIPS:
        runs[f"slip {slip:g}"] = drive(case, f"slip_{slip:g}", head, top, LIGHT, slip)
    runs["heavy"] = drive(case, "heavy", head, top, HEAVY, SLIPS[1])
    runs["torque"] = drive(case, "torque", head, top, LIGHT, None)
    for name, row in runs.items():
        case.metric(f"weight carried / weight, {name}", row["carried"], 1.0, 0.02)
        case.below(f"ledger, {name}", row["ledger"], 1e-4)
    pull = [runs[f"slip {slip:g}"]["pull"] for slip in SLIPS]
    case.above("pull at slip 0.1 less that at -0.4, over the weight", pull[1] - pull[0], 0.02)
    case.above("pull at slip 0.6 less that at 0.1, over the weight", pull[2] - pull[1], 0.02)
    sink = runs["heavy"]["sinkage"] / runs["slip 0.1"]["sinkage"]
    case.above("sinkage, twice the weight / once", sink, 1.1)
    case.metric("moment of the bed / given torque", runs["torque"]["moment"] / -TORQUE, 1.0, 0.05)
    draw(case, runs, pull)


def loose() -> tuple[np.ndarray, np.ndarray]:
    """Balls on a jittered lattice above the floor, of three sizes."""
    step = 2.06 * BALL
    sides = [np.arange(0.52 * step, long - 0.45 * step, step) for long in (LONG, BROAD)]
    x = np.stack(np.meshgrid(*sides, 0.52 * step + step * np.arange(7), indexing="ij"), -1)
    x = x.reshape(-1, 3)
    rng = np.random.default_rng(11)
    x += rng.uniform(-0.02, 0.02, x.shape) * BALL
    return x, (BALL * rng.choice([0.8, 0.9, 1.0], len(x)))[:, None] * np.ones(3)


def drive(
    case: Case, name: str, head: str, top: float, mass: float, slip: float | None
) -> dict[str, np.ndarray | float]:
    """Run one wheel; slip None: given torque. Return its rows and means over the last part."""
    spin = SPEED / (RADIUS * (1.0 - (slip or 0.0)))
    free = "'z'" if slip is not None else "'x', 'z', 'ry'"
    torque = f", inertia = {INERTIA}, moment = 0.0, {TORQUE}, 0.0, curve = 'go'"
    head = head.replace("'start.h5'", "'settled.h5'").replace("t_end = 0.15", f"t_end = {SPAN}")
    head = head.replace(", packing = 'settled.h5'", "").replace("damping = 20.0", "damping = 0.0")
    head = head.replace("dt_factor = 0.2", "dt_factor = 0.12")
    go = ", curve = 'go'"
    motion = f", velocity = {SPEED}, 0.0, 0.0, spin = 0.0, {spin}, 0.0{go}"
    text = f"""&cylinder id = 'wheel', side = 'outside', axis = 0.0, 1.0, 0.0,
  centre = 0.045, {0.5 * BROAD}, {top + RADIUS}, radius = {RADIUS}, length = {2 * BROAD},
  material = 'wheel'{motion if slip is not None else ""} /
&body surface = 'wheel', free = {free}, mass = {mass}{torque if slip is None else ""} /
&curve id = 'go', times = 0.03, 0.05, values = 0.0, 1.0 /
"""
    (case.folder / f"{name}.nml").write_text(head + text)
    case.run("talus-dem", f"{name}.nml")
    rows = read_history(case.folder / f"{name}_surfaces.csv")
    side, end = rows["part"] == 1, rows["part"] == 2
    both = {k: rows[k][side] + rows[k][end] for k in ("force_x", "force_z", "moment_y")}
    time, weight = rows["time"][side], mass * G
    late = time > JUDGED
    body = read_history(case.folder / f"{name}_bodies.csv")
    gain = {k: np.diff(body[k][late][[0, -1]])[0] for k in ("velocity_z", "spin_y")}
    lasts = time[late][-1] - time[late][0]
    carried = both["force_z"][late].mean() - mass * gain["velocity_z"] / lasts
    resists = both["moment_y"][late].mean() - INERTIA * gain["spin_y"] / lasts
    return {
        "time": time, "pulls": both["force_x"] / weight, "depth": top + RADIUS - rows["z"][side],
        "pull": float(both["force_x"][late].mean() / weight), "carried": float(carried / weight),
        "sinkage": float((top + RADIUS - rows["z"][side][late]).mean()),
        "moment": float(resists),
        "ledger": float(read_history(case.folder / f"{name}_energy.csv")["relative_closure"].max()),
    }  # fmt: skip


def draw(case: Case, runs: dict, pull: list[float]) -> None:
    """Pull over slip, sinkage over time."""
    fig, (left, right) = case.figure(ncols=2, figsize=(9.0, 3.6))
    left.plot(SLIPS, pull, "o-")
    left.set(xlabel="slip [-]", ylabel="drawbar pull / weight [-]")
    for name, row in runs.items():
        right.plot(row["time"], 1e3 * row["depth"], label=name)
    right.set(xlabel="time [s]", ylabel="sinkage [mm]")
    right.legend(fontsize=8)
    case.save(fig)
