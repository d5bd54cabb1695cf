"""Judge the penetration: mean forces by depth, ordered as the benchmark asks, and both figures.

Usage: judge.py OUT, the folder of `run.sh penetration`. Reads OUT/rigid_CONTAINER_SEED and
OUT/coupled_MODULUS_SIZE; writes containers.png, moduli.png and judge.csv and prints the table. What
is missing is left out and named. Nothing is tuned: an order that does not hold is printed as such
and the exit code stays 0.
"""

import sys
from pathlib import Path

import numpy as np

from talus.fields import FieldFile, displacement, ghost_rows
from talus.look import COLOURS, new_figure, save_figure
from talus.plots import force_curve

CONTAINERS = ("small", "medium", "large")
BANDS = ((0.0, 10.0), (10.0, 20.0), (20.0, 30.0), (30.0, 60.0))  # depth [mm]; the last is judged
TIE = 0.02  # moduli: a force may be this much above its neighbour's
MODE = (
    "literal mode: mass scale 10, damping 2/dt, no gravity, 0.25 m/s\n"
    "(dt 5e-6 s; half of it multiplies the force by 1.6 to 1.9)"
)
DEPTH = np.arange(0.0, 62.01, 0.25)  # [mm] where curves of several seeds are averaged
Curve = dict[str, np.ndarray]


def rigid_curves(out: Path) -> dict[str, list[Curve]]:
    """Return the curves of every container, one a seed that is finished."""
    found = {}
    for name in CONTAINERS:
        folders = sorted(folder.parent for folder in out.glob(f"rigid_{name}_*/finished"))
        if folders:
            found[name] = [force_curve(folder / "rigid_driven.csv") for folder in folders]
    return found


def coupled_curves(out: Path) -> dict[str, dict[float, Curve]]:
    """Return element size -> modulus [Pa] -> curve, stiffest first."""
    found: dict[str, dict[float, Curve]] = {}
    for mark in out.glob("coupled_*/finished"):
        _, young, size = mark.parent.name.split("_")
        curve = force_curve(mark.parent / "grains_driven.csv")
        found.setdefault(size, {})[float(young)] = curve
    return {size: dict(sorted(found[size].items(), reverse=True)) for size in sorted(found)[::-1]}


def mean_force(curve: Curve, band: tuple[float, float]) -> float:
    """Return the mean force [N] over a band of depth, NaN if the curve ends before it does."""
    inside = (curve["depth"] >= band[0]) & (curve["depth"] <= band[1])
    if curve["depth"][-1] < band[1] - 0.5:
        return float("nan")
    return float(curve["force"][inside].mean())


def bands_of(curves: list[Curve]) -> tuple[list[float], list[float]]:
    """Return mean and standard deviation over the seeds [N] for every band."""
    values = np.array([[mean_force(curve, band) for band in BANDS] for curve in curves])
    spread = values.std(axis=0, ddof=1) if len(curves) > 1 else np.full(len(BANDS), np.nan)
    return values.mean(axis=0).tolist(), spread.tolist()


def tabulate(title: str, rows: dict[str, list[Curve]], lines: list[str]) -> dict[str, list[float]]:
    """Print forces and their ratios to the first row by band; add them to the CSV lines."""
    heads = "".join(f"  {low:4.0f}-{high:2.0f} mm [N]       " for low, high in BANDS)
    print(f"\n{title}\n  {'':22s}{heads}")
    means = {name: bands_of(curves) for name, curves in rows.items()}
    first = next(iter(means.values()))[0] if means else []
    for name, (mean, spread) in means.items():
        line = f"  {name:22s}"
        for (low, high), m, s, f in zip(BANDS, mean, spread, first, strict=True):
            line += f"{m:9.2f} ±{s:7.2f} {m / f:5.2f}"
            numbers = f"{low:g},{high:g},{len(rows[name])},{m:.6g},{s:.6g},{m / f:.6g}"
            lines.append(f"{title},{name},{numbers}")
        print(line)
    return {name: mean for name, (mean, _) in means.items()}


