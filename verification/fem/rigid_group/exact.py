"""A group that turns with all nodes, that twists a bar, and that swings on it."""

import shutil

import numpy as np
from solid import save, shape_of

from talus.compare import max_of
from talus.mesh import Mesh, box
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

SIDE, LENGTH, YOUNG, MASS, FORCE = 0.1, 0.3, 1.0e6, 20.0, 100.0
STIFFNESS = YOUNG * SIDE**2 / LENGTH
OMEGA = np.sqrt(STIFFNESS / MASS)
CENTRE = "centre = 0.05, 0.05, 0.3"


def solve(case: Case, name: str, mesh: Mesh, lines: str, **values: str) -> dict[str, np.ndarray]:
    """Run a deck; return the history of its rigid groups."""
    save(mesh, case.folder / "bar.h5")
    text = (case.folder / "deck.nml").read_text()
    for key, value in values.items():
        text = text.replace(key, value)
    (case.folder / f"{name}.nml").write_text(text + lines)
    case.run("talus-fem", f"{name}.nml")
    return read_history(case.folder / f"{name}_rigid.csv")


def bar(element: str) -> Mesh:
    """Return the bar along z, of 2 x 2 x 6 cells."""
    mesh = box(np.zeros(3), np.array([SIDE, SIDE, LENGTH]), (2, 2, 6))
    return converted(mesh, shape_of(element))


def judge_turn(case: Case) -> None:
    """Turn the ends by a quarter and shift them; nothing is stored."""
    mesh = bar("hex8_bbar")
    lines = (
        f"&rigid group = 'ends', {CENTRE}, axis = 1.0, 2.0, 2.0, turn = 'on', shift_x = 'aside' /\n"
    )
    mesh.nodes["ends"] = np.union1d(mesh.nodes["z0"], mesh.nodes["z1"])
    found = solve(case, "turn", mesh, lines, LAW="neo_hookean", ELEMENT="hex8_bbar", END="1.0",
                  RHO="1.0", POISSON="0.3", EVERY="0.1",
                  ANALYSIS="kind = 'static', dt = 0.1")  # fmt: skip
    size = YOUNG * SIDE**2
    force = max_of(abs(found[f"ends force {c}"]).max() for c in "xyz")
    case.below("turn: force on the group / E A", float(force / size), 1e-8)
    case.metric("turn: angle", float(found["ends turn"][-1]), np.pi / 2, 1e-12)
    case.metric("turn: shift", float(found["ends x"][-1]), 0.3, 1e-12)
    last = field_steps(case.folder / "turn.h5")[-1].solid
    x = mesh.x + last["u"]
    lengths = [np.linalg.norm(p[:, None] - p[None], axis=2) for p in (x, mesh.x)]
    off = abs(lengths[0] - lengths[1]).max() / LENGTH
    case.below("turn: change of distances / length", float(off), 1e-8)


def judge_twist(case: Case) -> None:
    """Twist the bar; judge torque and force against the reactions at its foot."""
    mesh = bar("hex20")
    lines = "&support group = 'z0', fix = 'x', 'y', 'z' /\n"
    lines += f"&rigid group = 'z1', {CENTRE}, turn = 'on' /\n"
    found = solve(case, "twist", mesh, lines, LAW="neo_hookean", ELEMENT="hex20", END="1.0",
                  RHO="1.0", POISSON="0.3", EVERY="0.2",
                  ANALYSIS="kind = 'static', dt = 0.1, tolerance = 1.0e-11")  # fmt: skip
    last = field_steps(case.folder / "twist.h5")[-1].solid
    foot = mesh.nodes["z0"]
    r = last["reaction"][foot]
    moment = np.cross(mesh.x[foot] - [0.05, 0.05, 0.3], r).sum(axis=0)
    torque = np.array([found[f"z1 moment {c}"][-1] for c in "xyz"])
    case.above("twist: torque [N m]", float(torque[2]), 10.0)
    off = abs(torque + moment).max() / torque[2]
    case.below("twist: torque and the moment at the foot differ by", float(off), 1e-8)
    pull = np.array([found[f"z1 force {c}"][-1] for c in "xyz"]) + r.sum(axis=0)
    case.below("twist: force and that at the foot differ by", float(abs(pull).max() * LENGTH), 1e-7)


def judge_swing(case: Case) -> dict[str, np.ndarray]:
    """Let the end fall under a force; judge the swing, in three analyses and after a restart."""
    period = float(2 * np.pi / OMEGA)
    lines = "&support group = 'z0', fix = 'z' /\n&support group = 'all', fix = 'x', 'y' /\n"
    lines += (
        f"&rigid group = 'z1', {CENTRE}, free = 'z', mass = {MASS}, force = 0.0, 0.0, {-FORCE} /\n"
    )
    lines += f"&checkpoint every_time = {period / 2} /\n"
    shared = {"RHO": "1.0e-3", "POISSON": "0.0", "END": repr(period), "EVERY": repr(period / 50)}
    runs = {}
    for name, law, analysis in (
        ("newmark", "linear_elastic", "kind = 'newmark', dt = STEP"),
        ("hht", "neo_hookean", "kind = 'hht', dt = STEP, alpha = -0.1"),
        ("explicit", "neo_hookean", "kind = 'explicit'"),
    ):
        values = dict(shared, LAW=law, ELEMENT="hex8_bbar")
        if name == "explicit":
            values["RHO"] = "1.0"
        values["ANALYSIS"] = analysis.replace("STEP", repr(period / 1000))
        mesh = bar("hex8_bbar")
        mesh.nodes["all"] = np.flatnonzero(mesh.x[:, 2] < LENGTH - 1e-9)
        runs[name] = solve(case, f"swing_{name}", mesh, lines, **values)
        sink = -runs[name]["z1 z"] / (FORCE / STIFFNESS)
        exact = 1 - np.cos(OMEGA * runs[name]["time"])
        case.below(f"{name}: swing, error / largest", float(abs(sink - exact).max() / 2), 0.03)
        kept = (case.folder / f"swing_{name}_rigid.csv").read_bytes()
        shutil.copy(case.folder / f"swing_{name}.chk.h5", case.folder / "half.chk.h5")
        case.run("talus-fem", f"swing_{name}.nml", "--restart=half.chk.h5")
        same = (case.folder / f"swing_{name}_rigid.csv").read_bytes() == kept
        case.metric(f"{name}: restart repeats every bit", float(same), 1.0, 0)
    return runs


def run(case: Case) -> None:
    """Judge all three; plot the swings."""
    judge_turn(case)
    judge_twist(case)
    runs = judge_swing(case)
    fig, ax = case.figure()
    for (name, found), mark in zip(runs.items(), "os^", strict=True):
        ax.plot(found["time"], -1e3 * found["z1 z"], mark, mfc="none", label=name, markevery=2)
    time = np.linspace(0.0, 2 * np.pi / OMEGA, 200)
    ax.plot(time, 1e3 * FORCE / STIFFNESS * (1 - np.cos(OMEGA * time)), "-", label="exact")
    ax.set(xlabel="time [s]", ylabel="sink [mm]")
    ax.legend()
    case.save(fig)
