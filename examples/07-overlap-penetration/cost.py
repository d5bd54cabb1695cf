"""What a step costs with all grains and in the coupled run, by the length of the exchange.

Usage: cost.py OUT [STEPS]. OUT holds what prepare and probe have written. Each deck is run for
STEPS (980) more steps than a first short run of the same program, whose time, which is that of
setting up, is taken off. CPU time is that of all three programs together. Writes cost.csv and
cost.png and prints the table; the ratio is that of CPU times, all grains over the run.
"""

import csv
import json
import os
import re
import resource
import subprocess
import sys
import time
from pathlib import Path

from talus.look import COLOURS, new_figure, save_figure

STEP = 1.25e-6  # of the grains [s]
FEW = 28  # steps of the short run
LENGTHS = (1, 2, 4, 7)  # steps in an exchange
CONTACTS = {"step": "in every step", "exchange": "once an exchange"}
ASIDE = ("&checkpoint", "&output")  # groups that are left out
CPU, WALL = "CPU a step [ms]", "wall a step [ms]"
TIMERS = ("projection and maps", "pull-backs", "works", "audit and log", "exchange")


def short_deck(source: Path, target: Path, steps: int, **changes: str) -> Path:
    """Write a deck that ends after a number of steps, without checkpoints and fields."""
    text = re.sub("t_end = [0-9.]+", f"t_end = {steps * STEP:.17g}", source.read_text())
    for old, new in changes.items():
        text = text.replace(*(f"{old} = {value}" for value in new.split("|")))
    lines = [line for line in text.splitlines() if not line.startswith(ASIDE)]
    target.write_text("\n".join(lines) + "\n")
    return target


def seconds(program: str, deck: Path) -> tuple[float, float, float]:
    """CPU time of the program and its children, wall time, and work of the coupling [s]."""
    tool = Path(os.environ["TALUS_BIN"]) / program
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    subprocess.run([tool, deck.name], cwd=deck.parent, check=True, stdout=subprocess.DEVNULL,
                   env=os.environ | {"OMP_NUM_THREADS": "1"})  # fmt: skip
    wall, after = time.monotonic() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    timers = json.loads((deck.parent / f"{deck.stem}_summary.json").read_text())["timers"]
    return cpu, wall, sum(timers.get(name, 0.0) for name in TIMERS)


def run_for(out: Path, program: str, source: Path, steps: int, **changes: str) -> list[float]:
    """The same for a deck and so many steps."""
    deck = short_deck(source, out / f"cost_{source.stem}.nml", steps, **changes)
    return list(seconds(program, deck))


def a_step(before: list[float], after: list[float], more: int) -> list[float]:
    """The same for one of the steps between two runs [ms]."""
    return [1e3 * (b - a) / more for a, b in zip(before, after, strict=True)]


def whole(out: Path, more: int) -> list[float]:
    """All grains."""
    runs = [run_for(out, "talus-dem", out / "truth.nml", steps) for steps in (FEW, FEW + more)]
    return a_step(*runs, more)


def coupled(out: Path, contacts: str, m: int, steps: int) -> list[float]:
    """The coupled run with exchanges of m steps."""
    here = Path(__file__).resolve().parent
    changes = {"exchange": f"8.75e-6|{m * STEP:.17g}", "ghost_contacts": f"'exchange'|'{contacts}'"}
    return run_for(out, "talus-couple", here / "coupled.nml", steps, **changes)


def draw(out: Path) -> None:
    """cost.png from cost.csv."""
    with (out / "cost.csv").open() as file:
        rows = list(csv.DictReader(file))
    fig, ax = new_figure(figsize=(6.4, 4.2))
    for k, label in enumerate(CONTACTS.values()):
        mine = [row for row in rows if row["run"] == f"ghosts {label}"]
        ax.plot(range(len(mine)), [float(row[CPU]) for row in mine], "o-", color=COLOURS[k],
                label=f"overlap, ghosts {label}")  # fmt: skip
    ax.axhline(float(rows[0][CPU]), color="k", ls="--", lw=1.0, label="all grains")
    ax.set_xticks(range(len(LENGTHS)), [str(m) for m in LENGTHS])
    ax.set(xlabel="steps of the grains in an exchange", ylabel="CPU time a step [ms]")
    ax.set_ylim(bottom=0.0)
    ax.legend(fontsize=8)
    save_figure(fig, out / "cost.png")


def main() -> int:
    """Time all grains and each coupled run."""
    out = Path(sys.argv[1]).resolve()
    more = int(sys.argv[2]) if len(sys.argv) > 2 else 980
    grains = whole(out, more)
    lines = [f"run,steps in an exchange,{CPU},{WALL},coupling a step [ms],ratio"]
    lines.append(f"all grains,,{grains[0]:.3f},{grains[1]:.3f},,1")
    short = coupled(out, "exchange", LENGTHS[-1], FEW)
    for contacts, label in CONTACTS.items():
        for m in LENGTHS:
            after = coupled(out, contacts, m, FEW + more)
            cpu, wall, work = a_step(short, after, more)
            ratio = grains[0] / cpu
            lines.append(f"ghosts {label},{m},{cpu:.3f},{wall:.3f},{work:.3f},{ratio:.2f}")
    (out / "cost.csv").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    draw(out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
