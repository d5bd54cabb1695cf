"""Compare the columns with Terzaghi's series: result.txt, isochrones.png.

Usage: show.py, in the folder of the run.
"""

import json
import sys
from pathlib import Path

import h5py
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

sys.path.insert(0, str(Path(__file__).parent))
from prepare import (  # noqa: E402
    COLUMNS, D, HEIGHT, LAYERS, LOAD, MODULUS, RAMP, SPEED, STORAGE,
)  # fmt: skip

from talus.mesh import read_mesh  # noqa: E402
from talus.verification import field_steps  # noqa: E402

SHOWN = (1, 2, 4, 10)  # outputs: time factors 0.05, 0.1, 0.2, 0.5
P0 = LOAD / (1.0 + MODULUS * STORAGE)
TITLES = {"grains": "grains", "elements": "elements", "below": "grains below, elements above",
          "above": "elements below, grains above"}  # fmt: skip


def series(depth: np.ndarray, factor: float) -> np.ndarray:
    """Pressure at depths [Pa] at a time factor (Terzaghi, with the storage of the liquid)."""
    m = (2 * np.arange(2000) + 1) * np.pi / 2
    return P0 * 2 * np.sin(np.outer(depth / HEIGHT, m)) @ (np.exp(-(m**2) * factor) / m)


def settlement(factor: float, top: float) -> float:
    """Settlement of a height [m]: strain of all below it."""
    z = (np.arange(4000) + 0.5) / 4000 * top
    return float(np.mean(LOAD - series(HEIGHT - z, factor))) * top / MODULUS


def state(name: str, step: int) -> tuple[float, np.ndarray, np.ndarray, float, float]:
    """Return time [s], heights [m], pressures [Pa], a height and how far it has sunk [m]."""
    first, last = COLUMNS[name]
    z, p = np.empty(0), np.empty(0)
    if last < LAYERS or first > 0:
        now = field_steps(Path(f"{name}_solid.h5"))[step]
        z = read_mesh(Path(f"{name}_mesh.h5")).x[:, 2]
        p = now.solid["pore_pressure"]
        time, top, high = now.time, HEIGHT, z > HEIGHT - 1e-9
        sunk = float(-now.solid["u"][high, 2].mean()) if high.any() else 0.0
    if last > 0:
        steps = field_steps(Path(f"{name}_grains.h5"))
        with h5py.File(f"{name}_grains_pore.h5") as file:
            z = np.append(z, file["mesh/x"][:, 2])
            here = file["steps"][sorted(file["steps"])[step]]
            p = np.append(p, here["excess_pressure"][...])
    if last == LAYERS:
        x, time = steps[0].grains["x"][:, 2], steps[step].time
        high = x > HEIGHT - D
        top, sunk = HEIGHT - 0.5 * D, float((x - steps[step].grains["x"][:, 2])[high].mean())
    return time, z, p, top, sunk


def main() -> None:
    """Write table and figure."""
    fig, axes = plt.subplots(ncols=4, figsize=(12.5, 4.2), sharey=True, layout="constrained")
    depth = np.linspace(0.0, HEIGHT, 201)
    lines = ["column                          T     pressure, error / load   settlement, error / final"]
    for ax, name in zip(axes, COLUMNS, strict=True):
        for k, step in enumerate(SHOWN):
            time, z, p, top, sunk = state(name, step)
            factor = SPEED * (time - 0.5 * RAMP) / HEIGHT**2
            ax.plot(1e-3 * series(depth, factor), 1e3 * depth, color="k", lw=0.8,
                    label="series" if k == 0 else None)  # fmt: skip
            ax.plot(1e-3 * p, 1e3 * (HEIGHT - z), ".", ms=4, color=f"C{k}", label=f"T = {factor:.2f}")
            off = np.abs(p - series(HEIGHT - z, factor)).max() / LOAD
            sink = abs(sunk - settlement(factor, top)) / (LOAD * HEIGHT / MODULUS)
            lines.append(f"{TITLES[name]:30s} {factor:5.3f} {off:18.1e} {sink:25.1e}")
        if name in ("below", "above"):
            ax.axhline(1e3 * (HEIGHT - (0.0495 if name == "below" else 0.0505)), color="0.7", lw=0.8)
        ax.set(title=TITLES[name], xlabel="pressure [kPa]")
    axes[0].set(ylabel="depth [mm]")
    axes[0].invert_yaxis()
    axes[0].legend(fontsize=8)
    fig.savefig("isochrones.png", dpi=110)
    for name in ("below", "above"):
        with Path(f"{name}_summary.json").open() as file:
            lost = json.load(file)["health"]["liquid_balance"]
        lines.append(f"{TITLES[name]:30s} liquid that came from nowhere / that went over {lost:.1e}")
    Path("result.txt").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
