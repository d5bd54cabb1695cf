"""The slope that is left when a gate goes away, against the friction that the grains show."""

import json

import numpy as np

from talus.generate import cloud, lattice
from talus.packing import FIXED, FREE, write_h5
from talus.verification import Case, field_steps, read_history

RADIUS, SPREAD = 2.0e-3, 0.2  # mean [m], relative half width
D = 2.0 * RADIUS
LONG, HIGH, WIDTH, REACH = 24.0 * D, 14.0 * D, 4.0 * D, 60.0 * D  # bed, channel, base [m]
SPEED, WAY, REST = 0.08, 22.0 * D, 0.3  # of the gate [m/s], [m]; after it has gone [s]
STRAIN, RATE, COUNT = 0.36, 0.3, 1000  # of the plane strain test [-], [1/s], [-]


def run(case: Case) -> None:
    """Settle a bed, let the gate go, shear the same grains in plane strain, compare."""
    grains = bed(case)
    words = {"WIDTH": f"{WIDTH}", "LONG": f"{LONG}", "SPEED": f"{SPEED}",
             "T_END": f"{WAY / SPEED + REST:.6g}"}  # fmt: skip
    deck(case, "settle", words)
    case.run("talus-dem", "settle_run.nml", "--threads=1")
    deck(case, "heap", words)
    case.run("talus-dem", "heap_run.nml", "--threads=1")
    steps = field_steps(case.folder / "heap_run.h5")
    x, depth = profile(steps[-1].grains)
    slope, fit = slope_of(x, depth)
    peak, critical = friction(case)
    case.metric("angle of repose [deg]", slope, critical, 3.0,
                "critical angle in plane strain")  # fmt: skip
    case.below("slope less the straight line, rms / diameter", fit, 0.6)
    final = steps[-1].grains
    free = final["kind"] == FREE
    case.below("grains lost", float(grains - free.sum() + (final["x"][free, 2] < -RADIUS).sum()),
               0.0)  # fmt: skip
    energy = read_history(case.folder / "heap_run_energy.csv")
    case.below("ledger", float(energy["relative_closure"].max()), 1e-4)
    given = abs(energy["gravity"][-1])
    case.below("kinetic energy at the end / work of gravity", energy["kinetic"][-1] / given, 1e-3)
    walls = read_history(case.folder / "heap_run_walls.csv")
    work = sum(walls["work"][walls["wall"] == w][-1] for w in (1, 2)) - energy["boundary"][-1]
    case.below("work of the walls less boundary work / work of gravity", abs(work) / given, 1e-9)
    draw(case, steps, slope, (peak, critical))


def deck(case: Case, part: str, words: dict[str, str]) -> None:
    """Write a deck with its words filled in."""
    text = (case.folder / f"{part}.nml").read_text()
    for word, value in words.items():
        text = text.replace(word, value)
    (case.folder / f"{part}_run.nml").write_text(text)


def bed(case: Case) -> int:
    """Write a cloud over a base of fixed grains whose tops lie at z = 0; return its grains."""
    base = lattice("sc", (round(REACH / D), round(WIDTH / D), 1), D, np.full(3, RADIUS))
    base.x += [RADIUS, RADIUS, -RADIUS]
    base.kind[:] = FIXED
    rng = np.random.default_rng(8)
    count = int(0.6 * LONG * WIDTH * HIGH / (4.0 / 3.0 * np.pi * RADIUS**3 * (1.0 + SPREAD**2)))
    sizes = RADIUS * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD, count)
    loose = cloud(sizes, np.array([LONG, WIDTH, 2.2 * HIGH]), np.ones(3), seed=8)
    write_h5(case.folder / "start.h5", loose.join(base.renumbered(count)))
    return count


