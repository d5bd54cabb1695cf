"""A bar dragged through a bed that wakes before it and closes to continuum that yields."""

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
from dragged_bar import judged

import talus
from talus.mesh import box, write_mesh
from talus.packing import read_packing, write_h5
from talus.verification import Case

CASES = Path(talus.__file__).resolve().parents[2] / "verification"
PLACE, REACH, BEHIND = 0.15, 0.12, 0.12  # of the bar, opened ahead, closed behind it [m]
YOUNG, STEP, EXCHANGE = 2.0e6, 1.25e-5, 1.25e-4  # [Pa], [s], [s]
RUNS = {"stays": "", "closes": f", close_behind = {BEHIND}"}


def run(case: Case) -> None:
    """Drag the bar twice, without and with closing."""
    window = load("dem/moving_window")
    (case.folder / "bed.nml").write_text((CASES / "dem/moving_window/bed.nml").read_text())
    top = window.tile(case)
    found = {name: dragged(case, window, name, top) for name in RUNS}
    stays, own = found["stays"], found["closes"]
    told = own["told"]
    work = own["force"] * window.WAY
    case.metric("force / without closing", own["force"] / stays["force"], 1.0, 0.10)
    apart = abs(own["force"] - stays["force"]) / np.hypot(own["error"], stays["error"])
    case.below("difference / standard error", float(apart), 2.5)
    case.metric("scatter / without closing", own["scatter"] / stays["scatter"], 1.0, 0.25)
    case.above("elements born again", float(told["reborn"].sum()), 24.0)
    quarter = told["time"] / (window.WAY / window.SPEED)
    late, before = (
        told["awake"][(quarter > a) & (quarter <= a + 0.25)].mean() for a in (0.75, 0.5)
    )
    case.below("grains awake, last quarter of the way / the quarter before", late / before, 1.1)
    case.below("grains awake at the end / without closing",
               told["awake"][-1] / stays["told"]["awake"][-1], 0.9)  # fmt: skip
    case.below("energy of a conversion, of the work of the bar",
               np.abs(told["kinetic"] + told["elastic"]).max() / work, 1e-2)  # fmt: skip
    case.below("energy in an exchange, less what a conversion brought, of the work of the bar",
               own["jump"] / work, 1e-2)  # fmt: skip
    case.below("taken back by the law in the mean, over the pressure",
               told["gap_yield_mean"].max(), 0.5)  # fmt: skip
    draw(case, window, found)


def load(name: str) -> ModuleType:
    """Return the module of another case."""
    spec = importlib.util.spec_from_file_location(name.split("/")[1], CASES / name / "exact.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def dragged(case: Case, window: ModuleType, name: str, top: float) -> dict:
    """Run with or without closing."""
    folder = case.folder / name
    folder.mkdir()
    tile = read_packing(case.folder / "tile.h5")
    write_h5(folder / "tile.h5", tile)
    bed = tile.repeated((window.TILES, 1, 1))
    bed.cell = bed.corner = bed.shift = None
    height = top - window.DEPTH
    away = np.hypot(bed.x[:, 0] - PLACE, bed.x[:, 2] - height) > window.BAR + bed.axes[:, 0]
    near = np.abs(bed.x[:, 0] - PLACE) < REACH + window.LENGTH
    write_h5(folder / "awake.h5", bed.take(np.flatnonzero(away & near)))
    size = np.array([window.TILES * window.LENGTH, window.WIDTH, top])
    write_mesh(folder / "bed.h5", box(np.zeros(3), size, (4 * window.TILES, 1, 4)))
    values = {
        "PLACE": PLACE, "MIDDLE": 0.5 * window.WIDTH, "HEIGHT": height, "SPEED": window.SPEED,
        "BAR": window.BAR, "WITHIN": REACH - window.BAR, "T_END": window.WAY / window.SPEED,
        "EXCHANGE": EXCHANGE, "YOUNG": YOUNG, "STEP": STEP, "LONG": 2.0 * window.WIDTH,
        "TILES": window.TILES, "TOP": top,
    }  # fmt: skip
    laws = (case.folder / "bed.nml").read_text().split("\n", 1)[1]
    laws = laws.replace("PACKING", "awake").replace("WIDTH", f"{window.WIDTH}")
    for deck in ("coupled", "grains", "solid"):
        source = CASES / "couple/opened_bed" if deck == "grains" else case.folder
        text = (source / f"{deck}.nml").read_text()
        text = text.replace("LAWS\n", laws).replace(" CLOSING", RUNS[name])
        for key, value in values.items():
            text = text.replace(f"@{key}@", f"{value:.9g}")
        (folder / f"{deck}.nml").write_text(text)
    case.run("talus-couple", f"{name}/coupled.nml")
    return judged(window, folder)


def draw(case: Case, window: ModuleType, found: dict) -> None:
    """Forces over the way, grains awake, and the grains of both at the end."""
    fig, (ax, ax2, ax3, ax4) = case.figure(nrows=4, figsize=(9.5, 10.5))
    for k, (name, item) in enumerate(found.items()):
        smooth = np.convolve(item["curve"], np.ones(20) / 20, "same")
        label = f"{name}: {item['force']:.3f} ± {item['error']:.3f} N"
        ax.plot(1e3 * item["way"], smooth, color=f"C{k}", lw=0.9, label=label)
        told = item["told"]
        ax2.step(1e3 * window.SPEED * told["time"], told["awake"], where="post", label=name)
    ax.set(xlabel="way of the bar [mm]", ylabel="force against it [N]", ylim=(0.0, None))
    ax2.set(xlabel="way of the bar [mm]", ylabel="grains awake", ylim=(0.0, None))
    ax.legend(fontsize=8)
    ax2.legend(fontsize=8)
    for one, name in ((ax3, "stays"), (ax4, "closes")):
        g = found[name]["last"]
        shown = np.where(g["kind"] != 0, -0.05, np.linalg.norm(g["v"], axis=1))
        dots = one.scatter(1e3 * g["x"][:, 0], 1e3 * g["x"][:, 2], s=7, c=shown, vmin=-0.05,
                           vmax=0.4)  # fmt: skip
        fig.colorbar(dots, ax=one, label="speed [m/s]")
        one.set(xlabel="x [mm]", ylabel="z [mm]", aspect="equal", title=name,
                xlim=(0.0, 1e3 * window.TILES * window.LENGTH))  # fmt: skip
    case.save(fig)
