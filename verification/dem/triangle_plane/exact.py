"""A floor of irregular triangles against the analytic plane, and the force over a bend."""

from pathlib import Path

import numpy as np
from triangle_nets import net, write_stl

from talus.verification import Case, field_steps, read_history, write_packing

SHAPES = {"sphere": [2.0e-3, 2.0e-3, 2.0e-3], "ellipsoid": [2.5e-3, 2.0e-3, 1.5e-3]}
WALL = "&wall id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'quartz' /\n"
SURFACE = "&surface id = 'floor', file = 'floor.stl', material = 'quartz' /\n"
ROLL = "mass_scale = 1.0e6, inertia_scale = 1.0e6, dt = 2.0e-6"


def write_floor(path: Path, bend: float, size: float = 3.0e-3, count: int = 12) -> None:
    """Write a floor of irregular triangles as STL, bent across y = 0 (positive: a ridge)."""
    rng = np.random.default_rng(5)
    x = net(count, size)
    shift = rng.uniform(-0.3, 0.3, x.shape) * size
    shift[:, count // 2, 1] = 0.0
    x[..., :2] += shift[..., :2]
    x[..., 2] = -np.tan(0.5 * bend) * np.abs(x[..., 1])
    write_stl(path, x)


def throw(case: Case, shape: str, floor: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Throw a grain onto a floor; return time [s], position (n, 3) and velocity (n, 3)."""
    name = f"{shape}_{floor}.nml"
    deck = (case.folder / "deck.nml").read_text()
    (case.folder / name).write_text(deck + (WALL if floor == "wall" else SURFACE))
    x = np.array([[-9.0e-3, -8.0e-3, 2.6e-3]])
    write_packing(
        case.folder / "pack.h5",
        x,
        np.array([SHAPES[shape]]),
        v=np.array([[0.25, 0.2, -0.1]]),
        omega=np.array([[3.0, -5.0, 20.0]]),
        quat=np.array([[0.9, 0.3, -0.2, np.sqrt(1.0 - 0.94)]]),
    )
    case.run("talus-dem", name)
    steps = field_steps(case.folder / name.replace(".nml", ".h5"))
    return (
        np.array([s.time for s in steps]),
        np.array([s.grains["x"][0] for s in steps]),
        np.array([s.grains["v"][0] for s in steps]),
    )


def cross(case: Case, bend: float) -> tuple[np.ndarray, np.ndarray]:
    """Send a heavy pressed sphere over a bend; return its position y [m] and force (n, 3) [N]."""
    write_floor(case.folder / "floor.stl", bend)
    radius, speed, depth = 2.0e-3, 0.05, 4.0e-6
    write_packing(
        case.folder / "pack.h5",
        np.array([[0.3e-3, -3.0e-4, radius - depth]]),
        np.full((1, 3), radius),
        v=np.array([[0.0, speed, 0.0]]),
        omega=np.array([[-speed / radius, 0.0, 0.0]]),
    )
    deck = (case.folder / "deck.nml").read_text().replace("0.04", "0.012").replace("-9.81", "0.0")
    deck = deck.replace("&dynamics  dt = 2.0e-6", f"&relaxation {ROLL}")
    deck = deck.replace("&history   every_time = 1.0e-3", "&history   every_time = 2.0e-5")
    name = f"bend_{'ridge' if bend > 0.0 else 'valley'}.nml"
    (case.folder / name).write_text(deck + SURFACE)
    case.run("talus-dem", name)
    rows = read_history(case.folder / name.replace(".nml", "_surfaces.csv"))
    force = -np.stack([rows[f"force_{c}"] for c in "xyz"], -1)
    last = field_steps(case.folder / name.replace(".nml", ".h5"))[-1].grains["x"][0, 1]
    return np.linspace(-3.0e-4, last, len(force)), force


def run(case: Case) -> None:
    """Judge motion on triangles against the plane and jumps over bends; plot both."""
    fig, axes = case.figure(ncols=2, figsize=(9.0, 3.6))
    for shape, axis in SHAPES.items():
        write_floor(case.folder / "floor.stl", 0.0)
        time, x, v = throw(case, shape, "wall")
        _, y, w = throw(case, shape, "triangles")
        case.below(
            f"{shape}: position off the plane's / size", np.abs(y - x).max() / axis[0], 1e-10
        )
        case.below(f"{shape}: velocity off the plane's [m/s]", np.abs(w - v).max(), 1e-10)
        case.above(f"{shape}: way over the triangles [mm]", 1e3 * np.linalg.norm(y[-1] - y[0]), 8.0)
        (line,) = axes[0].plot(1e3 * time, 1e3 * x[:, 2], "-", label=f"{shape}, plane")
        axes[0].plot(1e3 * time[::3], 1e3 * y[::3, 2], "o", ms=4, color=line.get_color(),
                     label=f"{shape}, triangles")  # fmt: skip
    axes[0].set(xlabel="time [ms]", ylabel="height of the centre [mm]")
    for bend, name in ((0.02, "ridge"), (-0.02, "valley")):
        y, force = cross(case, bend)
        step = np.linalg.norm(np.diff(force, axis=0), axis=1)
        size = np.linalg.norm(force, axis=1)
        case.above(f"{name}: way past the bend [mm]", 1e3 * y[-1], 0.2)
        case.below(f"{name}: largest change of force in 1 um of way", step.max() / size.max(), 0.02)
        axes[1].plot(1e3 * y, size, label=f"{name} of 0.02 rad")
    axes[1].set(xlabel="way across the bend [mm]", ylabel="force [N]")
    for ax in axes:
        ax.legend()
    case.save(fig)
