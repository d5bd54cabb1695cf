"""A bar dragged through a bed: the whole bed from two places, and windows that go with the bar."""

import json

import numpy as np

from talus.compare import extent, max_of
from talus.generate import cloud, uniform_sizes
from talus.packing import FIXED, read_packing, write_h5
from talus.verification import Case, field_steps, read_history

RADIUS, SPREAD, COUNT = 2.0e-3, 0.1, 400  # mean [m], relative half width, of a tile
LENGTH, WIDTH = 0.04, 0.0133  # of the tile [m]
TILES, HOLD = 14, 8.0e-3  # of the whole bed; depth of held ends [m]
BAR, DEPTH, SPEED, WAY = 5.0e-3, 0.022, 0.4, 0.2  # radius, below the surface, [m/s], [m]
SKIP = 0.04  # before the mean begins [m]
BLOCK = 0.02  # of the way, for standard errors [m]
PLACES = {"whole": 0.15, "other": 0.19}  # where the bar begins [m]
WINDOWS = {"window": 0.08, "narrow": 0.04}  # least distance to the ends [m]
GRAVITY = 9.81


def run(case: Case) -> None:
    """Make a tile, drag the bar through the whole bed twice, then in windows; compare."""
    top = tile(case)
    found = {name: whole(case, name, place, top) for name, place in PLACES.items()}
    found |= {name: window(case, name, reach, top) for name, reach in WINDOWS.items()}
    truth = np.mean([found[name]["force"] for name in PLACES])
    error = np.hypot(*(found[name]["error"] for name in PLACES)) / 2.0
    own = found["window"]
    case.metric("force in the window / in the whole bed", own["force"] / truth, 1.0, 0.15,
                "two standard errors of both")  # fmt: skip
    apart = abs(own["force"] - truth) / np.hypot(error, own["error"])
    case.below("difference / standard error", float(apart), 2.5)
    scatter = np.mean([found[name]["scatter"] for name in PLACES])
    case.metric("scatter in the window / in the whole bed", own["scatter"] / scatter, 1.0, 0.25)
    case.above("grains of the whole bed / of the window", TILES * COUNT / own["grains"], 2.5)
    case.below("grains at the front have moved, root mean square, of a radius",
               max_of(own["moved"]) / RADIUS, 1.5)  # fmt: skip
    case.below("closure of the ledger, relative", max_of(f["closure"] for f in found.values()),
               1e-3)  # fmt: skip
    case.below("cost of entering and leaving, of the run", own["share"], 0.05)
    case.below("grains that are neither there nor booked", max_of(own["lost"]), 0.0)
    draw(case, found, truth)


def deck(case: Case, name: str, packing: str, t_end: float, *parts: str) -> str:
    """Write a deck; return its name."""
    text = (case.folder / "bed.nml").read_text()
    text = text.replace("PACKING", packing).replace("WIDTH", f"{WIDTH}")
    head = f"&run title = 'Moving window', t_end = {t_end:.9g}, gravity = 0.0, 0.0, {-GRAVITY} /\n"
    (case.folder / f"{name}.nml").write_text(head + text + "".join(parts))
    return f"{name}.nml"


def tile(case: Case) -> float:
    """Settle a tile that is periodic along the way, at rest; return the height of its surface."""
    sizes = uniform_sizes(COUNT, SPREAD, np.random.default_rng(2))
    box = np.array([LENGTH, WIDTH, 0.12])
    write_h5(case.folder / "cloud.h5", cloud(sizes, box, np.full(3, RADIUS), seed=2))
    cell = f"&cell size = {LENGTH}, {WIDTH + 2e-3}, 0.3, origin = 0.0, -1.0e-3, -0.1, "
    cell += "periodic = 'a' /\n"
    end = "&output every_time = 9.0, packing = '{}.h5' /\n"
    case.run("talus-dem", deck(case, "settle", "cloud", 0.6, cell, end.format("soft"),
                               "&dynamics dt_factor = 0.3, damping = 2.0 /\n"))  # fmt: skip
    rest = "&relaxation damping = 'adaptive', dt_factor = 0.2 /\n"
    rest += "&equilibrium unbalanced = 1.0e-7, energy_ratio = 1.0e-12, check_every = 200 /\n"
    case.run("talus-dem", deck(case, "rest", "soft", 3.0, cell, end.format("tile"), rest))
    packing = read_packing(case.folder / "tile.h5")
    return float(np.quantile(packing.x[:, 2], 0.97)) + RADIUS


def bar(place: float, top: float) -> str:
    """Return the bar and what is written."""
    return (
        f"&cylinder id = 'bar', side = 'outside', centre = {place}, {0.5 * WIDTH}, {top - DEPTH}, "
        f"axis = 0.0, 1.0, 0.0, radius = {BAR}, length = {2.0 * WIDTH}, "
        f"velocity = {SPEED}, 0.0, 0.0, material = 'grain' /\n"
        "&dynamics dt_factor = 0.3 /\n&history every_time = 5.0e-4 /\n"
        "&output every_time = 0.1, fields = 'velocity' /\n"
    )


