"""Compare the resistance of the cone between drained and undrained: result.txt, resistance.png.

Usage: judge.py SEED ..., in the folder of the run. Runs that have not finished are left out.
"""

import json
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

sys.path.insert(0, str(Path(__file__).parent))
from prepare import CONE, KINDS, MAKING, SPEEDS, START, WAYS  # noqa: E402

from talus.verification import read_history  # noqa: E402

AREA = 0.25 * np.pi * CONE**2
SCATTER = 0.15  # of single resistances
BANDS = {"dense": (0.5, 1.0), "loose": (1.0, 1.5)}  # depths of the mean [diameters of the cone]


def finished(name: str) -> bool:
    """Whether a run has come to its end."""
    path = Path(f"{name}_summary.json")
    return path.exists() and json.loads(path.read_text())["exit_code"] == 0


def resistance(name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return depth over diameter, and stresses of contacts and liquid on the cone [Pa]."""
    rows = read_history(Path(f"{name}_surfaces.csv"))
    parts = [{key: v[rows["part"] == k] for key, v in rows.items()} for k in (1, 2)]
    contacts = parts[0]["force_z"] + parts[1]["force_z"]
    liquid = np.zeros_like(contacts)
    wet = Path(f"{name}_penetrometers.csv")
    if wet.exists():
        liquid = read_history(wet)["tip_liquid_z"]
    z = parts[0]["z"]
    return (z[0] - START - z) / CONE, contacts / AREA, liquid / AREA


def means(name: str) -> tuple[float, float]:
    """Return means over the band of contacts and liquid [Pa]."""
    depth, contacts, liquid = resistance(name)
    low, high = BANDS[name.split("_")[0]]
    here = (depth >= low) & (depth <= high)
    return float(contacts[here].mean()), float(liquid[here].mean())


def smooth(values: np.ndarray, window: int = 9) -> np.ndarray:
    """Moving mean, of the same length."""
    wide = np.pad(values, window // 2, mode="edge")
    return np.convolve(wide, np.ones(window) / window, mode="valid")


def table(found: dict[str, tuple[float, float]]) -> list[str]:
    """Return the lines of result.txt."""
    lines = ["run                contacts  liquid    both  [kPa]  (q - q_u)/(q_d - q_u)"]
    for name, (contacts, liquid) in found.items():
        line = f"{name:18s} {1e-3 * contacts:8.0f} {1e-3 * liquid:7.0f} {1e-3 * (contacts + liquid):7.0f}"
        share = drained(found, name)
        lines.append(line if share is None else f"{line} {share:22.2f}")
    lines += averages(found)
    for name in sorted({name.rsplit("_", 1)[0] for name in found}):
        lines += sheared(name)
        lines += [f"{name}: " + ", ".join(f"{k} {v:.4g}" for k, v in
                  json.loads(Path(f"{name}.json").read_text()).items())]  # fmt: skip
    return lines


def averages(found: dict[str, tuple[float, float]]) -> list[str]:
    """Return lines of means and standard errors over the seeds, and of ratios to the dry bed."""
    lines = ["over the seeds: mean, standard error, number  [kPa]; the same of q over q of the dry bed"]
    for density in MAKING:
        for kind in KINDS:
            names = [n for n in found if n.startswith(density) and n.endswith("_" + kind)]
            whole = [1e-3 * sum(found[n]) for n in names]
            shares = [sum(found[n]) / sum(found[dry]) for n in names
                      if (dry := n.removesuffix(kind) + "dry") in found]  # fmt: skip
            if whole:
                lines.append(f"{density} {kind:10s}" + mean_of(whole, "8.0") + mean_of(shares, "8.3"))
    return lines


def mean_of(values: list[float], form: str) -> str:
    """Return mean, standard error and number of values."""
    if not values:
        return ""
    spread = np.std(values, ddof=1) / len(values) ** 0.5 if len(values) > 1 else np.nan
    return f" {np.mean(values):{form}f} {spread:{form}f} {len(values):3d}"


def sheared(name: str) -> list[str]:
    """Return a line on the element test of a specimen: its mean effective stress."""
    path = Path(f"{name}_shear_walls.csv")
    if not path.exists():
        return []
    walls = read_history(path)
    of = [{key: v[walls["wall"] == k] for key, v in walls.items()} for k in range(1, 7)]
    length = [of[2 * k + 1][axis] - of[2 * k][axis] for k, axis in enumerate("xyz")]
    volume = length[0] * length[1] * length[2]
    force = [np.abs(of[2 * k][f"force_{a}"]) + np.abs(of[2 * k + 1][f"force_{a}"])
             for k, a in enumerate("xyz")]  # fmt: skip
    mean = sum(0.5 * f * x / volume for f, x in zip(force, length, strict=True)) / 3.0
    return [f"{name}: mean stress at constant volume {1e-3 * mean[0]:.0f} kPa, least "
            f"{1e-3 * mean.min():.0f}, at the end {1e-3 * mean[-1]:.0f}"]  # fmt: skip


def drained(found: dict[str, tuple[float, float]], name: str) -> float | None:
    """Return how far a run is from the sealed one to the dry one, where these differ."""
    specimen = name.rsplit("_", 1)[0]
    ends = [f"{specimen}_{kind}" for kind in ("sealed", "dry")]
    if any(end not in found for end in ends):
        return None
    undrained, dry = (sum(found[end]) for end in ends)
    if abs(dry - undrained) < SCATTER * dry:
        return None
    return (sum(found[name]) - undrained) / (dry - undrained)


def draw(found: dict[str, tuple[float, float]], seeds: list[str]) -> None:
    """Draw resistances over depth, and the backbone."""
    fig, axes = plt.subplots(ncols=3, figsize=(13.0, 4.2), layout="constrained")
    for ax, density in zip(axes[:2], MAKING, strict=True):
        for k, kind in enumerate(KINDS):
            name = f"{density}_{seeds[0]}_{kind}"
            if name not in found:
                continue
            depth, contacts, liquid = resistance(name)
            label = f"V = {SPEEDS[kind]:g}" if kind in SPEEDS else kind
            ax.plot(depth, 1e-6 * smooth(contacts + liquid), color=f"C{k}", label=label)
            if kind != "dry":
                ax.plot(depth, 1e-6 * smooth(liquid), color=f"C{k}", lw=0.8, ls=":")
        ax.set(title=f"{density}, seed {seeds[0]} (dotted: liquid alone)", xlim=(0.0, WAYS[density] / CONE),
               xlabel="depth / diameter of the cone", ylabel="force on the tip / area [MPa]")  # fmt: skip
        ax.legend(fontsize=8)
    for k, density in enumerate(MAKING):
        points = [(speed, drained(found, f"{density}_{seed}_{kind}")) for kind, speed in SPEEDS.items()
                  for seed in seeds if f"{density}_{seed}_{kind}" in found]  # fmt: skip
        points = [point for point in points if point[1] is not None]
        if points:
            axes[2].semilogx(*zip(*points, strict=True), "os"[k], label=density)
    speed = np.geomspace(1e-3, 1e4, 200)
    axes[2].semilogx(speed, 1.0 / (1.0 + speed / 3.0), "k-", lw=0.8, label="1/(1 + V/3)")
    axes[2].set(xlabel="V = v d / c_v", ylabel="(q - sealed) / (dry - sealed)")
    axes[2].legend(fontsize=8)
    fig.savefig("resistance.png", dpi=110)


def main(seeds: list[str]) -> None:
    """Write table and figure."""
    names = [f"{d}_{seed}_{kind}" for d in MAKING for seed in seeds for kind in KINDS]
    found = {name: means(name) for name in names if finished(name)}
    lines = table(found)
    Path("result.txt").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    draw(found, seeds)


if __name__ == "__main__":
    main(sys.argv[1:])
