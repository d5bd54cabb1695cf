"""Impacts of an elastic-plastic sphere against the closed form of Thornton and Ning."""

import numpy as np
import same_bits
from triangle_nets import net, write_stl

from talus.verification import Case, field_steps, read_history, write_packing

RADIUS, DENSITY, YOUNG, POISSON, YIELD = 1.0e-3, 7800.0, 200.0e9, 0.3, 2.0e9
E_STAR = YOUNG / (2.0 * (1.0 - POISSON**2))
MASS = DENSITY * 4.0 / 3.0 * np.pi * RADIUS**3
FIRST = (np.pi * YIELD / (2.0 * E_STAR)) ** 2 * RADIUS  # overlap at yield [m]
LINE = np.pi * RADIUS * YIELD  # slope of the line of yield [N/m]
SPEED = (np.pi / (2.0 * E_STAR)) ** 2 * np.sqrt(2.0 / (5.0 * DENSITY)) * YIELD**2.5
RATIOS = [0.5, 1.0, 1.2, 1.5, 2.0, 5.0, 10.0, 30.0, 100.0, 200.0]
STEPS = 2000  # in the time of loading
WALL = "&wall id = 'w', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'steel' /\n"
FACE = "&surface id = 'w', file = 'face.stl', material = 'steel' /\n"


def restitution(ratio: float) -> float:
    """Return the closed form; ratio: speed over yield velocity."""
    if ratio <= 1.0:
        return 1.0
    y = 1.0 / ratio
    return float(
        np.sqrt(1.2 * np.sqrt(3.0))
        * np.sqrt(1.0 - y**2 / 6.0)
        * (y / (y + 2.0 * np.sqrt(1.2 - 0.2 * y**2))) ** 0.25
    )


def largest(ratio: float) -> float:
    """Return the largest overlap of an impact [m], from the work of loading."""
    if ratio <= 1.0:
        return FIRST * ratio**0.8
    return FIRST * (1.0 + np.sqrt(4.8 * ratio**2 - 0.8)) / 3.0


def force(overlap: np.ndarray, top: float) -> np.ndarray:
    """Return the force [N] of a contact whose largest overlap was top."""
    peak = LINE * (top - FIRST / 3.0)
    share = peak / (4.0 / 3.0 * E_STAR * np.sqrt(RADIUS) * top**1.5)  # R_e / R_p
    elastic = np.maximum(overlap - top * (1.0 - share), 0.0)
    return 4.0 / 3.0 * E_STAR * np.sqrt(RADIUS / share) * elastic**1.5


def impact(case: Case, name: str, ratio: float, steps: int, end: str = WALL, more: str = "") -> str:
    """Run one impact; return the stem of its files."""
    speed = ratio * SPEED
    step = largest(ratio) / speed / steps
    z = RADIUS + 10.3 * step * speed
    x, v = np.array([[2.0e-5, 1.0e-5, z]]), np.array([[0.0, 0.0, -speed]])
    write_packing(case.folder / f"{name}_pack.h5", x, np.full((1, 3), RADIUS), v=v)
    deck = (case.folder / "deck.nml").read_text().replace("PACK", f"{name}_pack")
    for word, value in (("END", 4 * steps * step), ("STEP", step), ("EVERY", 0.02 * steps * step)):
        deck = deck.replace(word, repr(float(value)))
    (case.folder / f"{name}.nml").write_text(deck + end + more)
    case.run("talus-dem", f"{name}.nml")
    return name


def rebound(case: Case, name: str, ratio: float) -> float:
    """Return the measured restitution."""
    steps = field_steps(case.folder / f"{name}.h5")
    return float(steps[-1].grains["v"][0, 2] / (ratio * SPEED))


def closure(case: Case, name: str) -> float:
    """Return the largest closure error of a run over its energy."""
    ledger = read_history(case.folder / f"{name}_energy.csv")
    return float(np.max(np.abs(ledger["closure_error"])) / ledger["kinetic"][0])


def run(case: Case) -> None:
    """Judge restitution, curves, ledger, order, triangles and restart; plot both."""
    write_stl(case.folder / "face.stl", net(1, 0.04))
    measured = []
    for ratio in RATIOS:
        name = impact(case, f"at_{ratio}", ratio, STEPS)
        measured.append(rebound(case, name, ratio))
        case.metric(
            f"restitution at v/v_y = {ratio}",
            measured[-1],
            restitution(ratio),
            1e-6,
            "second order: (1/2000)^2 and what it grows by",
        )
    closures = [closure(case, impact(case, f"steps_{n}", 10.0, n)) for n in (500, 1000, 2000)]
    case.below("closure error / energy, 2000 steps", closures[2], 1e-6, "second order in the step")
    order = float(np.log2(closures[0] / closures[1]))
    case.metric("order of the closure error", order, 2.0, 0.3)
    ledger = read_history(case.folder / "steps_2000_energy.csv")
    case.metric(
        "plastic work / energy lost",
        float(ledger["plastic"][-1] / ledger["kinetic"][0]),
        1.0 - restitution(10.0) ** 2,
        1e-6,
        "as the restitution",
    )
    name = impact(case, "face", 10.0, STEPS, FACE)
    case.metric(
        "restitution from a triangle / from the wall",
        rebound(case, name, 10.0) / rebound(case, "steps_2000", 10.0),
        1.0,
        1e-9,
        "the same motion but for rounding",
    )
    time = float(largest(10.0) / (10.0 * SPEED))
    for end, name in ((WALL, "again"), (FACE, "again_face")):
        keep = f"&checkpoint every_time = {2.0 * time!r}, keep = 3 /\n"
        impact(case, name, 10.0, STEPS, end, keep)
        same_bits.judge(case, name, f"{name}, ")
    plot(case, measured)


def plot(case: Case, measured: list[float]) -> None:
    """Judge the force over the overlap of an impact; plot it and all restitutions."""
    steps = field_steps(case.folder / "steps_2000.h5")
    overlap = np.array([RADIUS - step.grains["x"][0, 2] for step in steps])
    rows = read_history(case.folder / "steps_2000_walls.csv")
    at = np.searchsorted(rows["time"], [step.time * (1.0 - 1e-9) for step in steps])
    push = -rows["force_z"][at]
    top = largest(10.0)
    down = np.arange(len(overlap)) > np.argmax(overlap)
    line = np.where(
        overlap > FIRST,
        LINE * (overlap - FIRST / 3.0),
        4.0 / 3.0 * E_STAR * np.sqrt(RADIUS) * np.maximum(overlap, 0.0) ** 1.5,
    )
    exact = np.where(down, force(overlap, top), line)
    case.below(
        "force - exact / largest force",
        float(np.max(np.abs(push - exact)) / exact.max()),
        1e-3,
        "largest overlap found to the step",
    )
    fig, ax = case.figure()
    fine = np.geomspace(0.5, 200.0, 200)
    ax.semilogx(fine, [restitution(r) for r in fine], "-", label="exact")
    ax.semilogx(RATIOS, measured, "o", label="Talus")
    inset = ax.inset_axes((0.13, 0.15, 0.35, 0.35))
    inset.plot(overlap * 1e6, exact, "-")
    inset.plot(overlap[::4] * 1e6, push[::4], ".")
    inset.set(xlabel="overlap [um]", ylabel="force [N]", xlim=(0.0, None))
    ax.set(xlabel="speed / yield velocity [-]", ylabel="restitution [-]")
    ax.legend()
    case.save(fig)
