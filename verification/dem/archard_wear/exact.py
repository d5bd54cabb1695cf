"""Wear by Archard's law: a dragged block to rounding, sliding to rest against the energy."""

import shutil

import h5py
import numpy as np

from talus.compare import max_of, same_arrays
from talus.packing import make_packing, write_h5
from talus.verification import Case, field_steps, read_history

RADIUS, DENSITY, POISSON, YOUNG = 1.0e-3, 2650.0, 0.25, 1.0e8
FRICTION, GRAVITY = 0.2, 9.81
MASS = DENSITY * 4.0 / 3.0 * np.pi * RADIUS**3
MODULUS = 0.5 * YOUNG / (1.0 - POISSON**2)
DRAG, DT, STEPS, ROWS = 0.5, 4.0e-6, 10000, 5  # speed [m/s], step [s], steps, rows
SPEED = 0.2  # of what slides to rest [m/s]
BORE = 0.01
RATES = {"floor": 1.0e-3 / 2.0e9, "plate": 2.0e-3 / 2.0e9, "bore": 1.0e-4 / 5.0e9}  # k/H [1/Pa]
PLACES = {"floor": (1, 0), "plate": (0, 1), "bore": (0, 2)}  # numbers of wall and surface
ROUND = 1.0e-9  # of the load: an overlap of 1.4e-7 m between places of some 0.05 m
FILES = ("drag_wear.csv", "drag_surfaces.csv", "drag_walls.csv")


def run(case: Case) -> None:
    """Drag the block, then let grains slide to rest."""
    judge_drag(case)
    judge_slide(case)


def overlap(curvature: float) -> float:
    """Return the overlap of a sphere at rest on a surface with an effective curvature [m]."""
    return (0.75 * MASS * GRAVITY / MODULUS * np.sqrt(curvature)) ** (2.0 / 3.0)


def block() -> dict[str, np.ndarray]:
    """Return the centres of the grains on each."""
    line = np.array([[0.0023 + 0.0031 * i, 0.0, 0.0] for i in range(3)])
    on_plane = RADIUS - overlap(1.0 / RADIUS)
    plate = [line + [0.0, y, on_plane] for y in (0.0053, 0.0107)]
    in_bore = RADIUS - overlap(1.0 / RADIUS)  # settles by damping
    return {
        "floor": line + [0.0, -0.01, on_plane - 0.05],
        "plate": np.concatenate(plate),
        "bore": line[:1] + [0.0, 0.05, in_bore],
    }


def judge_drag(case: Case) -> None:
    """Compare with k F_n s/H of the weight and of the way between two rows."""
    parts = block()
    x = np.concatenate(list(parts.values()))
    v = np.tile([DRAG, 0.0, 0.0], (len(x), 1))
    write_h5(case.folder / "block.h5", make_packing(x, np.full((len(x), 3), RADIUS), v=v))
    words = {
        "PULL": FRICTION * GRAVITY, "T_END": STEPS * DT, "DT": DT, "ROW": STEPS // ROWS * DT,
    }  # fmt: skip
    text = (case.folder / "drag.nml").read_text()
    for word, value in words.items():
        text = text.replace(word, f"{value:.17g}")
    (case.folder / "drag.nml").write_text(text)
    case.run("talus-dem", "drag.nml", "--threads=1")
    way = np.array([step.grains["x"][:, 0] for step in field_steps(case.folder / "drag.h5")])
    case.ways = dict(zip(parts, np.split(way, [3, 9], axis=1), strict=True))
    for name, rate in RATES.items():
        volume = np.diff(worn(case, "drag", PLACES[name])[1:])
        exact = rate * MASS * GRAVITY * np.diff(case.ways[name].sum(1)[1:])
        off = np.abs(volume / exact - 1.0).max()
        limit = ROUND if name != "bore" else 1.0e-6
        note = "" if name != "bore" else "its load still settles"
        case.below(f"{name}: volume / (k F s/H) - 1, rows {ROWS - 1}", float(off), limit, note)
    judge_triangles(case, worn(case, "drag", PLACES["plate"]))
    judge_bits(case)


def worn(case: Case, stem: str, which: tuple[int, int]) -> np.ndarray:
    """Return the volume of a wall or surface over time [m3]."""
    rows = read_history(case.folder / f"{stem}_wear.csv")
    mine = (rows["wall"] == which[0]) & (rows["surface"] == which[1])
    return rows["volume"][mine]


def judge_triangles(case: Case, plate: np.ndarray) -> None:
    """Compare the two triangles of the plate with the way of each grain over them."""
    with h5py.File(case.folder / "drag.h5") as file:
        surfaces = file["steps"][sorted(file["steps"])[-1]]["surfaces"]
        owner, wear = surfaces["surface"][...], surfaces["wear"][...]
        depth = surfaces["wear_depth"][...][owner == 1]
    mine = wear[owner == 1]
    off = abs(mine.sum() / plate[-1] - 1.0)
    case.below("triangles: sum / volume of the plate - 1", off, 1.0e-11, "60 000 additions")
    start, end = case.ways["plate"][0], case.ways["plate"][-1]
    edge = 2.0 * np.repeat([0.0053, 0.0107], 3)  # where the ways cross the diagonal
    low = (end - np.clip(edge, start, end)).sum() / (end - start).sum()
    exact = max(low, 1.0 - low)
    case.metric("triangles: larger share", mine.max() / plate[-1], exact, 4e-4, "steps at its ends")
    off = abs(depth[0] * 4.0e-4 / mine[0] - 1.0)
    case.below("triangles: depth x area / volume - 1", off, 1.0e-12)


