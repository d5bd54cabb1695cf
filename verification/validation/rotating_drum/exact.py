"""Glass beads in a drum: slope of the surface and velocities over the depth, as measured."""

import numpy as np
from drum import Drum

from talus.compare import extent
from talus.verification import Case, Step, field_steps, read_history

D, SPREAD, DENSITY, GRAVITY = 3.0e-3, 0.04, 2500.0, 9.81  # [m], [-], [kg/m3], [m/s2]
RADIUS, OMEGA = 0.12, 11.6 * 2.0 * np.pi / 60.0  # of the drum [m], [rad/s]
COUNT, LONG = 226080, 0.36  # beads, length of the drum of the experiment [m]
TILT = 22.0  # of gravity while the beads settle [deg]: below the slope that is expected
DRUM = Drum(RADIUS, D, round(COUNT * 4.2 * D / LONG), TILT)
T_END, STEADY = 1.7, 0.9  # [s]
SLOPE, BAND = 27.0, 2.0  # measured [deg]


def run(case: Case) -> None:
    """Settle a slice of the bed, turn the drum, average the flow, compare."""
    DRUM.fill(case.folder / "start.h5", SPREAD)
    DRUM.write_ribs(case.folder / "ribs.stl")
    words = {"WIDTH": f"{DRUM.width:.9g}", "OMEGA": f"{OMEGA:.9g}", "T_END": f"{T_END}"}
    tilt = np.radians(TILT)
    words["GRAVITY"] = f"{-GRAVITY * np.sin(tilt):.9g}, 0.0, {-GRAVITY * np.cos(tilt):.9g}"
    for part in ("settle", "turn"):
        text = (case.folder / f"{part}.nml").read_text()
        for word, value in words.items():
            text = text.replace(word, value)
        (case.folder / f"{part}_run.nml").write_text(text)
        case.run("talus-dem", f"{part}_run.nml", "--threads=1")
    steps = [step for step in field_steps(case.folder / "turn_run.h5") if step.time > STEADY]
    half = len(steps) // 2
    slopes = [DRUM.slope(part) for part in (steps, steps[:half], steps[half:])]
    slope, offset = slopes[0]
    found = profile(steps, slope)
    measured = np.loadtxt(case.folder / "measured.csv", delimiter=",", skiprows=1)
    case.metric("slope of the free surface [deg]", slope, SLOPE, BAND, "measured 27")
    case.metric("distance of the surface from the axis / diameter of a bead", offset / D, 10.0, 1.0,
                "measured 30 mm")  # fmt: skip
    compare(case, found, measured)
    case.metric("slope, second half less first half [deg]", slopes[2][0] - slopes[1][0], 0.0, 1.0)
    case.metric("net flow of volume through the middle / upward flow",
                net_flow(steps, slope), 0.0, 0.05, "added after the first runs")  # fmt: skip
    judge(case, steps[-1])
    draw(case, steps, found, (slope, offset))


