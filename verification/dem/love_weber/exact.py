"""Stress of a settled bed from contacts, walls and weight; the same afterwards; sums of fields."""

import h5py
import numpy as np

from talus.compare import max_of
from talus.verification import Case, field_steps, read_history, write_packing

AXES = np.array([2.5e-3, 2.0e-3, 1.5e-3])
SIDE, DENSITY, GRAVITY = 0.024, 2650.0, 9.81
EAST, NORTH = 3, 5


def cloud() -> tuple[np.ndarray, np.ndarray]:
    """96 grains on a 4 x 4 lattice of pitch 5.5 mm with random orientations."""
    rng = np.random.default_rng(3)
    i, j, k = np.meshgrid(np.arange(4), np.arange(4), np.arange(6), indexing="ij")
    x = np.column_stack([i.ravel(), j.ravel(), k.ravel()]) * 5.5e-3 + 3.7e-3
    x += rng.uniform(-2e-4, 2e-4, size=x.shape)
    quat = rng.normal(size=(len(x), 4))
    return x, quat / np.linalg.norm(quat, axis=1, keepdims=True)


def tensor(rows: dict[str, np.ndarray], name: str, row: int = -1) -> np.ndarray:
    """Nine columns of a history as a matrix."""
    return np.array([[rows[f"{name}_{a}{b}"][row] for b in "xyz"] for a in "xyz"])


def wall_forces(case: Case) -> np.ndarray:
    """Last force of the grains on each wall (5, 3) [N]."""
    rows = read_history(case.folder / "deck_walls.csv")
    last = rows["time"] == rows["time"][-1]
    return np.column_stack([rows[f"force_{a}"][last] for a in "xyz"])


def run(case: Case) -> None:
    """Compare with the boundary; measure again; sum the fields; refine the solid fraction."""
    x, quat = cloud()
    write_packing(case.folder / "pack.h5", x, np.tile(AXES, (len(x), 1)), quat=quat)
    case.run("talus-dem", "deck.nml", "--threads=1")
    rows = read_history(case.folder / "deck_measure_box.csv")
    sigma = tensor(rows, "stress")
    last = field_steps(case.folder / "deck.h5")[-1]
    judge_stress(case, sigma * rows["volume"][-1], last)
    case.run("talus-dem", "deck.nml", "--measure=deck.h5", "--output=after")
    again = read_history(case.folder / "after/deck_measure_core.csv")
    core = read_history(case.folder / "deck_measure_core.csv")
    case.below(
        "rows afterwards - rows of the run",
        max_of(float(np.abs(again[name] - core[name]).max()) for name in core),
        0.0,
        "same procedures, same bits",
    )
    judge_fields(case, sigma * rows["volume"][-1], last)
    judge_resolution(case)
    draw(case, rows)


def judge_stress(case: Case, total: np.ndarray, last: object) -> None:
    """Smooth walls at 0 have no moment, those opposite that of the side, weights of heights."""
    weight = DENSITY * 4.0 / 3.0 * np.pi * AXES.prod() * GRAVITY
    forces = wall_forces(case)
    moment = -(last.grains["x"].T * weight).sum(axis=1)
    exact = np.array([-SIDE * forces[EAST - 1, 0], -SIDE * forces[NORTH - 1, 1], moment[2]])
    on_walls = last.contacts["ids"][:, 0] < 0
    point, force = last.contacts["point"][on_walls], last.contacts["force"][on_walls]
    whole = np.einsum("ci,cj->ij", point, force)
    whole[:, 2] += moment
    scale = np.abs(total).max()
    case.below("all components, contact points on walls", abs(total - whole).max() / scale, 1e-3)
    error = np.abs(np.diag(total) / exact - 1.0)
    case.below("stress_xx from force on the wall", float(error[0]), 1e-3)
    case.below("stress_yy from force on the wall", float(error[1]), 1e-3)
    case.below("stress_zz from weights and heights", float(error[2]), 1e-3)


def judge_fields(case: Case, total: np.ndarray, last: object) -> None:
    """Sums over the grid against grains and contacts; the first state has nothing but mass."""
    with h5py.File(case.folder / "deck_grid_bed.h5") as file:
        step = file["steps"][sorted(file["steps"])[-1]]
        density, momentum = step["density"][...], step["momentum"][...]
        stress, solid = step["stress"][...], step["solid_fraction"][...]
    cell = (0.048 / 24) ** 2 * 0.064 / 32
    mass = DENSITY * 4.0 / 3.0 * np.pi * AXES.prod()
    case.below("mass on the grid", abs(density.sum() * cell / (mass * 96) - 1.0), 1e-12)
    wanted = mass * last.grains["v"].sum(axis=0)
    size = mass * np.abs(last.grains["v"]).sum()
    error = np.abs(momentum.sum(axis=0) * cell - wanted).max() / size
    case.below("momentum on the grid", float(error), 1e-12)
    error = np.abs(stress.sum(axis=0).reshape(3, 3) * cell - total).max() / np.abs(total).max()
    case.below("integral of stress - Love-Weber", float(error), 1e-12)
    volume = 4.0 / 3.0 * np.pi * AXES.prod() * 96
    case.below("solid volume on the grid", abs(solid.sum() * cell / volume - 1.0), 1e-12)
    case.slice = solid.reshape(32, 24, 24)[:, 12, :]


def judge_resolution(case: Case) -> None:
    """Solid fraction of the cylinder with more and more points to a grain that is cut."""
    deck = (case.folder / "deck.nml").read_text()
    with h5py.File(case.folder / "deck.h5") as whole, h5py.File(case.folder / "end.h5", "w") as end:
        end.attrs["format"] = np.bytes_("talus-grains")
        whole.copy(whole["steps"][sorted(whole["steps"])[-1]], end.create_group("steps"), "000000")
    found = {}
    for number in (6, 12, 24, 48, 150):
        text = deck.replace("every_time = 0.02 /\n&grid", f"resolution = {number} /\n&grid")
        (case.folder / f"points{number}.nml").write_text(text)
        case.run("talus-dem", f"points{number}.nml", "--measure=end.h5")
        rows = read_history(case.folder / f"points{number}_measure_core.csv")
        found[number] = rows["solid_fraction"][-1]
    case.points = {n: abs(v / found[150] - 1.0) for n, v in found.items() if n < 150}
    case.below("solid fraction, 24 points to 150", float(case.points[24]), 1e-3)
    case.below("solid fraction, 6 points to 150", float(case.points[6]), 1e-2)


def draw(case: Case, rows: dict[str, np.ndarray]) -> None:
    """Draw stress over time, a slice of the solid fraction, and the refinement."""
    fig, axes = case.figure(ncols=3, figsize=(12.0, 3.8))
    for name in ("xx", "yy", "zz"):
        axes[0].plot(rows["time"], rows[f"stress_{name}"], label=name)
    axes[0].set(xlabel="time [s]", ylabel="stress [Pa]")
    axes[0].legend()
    image = axes[1].imshow(case.slice, origin="lower", extent=(-12, 36, -12, 52), cmap="viridis")
    axes[1].set(xlabel="x [mm]", ylabel="z [mm]", title="solid fraction, y = 13 mm")
    axes[1].grid(visible=False)
    fig.colorbar(image, ax=axes[1])
    axes[2].loglog(list(case.points), [max(v, 1e-7) for v in case.points.values()], "o")
    axes[2].set(xlabel="points to the diameter", ylabel="error of the solid fraction [-]")
    case.save(fig)