def cleared(case: Case, name: str, tiles: int, place: float, top: float) -> None:
    """Lay tiles side by side, without the grains that the bar would stand in."""
    bed = read_packing(case.folder / "tile.h5").repeated((tiles, 1, 1))
    away = np.hypot(bed.x[:, 0] - place, bed.x[:, 2] - (top - DEPTH))
    bed = bed.take(away > BAR + bed.axes[:, 0])
    write_h5(case.folder / f"{name}_bed.h5", bed)


def whole(case: Case, name: str, place: float, top: float) -> dict:
    """Drag the bar through all tiles, whose ends are held."""
    cleared(case, name, TILES, place, top)
    bed = read_packing(case.folder / f"{name}_bed.h5")
    ends = (bed.x[:, 0] < HOLD) | (bed.x[:, 0] > TILES * LENGTH - HOLD)
    bed.kind[ends] = FIXED
    write_h5(case.folder / f"{name}_bed.h5", bed)
    case.run("talus-dem", deck(case, name, f"{name}_bed", WAY / SPEED, bar(place, top)))
    return judged(case, name)


def window(case: Case, name: str, reach: float, top: float) -> dict:
    """Drag the bar in a window that goes with it."""
    behind = round(reach / LENGTH)
    place = (behind + 0.5) * LENGTH
    cleared(case, name, 2 * behind + 1, place, top)
    group = f"&window surface = 'bar', tile = 'tile.h5', behind = {reach}, ahead = {reach}, "
    group += f"hold = {HOLD}, moved = {2 if name == 'window' else 6}, every_time = 2.5e-3 /\n"
    case.run("talus-dem", deck(case, name, f"{name}_bed", WAY / SPEED, bar(place, top), group))
    found = judged(case, name)
    rows = read_history(case.folder / f"{name}_window.csv")
    start = len(read_packing(case.folder / f"{name}_bed.h5").id)
    summary = json.loads((case.folder / f"{name}_summary.json").read_text())
    timers = summary["timers"]
    counts = start + rows["entered"][-1] - rows["left"][-1]
    return found | {
        "grains": float(np.mean(start + rows["entered"] - rows["left"])), "moved": rows["moved"],
        "lost": [abs(counts - len(found["last"]["id"]))],
        "share": timers["sources and sinks"] / summary["wall_time_s"],
    }  # fmt: skip


def judged(case: Case, name: str) -> dict:
    """Mean of the force against the way, its standard error and scatter, closure."""
    rows = read_history(case.folder / f"{name}_surfaces.csv")
    way, force = SPEED * rows["time"], -rows["force_x"]
    energy = read_history(case.folder / f"{name}_energy.csv")
    edges = np.arange(SKIP, WAY + 1e-9, BLOCK)
    pairs = zip(edges[:-1], edges[1:], strict=True)
    block = np.array([force[(way > a) & (way <= b)].mean() for a, b in pairs])
    return {
        "name": name, "way": way, "curve": force, "force": float(block.mean()),
        "error": float(block.std(ddof=1) / np.sqrt(len(block))),
        "scatter": float(force[way > SKIP].std()), "closure": extent(energy["relative_closure"]),
        "last": field_steps(case.folder / f"{name}.h5")[-1].grains,
    }  # fmt: skip


def draw(case: Case, found: dict, truth: float) -> None:
    """Forces over the way, and the grains of the window and of the whole bed at the end."""
    fig, (ax, ax2, ax3) = case.figure(nrows=3, figsize=(9.5, 8.5))
    for k, (name, item) in enumerate(found.items()):
        smooth = np.convolve(item["curve"], np.ones(20) / 20, "same")
        label = f"{name}: {item['force']:.3f} ± {item['error']:.3f} N"
        ax.plot(1e3 * item["way"], smooth, color=f"C{k}", lw=0.9, label=label)
    ax.axhline(truth, color="k", lw=0.8, ls=":")
    ax.set(xlabel="way of the bar [mm]", ylabel="force against it [N]", ylim=(0.0, None))
    ax.legend(fontsize=8, ncols=2)
    for one, name in ((ax2, "whole"), (ax3, "window")):
        g = found[name]["last"]
        shown = np.where(g["kind"] == FIXED, -0.05, np.linalg.norm(g["v"], axis=1))
        dots = one.scatter(1e3 * g["x"][:, 0], 1e3 * g["x"][:, 2], s=7, c=shown, vmin=-0.05,
                           vmax=0.4)  # fmt: skip
        fig.colorbar(dots, ax=one, label="speed [m/s]")
        one.set(xlabel="x [mm]", ylabel="z [mm]", aspect="equal", title=name)
    case.save(fig)