def profile(grains: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Height of the surface over x, in steps of a diameter: the mean top of the highest grains.

    In each step and each quarter of the width the highest grain counts.
    """
    free = grains["kind"] == FREE
    x, r = grains["x"][free], grains["axes"][free, 0]
    edges = np.arange(0.0, REACH, D)
    column = np.digitize(x[:, 0], edges) - 1
    lane = np.floor(np.mod(x[:, 1], WIDTH) / D).astype(int)
    top = np.zeros((len(edges), round(WIDTH / D)))
    np.maximum.at(top, (column, np.minimum(lane, top.shape[1] - 1)), x[:, 2] + r)
    return edges + 0.5 * D, top.mean(axis=1)


def slope_of(x: np.ndarray, height: np.ndarray) -> tuple[float, float]:
    """Angle [deg] of a line through the surface between 0.15 and 0.85 of its height.

    Also the rms distance from the line over a diameter.
    """
    top = np.median(height[:4])
    last = int(np.argmax(height < 0.15 * top))
    first = int(np.flatnonzero(height[:last] > 0.85 * top)[-1])
    line = np.polyfit(x[first : last + 1], height[first : last + 1], 1)
    rms = np.sqrt(np.mean((np.polyval(line, x[first : last + 1]) - height[first : last + 1]) ** 2))
    return float(np.degrees(np.arctan(-line[0]))), float(rms / D)


def friction(case: Case) -> tuple[float, float]:
    """Peak and critical angle of the same grains in plane strain, without walls [deg]."""
    rng = np.random.default_rng(9)
    sizes = RADIUS * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD, COUNT)
    cube = cloud(sizes, np.full(3, 0.066), np.ones(3), seed=9, periodic=True)
    write_h5(case.folder / "cube.h5", cube)
    case.run("talus-dem", "press.nml", "--threads=1")
    start = json.loads((case.folder / "press_summary.json").read_text())["time_s"]
    deck(case, "shear", {"T_END": f"{start + STRAIN / RATE:.9g}"})
    case.run("talus-dem", "shear_run.nml", "--threads=1", "--restart=press.chk.h5")
    rows = read_history(case.folder / "shear_run_cell.csv")
    most, least = -rows["stress_zz"], -rows["stress_xx"]
    angle = np.degrees(np.arcsin((most - least) / (most + least)))
    smooth = np.convolve(angle, np.ones(16) / 16.0, mode="valid")
    strain = RATE * (rows["time"] - start)
    energy = read_history(case.folder / "shear_run_energy.csv")
    case.below("ledger of the plane strain test", float(energy["relative_closure"].max()), 1e-4)
    return float(smooth.max()), float(angle[strain > 0.5 * STRAIN].mean())


def draw(case: Case, steps: list, slope: float, angles: tuple[float, float]) -> None:
    """The surface as the gate goes, and its slope at the end."""
    fig, ax = case.figure(figsize=(8.0, 4.0))
    chosen = [int(k) for k in np.linspace(0, len(steps) - 1, 6)]
    for k in chosen:
        x, height = profile(steps[k].grains)
        last = k == chosen[-1]
        ax.plot(x / D, height / D, color="black" if last else "0.7", lw=1.5 if last else 0.8,
                label=f"{steps[k].time:.2f} s")  # fmt: skip
    top = np.median(height[:4])
    middle = float(np.interp(-0.5 * top, -height[: int(np.argmax(height <= 0.0))],
                             x[: int(np.argmax(height <= 0.0))]))  # fmt: skip
    way = np.array([-0.6, 0.6]) * top / np.tan(np.radians(slope))
    ax.plot((middle + way) / D, (0.5 * top - np.tan(np.radians(slope)) * way) / D, "--",
            label=f"slope {slope:.1f} deg")  # fmt: skip
    ax.set(xlabel="x / diameter", ylabel="height / diameter", xlim=(0.0, 55.0),
           title=f"plane strain: peak {angles[0]:.1f}, critical {angles[1]:.1f} deg")  # fmt: skip
    ax.set_aspect("equal")
    ax.legend(fontsize=8)
    case.save(fig)
