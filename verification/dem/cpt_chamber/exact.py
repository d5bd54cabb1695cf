"""Penetration of a cone in chambers of three widths, sides under constant stress or rigid."""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from talus.compare import max_of, min_of
from talus.generate import cloud, uniform_sizes
from talus.packing import write_h5
from talus.verification import Case, field_steps, read_history

CONE, HEIGHT = 3.0e-3, 21.0e-3  # diameter of the cone, height of the specimens [m]
RADIUS, SPREAD, DENSITY = 1.0e-3, 0.15, 2650.0  # of the grains [m], [-], [kg/m3]
STRESS, SPEED, WAY = 100.0e3, 0.09, 9.0e-3  # [Pa], [m/s], [m]
SEEDS = {3.5: 3, 6.0: 2, 10.0: 1}  # specimens of each ratio of the diameters
PACKED, LOOSE = 0.60, 0.28  # solid fractions: of a specimen, of its cloud
STEADY = (1.0, 3.0)  # depths of the mean resistance [cone diameters]
STRENGTH = 2.65  # largest over least stress at the peak, case membrane_triaxial
CLOSING = 0.3  # speed of the floor that presses a cloud [m/s]
CONE_ID, SIDE_ID = -3, -4  # of their contacts: after both planes
KINDS = {"stress": "constant stress", "rigid": "rigid"}


@dataclass
class Chamber:
    """A specimen as the pressing leaves it."""

    name: str
    ratio: float  # of the diameters, as wanted
    words: dict[str, str]  # of its decks
    start: float  # time [s]
    radius: float  # of the specimen [m]
    solid: float  # its solid fraction [-]
    closure: float  # of the ledger, largest


def run(case: Case) -> None:
    """Press the specimens, push the cone into each twice, judge the resistances."""
    wanted = [(ratio, seed) for ratio in sorted(SEEDS, reverse=True)
              for seed in range(1, SEEDS[ratio] + 1)]  # fmt: skip
    with ThreadPoolExecutor(2) as pool:  # programs that run side by side, the longest first
        chambers = list(pool.map(lambda pair: press(case, *pair), wanted))
        jobs = [(chamber, kind) for chamber in chambers for kind in KINDS]
        found = list(pool.map(lambda job: push(case, *job), jobs))
    tests = {(job[0].name, job[1]): test for job, test in zip(jobs, found, strict=True)}
    judge_resistance(case, chambers, tests)
    judge_run(case, chambers, found)
    draw(case, chambers, tests)


def fill(case: Case, part: str, name: str, words: dict[str, str]) -> str:
    """Write a deck with its words filled in; return its name."""
    text = (case.folder / f"{part}.nml").read_text()
    for word, value in words.items():
        text = text.replace(word, value)
    (case.folder / f"{name}.nml").write_text(text)
    return f"{name}.nml"


def press(case: Case, ratio: float, seed: int) -> Chamber:
    """Press a cloud to a specimen whose diameter is about ratio times the cone's."""
    name = f"wide{ratio:g}_{seed}"
    grow = (PACKED / LOOSE) ** (1.0 / 3.0)
    radius, height = 0.5 * ratio * CONE * grow, HEIGHT * grow
    box = np.array([2.0 * radius, 2.0 * radius, height])
    count = int(LOOSE * box.prod() / (4.0 / 3.0 * np.pi * RADIUS**3))
    rng = np.random.default_rng(seed)
    pack = cloud(uniform_sizes(count, SPREAD, rng), box, np.full(3, RADIUS), seed)
    pack.x -= np.array([radius, radius, height])
    largest = (1.0 + SPREAD) * RADIUS
    pack = pack.take(np.hypot(pack.x[:, 0], pack.x[:, 1]) < radius - largest).renumbered(0)
    write_h5(case.folder / f"{name}.h5", pack)
    words = {
        "PACK": f"{name}.h5", "HEIGHT": f"{height}", "RADIUS": f"{radius}",
        "FLOOR_AREA": f"{np.pi * (radius / grow) ** 2}",
        "SIDE_AREA": f"{2.0 * np.pi * radius * HEIGHT}",
        "SIDE_SPEED": f"{CLOSING * radius / height}",
    }  # fmt: skip
    case.run("talus-dem", fill(case, "press", f"{name}_press", words), "--threads=1")
    start = json.loads((case.folder / f"{name}_press_summary.json").read_text())["time_s"]
    floor = read_history(case.folder / f"{name}_press_servos.csv")["position"][-1]
    side = read_history(case.folder / f"{name}_press_surface_servos.csv")["position"][-1]
    energy = read_history(case.folder / f"{name}_press_energy.csv")
    words["FLOOR_AREA"] = f"{np.pi * side**2 - 0.25 * np.pi * CONE**2}"
    words["SIDE_AREA"] = f"{2.0 * np.pi * radius * abs(floor)}"  # at the radius of the start
    solid = (4.0 / 3.0 * np.pi * pack.axes.prod(1)).sum() / (np.pi * side**2 * abs(floor))
    return Chamber(name, ratio, words, start, side, solid,
                   float(energy["relative_closure"].max()))  # fmt: skip


