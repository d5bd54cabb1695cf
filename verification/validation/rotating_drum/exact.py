"""Glass beads in a drum: slope of the surface and velocities over the depth, as measured."""

import numpy as np

from talus.compare import extent
from talus.packing import make_packing, write_h5
from talus.verification import Case, Step, field_steps, read_history

D, SPREAD, DENSITY, GRAVITY = 3.0e-3, 0.04, 2500.0, 9.81  # [m], [-], [kg/m3], [m/s2]
DRUM, OMEGA = 0.12, 11.6 * 2.0 * np.pi / 60.0  # radius [m], spin [rad/s]
COUNT, LONG = 226080, 0.36  # beads, length of the drum of the experiment [m]
PITCH = 1.05 * D
WIDTH = 4.0 * PITCH  # of the slice [m]
RIBS, RIB = 126, 0.5 * D  # lining of the drum: number and height [m] of radial ribs
TILT = 22.0  # of gravity while the beads settle [deg]: below the slope that is expected
T_END, STEADY = 1.7, 0.9  # [s]
SLOPE, BAND = 27.0, 2.0  # measured [deg]


def run(case: Case) -> None:
    """Settle a slice of the bed, turn the drum, average the flow, compare."""
    beads = fill(case)
    write_ribs(case)
    words = {"WIDTH": f"{WIDTH:.9g}", "OMEGA": f"{OMEGA:.9g}", "T_END": f"{T_END}"}
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
    slopes = [slope_of(part) for part in (steps, steps[:half], steps[half:])]
    slope, offset = slopes[0]
    found = profile(steps, slope)
    measured = np.loadtxt(case.folder / "measured.csv", delimiter=",", skiprows=1)
    case.metric("slope of the free surface [deg]", slope, SLOPE, BAND, "measured 27")
    case.metric("distance of the surface from the axis / diameter of a bead", offset / D, 10.0, 1.0,
                "measured 30 mm")  # fmt: skip
    compare(case, found, measured)
    case.metric("slope, second half less first half [deg]", slopes[2][0] - slopes[1][0], 0.0, 1.0)
    judge(case, beads, steps[-1])
    draw(case, steps, found, (slope, offset))


def fill(case: Case) -> int:
    """Write beads on a loose lattice below a tilted surface; return their mass over the density."""
    rng = np.random.default_rng(11)
    count = round(COUNT * WIDTH / LONG)
    side = np.arange(-DRUM, DRUM, PITCH)
    x, y, z = np.meshgrid(side, PITCH * (np.arange(4) + 0.5), side, indexing="ij")
    place = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    place = place[np.hypot(place[:, 0], place[:, 2]) < DRUM - RIB - 0.53 * D]
    tilt = np.radians(TILT)
    height = place @ np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    place = place[np.argsort(height, kind="stable")[:count]]
    radius = 0.5 * D * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD, count)
    beads = make_packing(place, np.repeat(radius[:, None], 3, axis=1))
    beads.v[:] = rng.uniform(-0.1, 0.1, (count, 3))
    write_h5(case.folder / "start.h5", beads)
    return count


def write_ribs(case: Case) -> None:
    """Write radial ribs inside the drum as an STL, two triangles each."""
    lines = ["solid ribs"]
    for angle in 2.0 * np.pi * np.arange(RIBS) / RIBS:
        out = np.array([np.sin(angle), 0.0, np.cos(angle)])
        foot, top = DRUM * out, (DRUM - RIB) * out
        along = np.array([0.0, WIDTH, 0.0])
        for corners in ((foot, top, top + along), (foot, top + along, foot + along)):
            lines += ["facet normal 0 0 0", "outer loop"]
            lines += ["vertex " + " ".join(f"{value:.9g}" for value in x) for x in corners]
            lines += ["endloop", "endfacet"]
    (case.folder / "ribs.stl").write_text("\n".join([*lines, "endsolid ribs", ""]))


def slope_of(steps: list[Step]) -> tuple[float, float]:
    """Slope [deg] of the surface in its middle half, and its distance from the axis [m].

    The surface is where the mean solid fraction of columns one bead wide falls to half of that
    of the bed.
    """
    edges = np.arange(-DRUM, DRUM + 0.5 * D, D)
    fraction = np.zeros((len(edges) - 1, len(edges) - 1))
    for step in steps:
        x, radius = step.grains["x"], step.grains["axes"][:, 0]
        fraction += np.histogram2d(x[:, 0], x[:, 2], (edges, edges),
                                   weights=4.0 / 3.0 * np.pi * radius**3)[0]  # fmt: skip
    fraction /= len(steps) * D * D * WIDTH
    middle = 0.5 * (edges[1:] + edges[:-1])
    across, height = [], []
    for k in np.flatnonzero(np.abs(middle) < 0.5 * DRUM):
        full = int(np.flatnonzero(fraction[k] > 0.3)[-1])
        part = (fraction[k, full] - 0.3) / (fraction[k, full] - fraction[k, full + 1])
        across.append(middle[k])
        height.append(middle[full] + part * D)
    line = np.polyfit(across, height, 1)
    return float(np.degrees(np.arctan(-line[0]))), float(-line[1] / np.hypot(1.0, line[0]))


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
    edges = np.arange(-DRUM, 0.0, 0.5 * D)
    count = np.histogram(place, edges)[0]
    total = np.histogram(place, edges, weights=speed)[0]
    good = count > 0.2 * np.median(count[: len(count) // 2])  # not the few above the surface
    return np.column_stack([total[good] / count[good], 0.5 * (edges[1:] + edges[:-1])[good]])


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


def judge(case: Case, beads: int, last: Step) -> None:
    """No bead is lost, the drum carries their weight, the ledger closes."""
    radius = np.linalg.norm(last.grains["x"][:, ::2], axis=1)
    case.below("beads lost", float(beads - len(last.grains["id"]) + (radius > DRUM).sum()), 0.0)
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
    ax.plot(DRUM / D * np.cos(angle), DRUM / D * np.sin(angle), "k", lw=0.8)
    x = np.array([-1.0, 1.0]) * 0.9 * DRUM
    for slope, style in ((SLOPE, "k"), (line[0], "C1--")):
        tilt = np.radians(slope)
        ax.plot(x / D, (-x * np.tan(tilt) - line[1] / np.cos(tilt)) / D, style, lw=1.0,
                label=f"{'measured' if style == 'k' else 'Talus'}, {slope:.1f} deg")  # fmt: skip
    ax.set(xlabel="x / diameter of a bead", ylabel="z / diameter", aspect="equal")
    ax.legend(fontsize=8)
    measured = np.loadtxt(case.folder / "measured.csv", delimiter=",", skiprows=1)
    ax2.plot(measured[:, 0], 1e3 * measured[:, 1], "kx", label="measured, Alizadeh et al. 2013")
    ax2.plot(found[:, 0], 1e3 * found[:, 1], "o", ms=4, label="Talus")
    deep = np.array([-DRUM, 0.0])
    ax2.plot(OMEGA * deep, 1e3 * deep, "0.6", lw=0.8, label="rigid turn")
    ax2.set(xlabel="velocity down the slope [m/s]", ylabel="distance from the axis [mm]",
            ylim=(-120.0, -20.0))  # fmt: skip
    ax2.legend(fontsize=8)
    case.save(fig)