def judge_bits(case: Case) -> None:
    """Run on two threads and from a checkpoint: the same rows, the same wear of triangles."""
    kept = {name: (case.folder / name).read_text() for name in FILES}
    first = last_surfaces(case)
    chosen = sorted(case.folder.glob("drag.chk*.h5"), key=lambda p: p.stat().st_mtime)[1]
    shutil.copy(chosen, case.folder / "middle.chk.h5")
    case.run("talus-dem", "drag.nml", "--threads=2")
    case.same_histories("two threads", kept, 0.0)
    case.run("talus-dem", "drag.nml", "--threads=1", "--restart=middle.chk.h5")
    case.same_histories("restart", kept, 0.0)
    same = float(same_arrays(first, last_surfaces(case)))
    case.metric("restart: the same wear of triangles", same, 1.0, 0.0)


def last_surfaces(case: Case) -> dict[str, np.ndarray]:
    """Return the datasets of the surfaces in the last step."""
    with h5py.File(case.folder / "drag.h5") as file:
        last = file["steps"][sorted(file["steps"])[-1]]["surfaces"]
        return {name: last[name][...] for name in last}


def judge_slide(case: Case) -> None:
    """Compare with the kinetic energy that is lost, and with the friction of the ledger."""
    rest = overlap(1.0 / RADIUS)
    spots = np.array([[0.0, 0.004 * i, 0.0] for i in range(4)])
    x = [spots + [0, 0, z + RADIUS - rest] for z in (0.0, 0.05)]
    x = np.concatenate([*x, [[0.0, 0.07, 0.05 + RADIUS - rest]]])
    v = np.tile([SPEED, 0.0, 0.0], (len(x), 1))
    omega = np.zeros_like(v)
    omega[-1, 1] = SPEED / (RADIUS - 0.5 * rest)  # rolls: no slip where the force acts
    pack = make_packing(x, np.full((len(x), 3), RADIUS), v=v, omega=omega)
    write_h5(case.folder / "sliders.h5", pack)
    text = (case.folder / "slide.nml").read_text().replace("DT", "4.0e-6")
    (case.folder / "slide.nml").write_text(text)
    case.run("talus-dem", "slide.nml", "--threads=1")
    paths = np.array([worn(case, "slide", (1, 0)), worn(case, "slide", (0, 1))]) / 1e-12
    lost = 0.5 * MASS * SPEED**2 * 4
    friction = read_history(case.folder / "slide_energy.csv")["friction"]
    off = max_of(abs(FRICTION * p[-1] / lost - 1.0) for p in paths)
    note = "but for what the dashpot of the last swing takes"
    case.below("mu F_n s / kinetic energy at the start - 1", off, 1.0e-4, note)
    of_all = abs(FRICTION * paths.sum(0)[-1] / friction[-1] - 1.0)
    case.below("mu F_n s / friction of the ledger - 1", of_all, 1.0e-4, note)
    case.below("grain that rolls: volume [m3]", abs(worn(case, "slide", (0, 2))[-1]), 0.0)
    end = field_steps(case.folder / "slide.h5")[-1].grains["v"]
    case.below("speed at the end / at the start", np.abs(end[:-1]).max() / SPEED, 1.0e-3)
    case.metric("speed of the grain that rolls / at the start", end[-1, 0] / SPEED, 1.0, 1.0e-6)
    draw(case, paths, lost)


def draw(case: Case, paths: np.ndarray, lost: float) -> None:
    """Draw the wear of the block over its way, and of what slides to rest over time."""
    fig, axes = case.figure(ncols=2, figsize=(10.0, 3.8))
    for name in ("floor", "plate"):
        way = case.ways[name].sum(1) - case.ways[name].sum(1)[0]
        line = axes[0].plot(way * 1e3, RATES[name] * MASS * GRAVITY * way * 1e9)[0]
        volume = worn(case, "drag", PLACES[name]) * 1e9
        axes[0].plot(way * 1e3, volume, "o", color=line.get_color(), label=name)
    axes[0].set(xlabel="way of all grains [mm]", ylabel="worn volume [mm3]")
    axes[0].legend()
    t = np.linspace(0.0, 0.15, paths.shape[1])
    gone = np.minimum(t, SPEED / (FRICTION * GRAVITY))
    way = SPEED * gone - 0.5 * FRICTION * GRAVITY * gone**2
    full = SPEED**2 / (2.0 * FRICTION * GRAVITY)
    axes[1].plot(t, lost * way / full * 1e6, label="kinetic energy lost")
    axes[1].plot(t, FRICTION * paths[0] * 1e6, "o", label="wall, mu F_n s")
    axes[1].plot(t, FRICTION * paths[1] * 1e6, "x", label="triangles, mu F_n s")
    axes[1].set(xlabel="time [s]", ylabel="energy [uJ]")
    axes[1].legend()
    case.save(fig)