def push(case: Case, chamber: Chamber, kind: str) -> dict:
    """Push the cone into a specimen; depth, resistance, and what the boundaries do."""
    name = f"{chamber.name}_{kind}"
    until = "" if kind == "stress" else f", until = {chamber.start}"
    servo = (
        f"&servo     surface = 'side', stress = {STRESS}, area = {chamber.words['SIDE_AREA']}, "
        f"speed = 0.3, gain = 0.3, tolerance = 1.0{until} /"
    )
    words = chamber.words | {
        "KIND": KINDS[kind], "SPEED": f"{SPEED}", "T_END": f"{chamber.start + WAY / SPEED}",
        "OUTPUT": f"{0.4 * WAY / SPEED}", "EVERY": f"{WAY / SPEED / 240}", "SERVO": servo,
    }  # fmt: skip
    case.run("talus-dem", fill(case, "push", name, words), "--threads=1",
             f"--restart={chamber.name}_press.chk.h5")  # fmt: skip
    rows = read_history(case.folder / f"{name}_surfaces.csv")
    part = [{key: v[(rows["surface"] == 1) & (rows["part"] == k)] for key, v in rows.items()}
            for k in (1, 2, 3)]  # fmt: skip
    walls = read_history(case.folder / f"{name}_walls.csv")
    lid, floor = (walls["force_z"][walls["wall"] == k] for k in (1, 2))
    side = read_history(case.folder / f"{name}_surface_servos.csv")
    energy = read_history(case.folder / f"{name}_energy.csv")
    point = part[0]["force_z"] + part[1]["force_z"]
    depth = -part[0]["z"] / CONE
    steady = (depth >= STEADY[0]) & (depth <= STEADY[1])
    resistance = point / (0.25 * np.pi * CONE**2) / STRESS
    area = float(chamber.words["SIDE_AREA"]) * side["position"] / float(chamber.words["RADIUS"])
    return {
        "depth": depth, "resistance": resistance, "mean": float(resistance[steady].mean()),
        "radius": side["position"],
        "servo_mean": float((side["force"] / area / STRESS)[steady].mean()),
        "side_mean": radial_stress(case, name, side, area, chamber.start),
        "lid_mean": float((lid / float(chamber.words["FLOOR_AREA"]) / STRESS)[steady].mean()),
        "balance": float(np.abs((point + part[2]["force_z"] + lid + floor)[steady]).mean()
                         / np.abs(floor[steady]).mean()),
        "sum_error": contact_sum_error(case, name, rows),
        "closure": float(energy["relative_closure"].max()),
    }  # fmt: skip


def contact_sum_error(case: Case, name: str, rows: dict[str, np.ndarray]) -> float:
    """Largest difference between force of the cone told and sum of its contacts, relative."""
    worst, largest = 0.0, 0.0
    for step in field_steps(case.folder / f"{name}.h5"):
        now = (rows["surface"] == 1) & (np.abs(rows["time"] - step.time) < 1e-9)
        if not now.any():
            continue
        told = np.array([rows[f"force_{axis}"][now].sum() for axis in "xyz"])
        own = step.contacts["force"][step.contacts["ids"][:, 0] == CONE_ID].sum(0)
        worst = max_of(worst, float(np.abs(own + told).max()))
        largest = max_of(largest, float(np.abs(told).max()))
    return worst / largest


def radial_stress(
    case: Case, name: str, side: dict[str, np.ndarray], area: np.ndarray, start: float
) -> float:
    """Mean over the deeper steps of the contacts' radial force on the side / area / STRESS."""
    found = []
    for step in field_steps(case.folder / f"{name}.h5"):
        if step.time < start + STEADY[0] * CONE / SPEED:
            continue
        own = step.contacts["ids"][:, 0] == SIDE_ID
        point, force = (step.contacts[key][own, :2] for key in ("point", "force"))
        out = point / np.linalg.norm(point, axis=1, keepdims=True)
        pressed = float(np.abs((out * force).sum()))
        found.append(pressed / float(np.interp(step.time, side["time"], area)) / STRESS)
    return float(np.mean(found))


def means(chambers: list[Chamber], tests: dict, kind: str, ratio: float) -> np.ndarray:
    """Mean resistances over STRESS of the specimens of a ratio."""
    return np.array([tests[c.name, kind]["mean"] for c in chambers if c.ratio == ratio])


