"""Draw the run with a micromorphic surround beside those of run.sh.

Usage: micro_judge.py OUT. Writes OUT/micro.png and OUT/micro.csv: forces by depth, as judge.py.
"""

import json
import sys
from pathlib import Path

from judge import band_of

from talus.look import COLOURS, new_figure, save_figure
from talus.plots import force_curve

RUNS = {"all grains": "truth", "overlap, micromorphic": "micro/grains",
        "overlap, Drucker-Prager": "plastic/grains", "overlap, elastic": "grains",
        "rigid box": "rigid"}  # fmt: skip
BANDS = ((0.0, 2.0), (2.0, 5.0), (5.0, 10.0))  # depth [mm]


def main() -> int:
    """Compare what there is, to the depth that the micromorphic run has reached."""
    out = Path(sys.argv[1])
    curves = {name: force_curve(path) for name, stem in RUNS.items()
              if (path := out / f"{stem}_driven.csv").exists()}  # fmt: skip
    end = curves["overlap, micromorphic"]["depth"][-1]
    lines = ["run,from [mm],to [mm],force [N],scatter [N]"]
    fig, ax = new_figure(figsize=(7.0, 4.6))
    for k, (name, curve) in enumerate(curves.items()):
        seen = curve["depth"] <= end
        ax.plot(curve["depth"][seen], curve["force"][seen], color=COLOURS[k], lw=0.4, alpha=0.5)
        ax.plot(curve["depth"][seen], curve["mean"][seen], color=COLOURS[k], lw=1.8, label=name)
        for low, high in BANDS:
            if high > end + 0.1:
                continue
            mean, scatter = band_of(curve, low, high)
            lines.append(f"{name},{low:g},{high:g},{mean:.5g},{scatter:.3g}")
    summary = out / "micro" / "micro_summary.json"
    if summary.exists():
        wall = float(json.loads(summary.read_text())["wall_time_s"])
        lines.append(f"wall time of the micromorphic run [s],,,{wall:.5g},")
    ax.set(xlabel="penetration depth [mm]", ylabel="force on the penetrator, upwards [N]")
    ax.set_xlim(left=0.0)
    ax.legend(fontsize=8)
    save_figure(fig, out / "micro.png")
    (out / "micro.csv").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
