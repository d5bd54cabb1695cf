"""A bar dragged through a bed that wakes before it, beside the whole bed."""

import importlib.util
import json
import resource
from pathlib import Path
from types import ModuleType

import numpy as np
from dragged_bar import judged

import talus
from talus.mesh import box, write_mesh
from talus.packing import read_packing, write_h5
from talus.verification import Case

BED = Path(talus.__file__).resolve().parents[2] / "verification/dem/moving_window"
PLACE, BEHIND, HELD = 0.15, 0.045, 8.0e-3  # of the bar, kept behind it, held there [m]
REACHES = {"opened": 0.08, "near": 0.05}  # ahead of the bar [m]
YOUNG, STEP, EXCHANGE = 5.0e5, 1.25e-5, 1.25e-4  # [Pa], [s], [s]


def run(case: Case) -> None:
    """Drag the bar through the whole bed twice, then through beds that wake before it."""
    spec = importlib.util.spec_from_file_location("moving_window", BED / "exact.py")
    window = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(window)
    (case.folder / "bed.nml").write_text((BED / "bed.nml").read_text())
    top = window.tile(case)
    found, seconds = {}, {}
    for name, place in window.PLACES.items():
        began = resource.getrusage(resource.RUSAGE_CHILDREN)
        found[name] = window.whole(case, name, place, top)
        seconds[name] = spent(began)
    truth = np.mean([found[name]["force"] for name in window.PLACES])
    error = np.hypot(*(found[name]["error"] for name in window.PLACES)) / 2.0
    scatter = np.mean([found[name]["scatter"] for name in window.PLACES])
    for name, reach in REACHES.items():
        began = resource.getrusage(resource.RUSAGE_CHILDREN)
        found[name] = opened(case, window, name, reach, top)
        seconds[name] = spent(began)
    own, near = found["opened"], found["near"]
    case.metric("force / in the whole bed", own["force"] / truth, 1.0, 0.10)
    case.below("difference / standard error",
               float(abs(own["force"] - truth) / np.hypot(error, own["error"])), 2.5)  # fmt: skip
    case.metric("scatter / in the whole bed", own["scatter"] / scatter, 1.0, 0.25)
    case.below("opened 50 mm ahead: force / in the whole bed, held ends there give 1.20",
               near["force"] / truth, 1.20)  # fmt: skip
    case.metric("opened 50 mm ahead: scatter / in the whole bed", near["scatter"] / scatter, 1.0,
                0.25)  # fmt: skip
    case.above("grains of the whole bed / awake", window.TILES * window.COUNT / own["grains"], 3.0)
    case.below("cost of conversions, of the run", own["share"], 0.10)
    case.below("energy in an exchange, less what a conversion brought, of the work of the bar",
               own["jump"], 1e-2)  # fmt: skip
    case.above("CPU seconds of the whole bed / of the opened one",
               seconds["whole"] / seconds["opened"], 1.0)  # fmt: skip
    draw(case, window, found, truth)


def spent(began: resource.struct_rusage) -> float:
    """CPU seconds of all programs since then."""
    now = resource.getrusage(resource.RUSAGE_CHILDREN)
    return now.ru_utime + now.ru_stime - began.ru_utime - began.ru_stime


def opened(case: Case, window: ModuleType, name: str, reach: float, top: float) -> dict:
    """Run with elements that are opened so far ahead of the bar."""
    folder = case.folder / name
    folder.mkdir()
    tile = read_packing(case.folder / "tile.h5")
    write_h5(folder / "tile.h5", tile)
    bed = tile.repeated((window.TILES, 1, 1))
    bed.cell = bed.corner = bed.shift = None
    height = top - window.DEPTH
    away = np.hypot(bed.x[:, 0] - PLACE, bed.x[:, 2] - height) > window.BAR + bed.axes[:, 0]
    near = np.abs(bed.x[:, 0] - PLACE) < reach + window.LENGTH
    write_h5(folder / "awake.h5", bed.take(np.flatnonzero(away & near)))
    size = np.array([window.TILES * window.LENGTH, window.WIDTH, top])
    write_mesh(folder / "bed.h5", box(np.zeros(3), size, (4 * window.TILES, 1, 4)))
    values = {
        "PLACE": PLACE, "MIDDLE": 0.5 * window.WIDTH, "HEIGHT": height, "SPEED": window.SPEED,
        "BAR": window.BAR, "WITHIN": reach - window.BAR, "BEHIND": BEHIND, "HELD": HELD,
        "T_END": window.WAY / window.SPEED, "EXCHANGE": EXCHANGE, "YOUNG": YOUNG, "STEP": STEP,
        "LONG": 2.0 * window.WIDTH, "TILES": window.TILES,
    }  # fmt: skip
    for deck in ("coupled", "grains", "solid"):
        text = (case.folder / f"{deck}.nml").read_text()
        if deck == "grains":
            laws = (BED / "bed.nml").read_text()
            text = text.replace("LAWS\n", laws.split("\n", 1)[1])
            text = text.replace("PACKING", "awake").replace("WIDTH", f"{window.WIDTH}")
        for key, value in values.items():
            text = text.replace(f"@{key}@", f"{value:.9g}")
        (folder / f"{deck}.nml").write_text(text)
    case.run("talus-couple", f"{name}/coupled.nml")
    summary = json.loads((folder / "coupled_summary.json").read_text())
    found = judged(window, folder)
    found["grains"] = found["told"]["awake"][1:].mean()
    found["share"] = summary["timers"]["conversions"] / summary["wall_time_s"]
    found["jump"] /= found["force"] * window.WAY
    return found


def draw(case: Case, window: ModuleType, found: dict, truth: float) -> None:
    """Forces over the way, grains awake, and the grains of both at the end."""
    fig, (ax, ax2, ax3, ax4) = case.figure(nrows=4, figsize=(9.5, 10.5))
    for k, (name, item) in enumerate(found.items()):
        smooth = np.convolve(item["curve"], np.ones(20) / 20, "same")
        label = f"{name}: {item['force']:.3f} ± {item['error']:.3f} N"
        ax.plot(1e3 * item["way"], smooth, color=f"C{k}", lw=0.9, label=label)
    ax.axhline(truth, color="k", lw=0.8, ls=":")
    ax.set(xlabel="way of the bar [mm]", ylabel="force against it [N]", ylim=(0.0, None))
    ax.legend(fontsize=8, ncols=2)
    for name in REACHES:
        told = found[name]["told"]
        ax2.step(1e3 * window.SPEED * told["time"], told["awake"], where="post", label=name)
    ax2.axhline(window.TILES * window.COUNT, color="k", lw=0.8, ls=":", label="whole bed")
    ax2.set(xlabel="way of the bar [mm]", ylabel="grains awake", ylim=(0.0, None))
    ax2.legend(fontsize=8)
    for one, name in ((ax3, "whole"), (ax4, "opened")):
        g = found[name]["last"]
        shown = np.where(g["kind"] != 0, -0.05, np.linalg.norm(g["v"], axis=1))
        dots = one.scatter(1e3 * g["x"][:, 0], 1e3 * g["x"][:, 2], s=7, c=shown, vmin=-0.05,
                           vmax=0.4)  # fmt: skip
        fig.colorbar(dots, ax=one, label="speed [m/s]")
        one.set(xlabel="x [mm]", ylabel="z [mm]", aspect="equal", title=name,
                xlim=(0.0, 1e3 * window.TILES * window.LENGTH))  # fmt: skip
    case.save(fig)