def verdict(title: str, names: list[str], means: dict[str, list[float]], tie: float) -> str:
    """Say whether mean forces over the judged band fall from each name to the next."""
    missing = [name for name in names if name not in means or np.isnan(means[name][-1])]
    if missing:
        return f"{title},not judged,missing: {' '.join(missing)}"
    pairs = list(zip(names, names[1:], strict=False))
    wrong = [f"{b} > {a}" for a, b in pairs if not means[b][-1] <= means[a][-1] * (1.0 + tie)]
    return f"{title},fail,{'; '.join(wrong)}" if wrong else f"{title},pass,{' >= '.join(names)}"


def ghost_displacement(path: Path) -> np.ndarray:
    """Return the displacement of every ghost [mm] at the end of a coupled run, (ghosts, 3)."""
    with FieldFile(path) as fields:
        first, last = fields.read(0).grains, fields.read(-1).grains
    return 1.0e3 * displacement(first, last)[ghost_rows(first, last)]


def compare_meshes(out: Path) -> list[str]:
    """Compare the ghosts' displacements at the end on the coarsest and the finest elements."""
    lines = []
    names = {mark.parent.name.split("_")[1] for mark in out.glob("coupled_*/finished")}
    for young in sorted(names, key=float):
        folders = sorted(mark.parent for mark in out.glob(f"coupled_{young}_*/finished"))
        if len(folders) < 2:
            continue
        fine, coarse = (ghost_displacement(f / "grains.h5") for f in (folders[0], folders[-1]))
        if fine.shape != coarse.shape:
            lines.append(f"ghosts at {young} Pa,not compared,other ghosts have moved")
            continue
        far = float(np.sqrt(((fine - coarse) ** 2).sum() / (fine**2).sum()))
        sizes = [float(np.linalg.norm(u, axis=1).max()) for u in (coarse, fine)]
        text = f"largest {sizes[0]:.3g} mm coarse; {sizes[1]:.3g} mm fine"
        lines.append(f"ghosts at {young} Pa,measured,{text}; difference {far:.3g} (rms)")
    return lines


def draw(path: Path, title: str, rows: dict[str, list[Curve]]) -> None:
    """Draw thin lines of every seed and the mean of the smoothed curves."""
    fig, ax = new_figure(figsize=(7.0, 4.6))
    for k, (name, curves) in enumerate(rows.items()):
        colour = COLOURS[k % len(COLOURS)]
        smooth = [np.interp(DEPTH, c["depth"], c["mean"], right=np.nan) for c in curves]
        for one in smooth:
            ax.plot(DEPTH, one, color=colour, lw=0.6, alpha=0.6)
        label = f"{name} ({len(curves)})"
        ax.plot(DEPTH, np.mean(smooth, axis=0), color=colour, lw=1.8, label=label)
    ax.set(xlabel="penetration depth [mm]", ylabel="force on the penetrator, upwards [N]")
    ax.set_xlim(left=0.0)
    ax.set_title(f"{title} (number of seeds)\n{MODE}", fontsize=9)
    ax.legend(fontsize=8)
    save_figure(fig, path)
    print(path)


def main() -> int:
    """Judge a folder."""
    out = Path(sys.argv[1])
    lines = ["table,run,from [mm],to [mm],seeds,mean [N],standard deviation [N],ratio to first"]
    verdicts = []
    rigid = rigid_curves(out)
    if rigid:
        draw(out / "containers.png", "Rigid containers", rigid)
    means = tabulate("containers", rigid, lines)
    verdicts.append(verdict("small > medium > large", list(CONTAINERS), means, 0.0))
    for size, curves in coupled_curves(out).items():
        rows = {"rigid": rigid["small"][:1]} if "small" in rigid else {}
        rows |= {f"{young:.0e} Pa": [curve] for young, curve in curves.items()}
        names = list(rows)
        means = tabulate(f"elements of {size} m", rows, lines)
        verdicts.append(verdict(f"rigid and moduli falling ({size} m)", names, means, TIE))
        if "large" in rigid:
            rows["large, rigid"] = rigid["large"]
        name = "moduli.png" if size == max(coupled_curves(out)) else f"moduli_{size}.png"
        draw(out / name, f"Coupled, elements of {size} m", rows)
    verdicts += compare_meshes(out)
    print()
    for text in verdicts:
        print("  " + text.replace(",", ": ", 1).rstrip(","))
    (out / "judge.csv").write_text("\n".join([*lines, "", "order,verdict,what", *verdicts]) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