def judge_resistance(case: Case, chambers: list[Chamber], tests: dict) -> None:
    """Order of the two kinds of sides at each ratio, how they change and meet."""
    ratios = sorted(SEEDS)
    soft, hard = ({ratio: float(means(chambers, tests, kind, ratio).mean()) for ratio in ratios}
                  for kind in KINDS)  # fmt: skip
    over = {ratio: hard[ratio] / soft[ratio] for ratio in ratios}
    for ratio in ratios:
        case.above(f"rigid over constant stress, diameter ratio {ratio:g}", over[ratio], 1.0)
    for less, more in zip(ratios[:-1], ratios[1:], strict=True):
        case.above(f"its fall from ratio {less:g} to {more:g}", over[less] - over[more], 0.0)
    wider = np.log(ratios[-1] / ratios[0])
    meets = np.log((over[ratios[0]] - 1.0) / (over[ratios[-1]] - 1.0)) / wider
    case.metric("power by which it comes to 1", float(meets), 2.0, 1.0, "an elastic far field: 2")
    rises = np.log(soft[ratios[-1]] / soft[ratios[0]]) / wider
    plastic = 2.0 * (STRENGTH - 1.0) / STRENGTH
    case.metric("power by which it rises under constant stress", float(rises), 0.5 * plastic,
                0.5 * plastic, "from no effect to a chamber that yields as a whole")  # fmt: skip
    for kind, found in (("constant stress", soft), ("rigid", hard)):
        case.metric(f"log10 of resistance over stress, {kind}, widest",
                    float(np.log10(found[ratios[-1]])), 1.5, 0.5, "10 to 100")  # fmt: skip


def judge_run(case: Case, chambers: list[Chamber], found: list[dict]) -> None:
    """Inertia, servos, forces that balance, contacts that add up, the ledger."""
    inertia = SPEED / CONE * 2.0 * RADIUS * np.sqrt(DENSITY / STRESS)
    case.below("inertial number", float(inertia), 1e-2)
    held = [test for test in found if np.ptp(test["radius"]) > 0.0]
    case.metric("radial stress on sides under constant stress / target, mean",
                float(np.mean([test["servo_mean"] for test in held])), 1.0, 0.01)  # fmt: skip
    case.metric("stress on the lid / target, mean",
                float(np.mean([test["lid_mean"] for test in found])), 1.0, 0.03)  # fmt: skip
    rigid = [test for test in found if not np.ptp(test["radius"]) > 0.0]
    case.above("radial stress on rigid sides / that of the start, least",
               min_of(test["side_mean"] for test in rigid), 1.0)  # fmt: skip
    case.below("vertical forces out of balance / force of the floor",
               max_of(test["balance"] for test in found), 0.02)  # fmt: skip
    case.below("force of the cone less sum of its contacts, relative",
               max_of(test["sum_error"] for test in found), 1e-12)  # fmt: skip
    case.below("ledger, pressing", max_of(chamber.closure for chamber in chambers), 1e-4)
    case.below("ledger, penetration", max_of(test["closure"] for test in found), 1e-4)


def draw(case: Case, chambers: list[Chamber], tests: dict) -> None:
    """Resistance over depth, its mean over the ratio of the diameters, what the side changes."""
    fig, (left, right, last) = case.figure(ncols=3, figsize=(13.0, 4.2))
    ratios = sorted(SEEDS)
    style = {"stress": ("C0", "o"), "rigid": ("C1", "s")}
    line = dict(zip(ratios, (":", "--", "-"), strict=True))
    for kind, (colour, mark) in style.items():
        for ratio in ratios:
            some = [tests[c.name, kind] for c in chambers if c.ratio == ratio]
            depth = np.linspace(0.0, 0.99 * WAY / CONE, 60)
            mean = np.mean([np.interp(depth, t["depth"], smooth(t["resistance"])) for t in some], 0)
            left.plot(depth, mean, color=colour, ls=line[ratio],
                      label=f"{KINDS[kind]}, {ratio:g}")  # fmt: skip
        own = [2.0 * c.radius / CONE for c in chambers]
        right.plot(own, [tests[c.name, kind]["mean"] for c in chambers], mark,
                   color=colour, label=KINDS[kind])  # fmt: skip
        right.plot([np.mean([2.0 * c.radius / CONE for c in chambers if c.ratio == ratio])
                    for ratio in ratios],
                   [means(chambers, tests, kind, ratio).mean() for ratio in ratios], color=colour,
                   lw=0.8)  # fmt: skip
    left.set(xlabel="depth of the tip / diameter of the cone [-]",
             ylabel="resistance / stress [-]")  # fmt: skip
    left.set_ylim(0.0, 90.0)
    left.legend(title="sides, diameter ratio", ncols=2, fontsize=8, loc="upper left")
    over = [means(chambers, tests, "rigid", r).mean() / means(chambers, tests, "stress", r).mean()
            for r in ratios]  # fmt: skip
    last.loglog(ratios, np.array(over) - 1.0, "o", label="Talus")
    last.loglog(ratios, (over[0] - 1.0) * (np.array(ratios) / ratios[0]) ** -2.0, "k-", lw=0.8,
                label="power -2")  # fmt: skip
    last.set(xlabel="diameter of the chamber / of the cone [-]",
             ylabel="rigid over constant stress, less 1 [-]")  # fmt: skip
    last.legend()
    right.set(xlabel="diameter of the chamber / of the cone [-]",
              ylabel="mean resistance / stress [-]", ylim=(0.0, None))  # fmt: skip
    right.legend(title="sides")
    case.save(fig)


def smooth(values: np.ndarray, window: int = 9) -> np.ndarray:
    """Moving mean, of the same length."""
    wide = np.pad(values, window // 2, mode="edge")
    return np.convolve(wide, np.ones(window) / window, mode="valid")
