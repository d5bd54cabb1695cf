"""A plate under a servo: the way of a wall, Coulomb's friction while it is dragged, its work."""

import numpy as np

from talus.verification import Case, read_history, write_packing

FORCE, AREA, HEIGHT, SPEED = 2.0, 3.6e-5, 2.1e-3, 0.02  # [N], [m2], [m], [m/s]
PRESSED = 0.015  # from then on the force is judged [s]
WALL = f"""&wall id = 'lid', material = 'plate',
  point = 0.0, 0.0, {HEIGHT}, normal = 0.0, 0.0, -1.0 /
&servo wall = 'lid', stress = {FORCE / AREA:.17g}, area = {AREA}, gain = 0.2,
  tolerance = 1.0e-3 /
"""
PLATE = f"""&surface id = 'lid', material = 'plate', velocity = SPEED, 0.0, 0.0, CURVE
  rectangle = -1.0e-2, -1.0e-2, {HEIGHT}, 2.0e-2, -1.0e-2, {HEIGHT}, 2.0e-2, 2.0e-2, {HEIGHT} /
&servo surface = 'lid', force = {FORCE}, direction = 0.0, 0.0, -1.0, gain = 0.2,
  tolerance = 1.0e-3 /
"""
DRAG = f"&curve id = 'go', times = {PRESSED}, {PRESSED + 1.0e-3}, values = 0.0, 1.0 /\n"
ROUNDING = 1.0e-9  # between histories on ranks, over the largest value of their unit


def run(case: Case) -> None:
    """Press with a wall and a plate, drag a plate, go on from a checkpoint."""
    place = np.stack(np.meshgrid([0.0, 3e-3, 6e-3], [0.0, 3e-3, 6e-3], [1e-3]), -1).reshape(-1, 3)
    axes = np.array([1.2e-3, 0.9e-3, 1.0e-3])
    write_packing(case.folder / "pack.h5", place, np.tile(axes, (9, 1)))
    wall = lid(case, "wall", WALL, "walls", 2)
    still = lid(case, "plate", PLATE.replace("SPEED", "0.0").replace("CURVE", ""), "surfaces", 1)
    for name, title in (("z", "place"), ("force_z", "force")):
        apart = float(np.abs(wall[name] - still[name]).max() / np.abs(wall[name]).max())
        case.below(f"{title} of the plate less that of the wall", apart, 1e-10)
    drag = lid(case, "drag", DRAG + PLATE.replace("SPEED", f"{SPEED}")
               .replace("CURVE", "curve = 'go',"), "surfaces", 1)  # fmt: skip
    late = drag["time"] > PRESSED
    case.below("force while it is dragged, error", worst(drag["force_z"][late] / FORCE), 1e-3)
    slides = drag["time"] > 0.8 * drag["time"][-1]
    friction = -drag["force_x"][slides] / drag["force_z"][slides]
    case.metric("friction", float(friction.mean()), 0.3, 3e-4)
    energy = read_history(case.folder / "drag_energy.csv")
    work = drag["work"] - energy["boundary"]
    case.below("work of the plate less boundary work", float(np.abs(work).max()), 1e-15)
    own = drag["work"][late][-1] - drag["work"][late][0]
    case.metric("work / force times way", float(own / force_times_way(drag, late)), 1.0, 1e-3)
    case.below("ledger", float(energy["relative_closure"].max()), 1e-4)
    restart(case)
    let_go(case)
    draw(case, wall, drag)


def force_times_way(rows: dict[str, np.ndarray], chosen: np.ndarray) -> float:
    """Work on the grains by the trapezoidal rule over rows [J]."""
    work = 0.0
    for c in "xz":
        force, way = rows[f"force_{c}"][chosen], rows[c][chosen]
        work -= float((0.5 * (force[1:] + force[:-1]) * np.diff(way)).sum())
    return work


def worst(ratio: np.ndarray) -> float:
    """Largest error of a ratio that should be one."""
    return float(np.abs(ratio - 1.0).max())


def lid(case: Case, name: str, text: str, history: str, number: int) -> dict[str, np.ndarray]:
    """Run with a lid; return its rows."""
    deck = (case.folder / "deck.nml").read_text()
    (case.folder / f"{name}.nml").write_text(deck + text)
    case.run("talus-dem", f"{name}.nml", "--threads=1")
    rows = read_history(case.folder / f"{name}_{history}.csv")
    own = rows["wall" if history == "walls" else "surface"] == number
    return {column: values[own] for column, values in rows.items()}


def let_go(case: Case) -> None:
    """Lift the plate after the servo's `until`: the servo's history goes on to tell its force."""
    lifted = PLATE.replace("SPEED, 0.0, 0.0, CURVE", f"0.0, 0.0, {SPEED}, curve = 'go',")
    lid(case, "lift", DRAG + lifted.replace("gain = 0.2", f"gain = 0.2, until = {PRESSED}"),
        "surfaces", 1)  # fmt: skip
    rows = read_history(case.folder / "lift_surface_servos.csv")
    before = rows["time"] < PRESSED
    case.metric(
        "force before the plate is lifted", float(rows["force"][before][-1] / FORCE), 1.0, 1e-3
    )
    case.below("force told when it has been lifted", abs(float(rows["force"][-1])) / FORCE, 1e-12)


def restart(case: Case) -> None:
    """Go on from the checkpoint at 0.01 s in a run of the same name: the same histories."""
    names = ("drag_surfaces.csv", "drag_surface_servos.csv", "drag_energy.csv")
    kept = {name: (case.folder / name).read_text() for name in names}
    case.run("talus-dem", "drag.nml", "--threads=1", "--restart=drag.chk.2.h5")
    case.same_histories("a restart", kept, ROUNDING)


def draw(case: Case, wall: dict[str, np.ndarray], drag: dict[str, np.ndarray]) -> None:
    """Forces over time."""
    fig, ax = case.figure()
    ax.plot(1e3 * wall["time"], wall["force_z"], color="black", lw=2.5, alpha=0.3, label="wall")
    ax.plot(1e3 * drag["time"], drag["force_z"], label="plate, normal force")
    ax.plot(1e3 * drag["time"], -drag["force_x"], label="plate, drag")
    ax.axhline(FORCE, color="0.5", lw=0.8, ls="--")
    ax.axhline(0.3 * FORCE, color="0.5", lw=0.8, ls="--")
    ax.set(xlabel="time [ms]", ylabel="force [N]")
    ax.legend(fontsize=8)
    case.save(fig)
