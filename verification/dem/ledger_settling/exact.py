"""Energy closure of a settling bed, with every column of the ledger."""

import numpy as np

from talus.compare import min_of
from talus.verification import Case, read_history, write_packing

AXES = np.array([2.5e-3, 2.0e-3, 1.5e-3])


def cloud() -> tuple[np.ndarray, np.ndarray]:
    """100 grains on a 5 x 5 lattice of pitch 5.5 mm with random orientations."""
    rng = np.random.default_rng(3)
    i, j, k = np.meshgrid(np.arange(5), np.arange(5), np.arange(4), indexing="ij")
    x = np.column_stack([i.ravel(), j.ravel(), k.ravel()]) * 5.5e-3 + np.array([4e-3, 4e-3, 4e-3])
    x += rng.uniform(-2e-4, 2e-4, size=(100, 3))
    quat = rng.normal(size=(100, 4))
    return x, quat / np.linalg.norm(quat, axis=1, keepdims=True)


def run(case: Case) -> None:
    """Judge the closure; plot all columns."""
    x, quat = cloud()
    write_packing(case.folder / "pack.h5", x, np.tile(AXES, (len(x), 1)), quat=quat)
    case.run("talus-dem", "deck.nml", "--threads=1")
    rows = read_history(case.folder / "deck_energy.csv")
    given = rows["gravity"]
    scale = np.abs(given).max()
    spent = rows["kinetic"] - rows["kinetic"][0]
    names = ["elastic", "friction", "contact_damping", "tangential_relaxation"]
    for name in names:
        spent = spent + rows[name]
    put_in = given + rows["boundary"] + rows["curvature"]  # curvature work feeds the springs
    error = np.abs(put_in - spent) / scale
    case.below("largest closure error / work of gravity", float(error.max()), 1e-4)
    case.below(
        "kinetic energy at the end / work of gravity",
        float(rows["kinetic"][-1] / scale),
        1e-2,
        "settled",
    )
    without = np.abs(put_in - rows["curvature"] - spent + rows["tangential_relaxation"]) / scale
    case.above(
        "closure error without the two small columns", float(without.max()), 1e-4, "they matter"
    )
    least = min_of(float(np.diff(rows[name]).min()) for name in ["friction", "contact_damping"])
    case.above(
        "least step of friction and damping / input", least / scale, -1e-12, "never negative"
    )
    fig, ax = case.figure()
    ax.plot(rows["time"], given, "-", label="work of gravity")
    for name in ["kinetic", "curvature", *names]:
        ax.plot(rows["time"], rows[name], "--", label=name.replace("_", " "))
    ax.set(xlabel="time [s]", ylabel="energy [J]")
    ax.legend(fontsize=8)
    case.save(fig)