def profile(steps: list[Step], slope: float) -> np.ndarray:
    """Mean velocity down the slope [m/s] over the distance from the axis [m], in its middle."""
    angle = np.radians(slope)
    down = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    up = np.array([np.sin(angle), 0.0, np.cos(angle)])
    place, speed = [], []
    for step in steps:
        near = np.abs(step.grains["x"] @ down) < 1.5 * D
        place.append(step.grains["x"][near] @ up)
        speed.append(step.grains["v"][near] @ down)
    place, speed = np.concatenate(place), np.concatenate(speed)
    edges = np.arange(-RADIUS, 0.0, 0.5 * D)
    count = np.histogram(place, edges)[0]
    total = np.histogram(place, edges, weights=speed)[0]
    good = count > 0.2 * np.median(count[: len(count) // 2])  # not the few above the surface
    return np.column_stack([total[good] / count[good], 0.5 * (edges[1:] + edges[:-1])[good]])


def net_flow(steps: list[Step], slope: float) -> float:
    """Net flow of the beads' volume through the middle of the slope, over its upward part."""
    angle = np.radians(slope)
    down = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    flow = [0.0, 0.0]
    for step in steps:
        near = np.abs(step.grains["x"] @ down) < 1.5 * D
        rate = step.grains["axes"][near, 0] ** 3 * (step.grains["v"][near] @ down)
        flow[0] += float(np.maximum(rate, 0.0).sum())
        flow[1] -= float(np.minimum(rate, 0.0).sum())
    return flow[0] / flow[1] - 1.0


def zero_of(rows: np.ndarray) -> float:
    """Distance from the axis [m] at which the velocity changes its sign."""
    order = np.argsort(rows[:, 1])
    speed, place = rows[order, 0], rows[order, 1]
    k = int(np.flatnonzero(speed < 0.0)[-1])
    return float(np.interp(0.0, speed[k : k + 2], place[k : k + 2]))


def compare(case: Case, found: np.ndarray, measured: np.ndarray) -> None:
    """Judge the profile of velocities against the measured one."""
    layer = (zero_of(found) / D, zero_of(measured) / D)
    case.metric("distance from the axis where the flow turns / diameter of a bead", -layer[0],
                -layer[1], 1.5, "measured 59.4 mm")  # fmt: skip
    talus = np.interp(measured[:, 1], found[:, 1], found[:, 0])
    top = measured[:, 1] > -0.036  # the measured points of the two uppermost beads
    speed = float(measured[top, 0].mean())
    case.metric("speed at the surface / measured", float(talus[top].mean()) / speed, 1.0, 0.15,
                f"measured {speed:.3f} m/s")  # fmt: skip
    case.below("velocities over the depth, rms difference / measured speed at the surface",
               float(np.sqrt(np.mean((talus - measured[:, 0]) ** 2))) / speed, 0.1)  # fmt: skip
    deep = measured[:, 1] < -0.09
    slip = float(np.mean(talus[deep] / (OMEGA * measured[deep, 1])))
    case.metric("velocity near the wall / that of a rigid turn", slip, 1.0, 0.05,
                "no slip; measured 1.10")  # fmt: skip


def judge(case: Case, last: Step) -> None:
    """No bead is lost, the drum carries their weight, the ledger closes."""
    radius = np.linalg.norm(last.grains["x"][:, ::2], axis=1)
    lost = DRUM.count - len(last.grains["id"]) + (radius > RADIUS).sum()
    case.below("beads lost", float(lost), 0.0)
    weight = 4.0 / 3.0 * np.pi * (last.grains["axes"][:, 0] ** 3).sum() * DENSITY * GRAVITY
    rows = read_history(case.folder / "turn_run_surfaces.csv")
    late = rows["time"] > STEADY
    force = -rows["force_z"][late].sum() / len(np.unique(rows["time"][late]))
    case.metric("mean force on drum and ribs / weight of the beads", float(force / weight), 1.0,
                0.02)  # fmt: skip
    energy = read_history(case.folder / "turn_run_energy.csv")
    case.below("closure of the ledger, relative", extent(energy["relative_closure"]), 1e-3)


def draw(case: Case, steps: list[Step], found: np.ndarray, line: tuple[float, float]) -> None:
    """Draw the bed with its speeds, and the velocities over the depth."""
    fig, (ax, ax2) = case.figure(ncols=2, figsize=(10.5, 4.6))
    beads = steps[-1].grains
    speed = np.linalg.norm(beads["v"], axis=1)
    order = np.argsort(-beads["x"][:, 1])
    dots = ax.scatter(beads["x"][order, 0] / D, beads["x"][order, 2] / D, s=5, c=speed[order],
                      vmax=0.5)  # fmt: skip
    fig.colorbar(dots, ax=ax, label="speed [m/s]")
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    ax.plot(RADIUS / D * np.cos(angle), RADIUS / D * np.sin(angle), "k", lw=0.8)
    x = np.array([-1.0, 1.0]) * 0.9 * RADIUS
    for slope, style in ((SLOPE, "k"), (line[0], "C1--")):
        tilt = np.radians(slope)
        ax.plot(x / D, (-x * np.tan(tilt) - line[1] / np.cos(tilt)) / D, style, lw=1.0,
                label=f"{'measured' if style == 'k' else 'Talus'}, {slope:.1f} deg")  # fmt: skip
    ax.set(xlabel="x / diameter of a bead", ylabel="z / diameter", aspect="equal")
    ax.legend(fontsize=8)
    measured = np.loadtxt(case.folder / "measured.csv", delimiter=",", skiprows=1)
    ax2.plot(measured[:, 0], 1e3 * measured[:, 1], "kx", label="measured, Alizadeh et al. 2013")
    ax2.plot(found[:, 0], 1e3 * found[:, 1], "o", ms=4, label="Talus")
    deep = np.array([-RADIUS, 0.0])
    ax2.plot(OMEGA * deep, 1e3 * deep, "0.6", lw=0.8, label="rigid turn")
    ax2.set(xlabel="velocity down the slope [m/s]", ylabel="distance from the axis [mm]",
            ylim=(-120.0, -20.0))  # fmt: skip
    ax2.legend(fontsize=8)
    case.save(fig)
