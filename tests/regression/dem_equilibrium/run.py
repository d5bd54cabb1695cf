"""A small bed comes to rest and ends by itself; adaptive damping; threads and restarts agree.

Usage: run.py BIN SCRATCH
"""

import csv
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np

from talus.compare import max_of
from talus.packing import make_packing, write_h5

HERE = Path(__file__).resolve().parent
AXES = np.array([2.5e-3, 2.0e-3, 1.5e-3])
FAILURES: list[str] = []
PASSED = 0


def check(name: str, good: bool, seen: object = "") -> None:
    """Count a check; remember and print what failed."""
    global PASSED
    if good:
        PASSED += 1
    else:
        FAILURES.append(name)
        print(f"FAILED: {name} {seen}")


def folder_with(scratch: Path, name: str, t_end: str = "2.0") -> Path:
    """Make a folder with deck and packing: a 3 x 4 x 4 lattice of ellipsoids of any orientation."""
    rng = np.random.default_rng(11)
    i, j, k = np.meshgrid(np.arange(3), np.arange(4), np.arange(4), indexing="ij")
    x = np.column_stack([i.ravel(), j.ravel(), k.ravel()]) * 5.6e-3 + 4.0e-3
    quat = rng.normal(size=(len(x), 4))
    quat /= np.linalg.norm(quat, axis=1, keepdims=True)
    folder = scratch / name
    folder.mkdir()
    write_h5(folder / "pack.h5", make_packing(x, np.tile(AXES, (len(x), 1)), quat))
    text = (HERE / "deck.nml").read_text().replace("t_end = 2.0", f"t_end = {t_end}")
    (folder / "deck.nml").write_text(text)
    return folder


def run(program: Path, folder: Path, *options: str) -> subprocess.CompletedProcess:
    """Run the deck of a folder."""
    command = [str(program), str(folder / "deck.nml"), *options]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


def state(folder: Path) -> dict[str, bytes]:
    """Return every dataset of the last checkpoint as bytes."""
    found: dict[str, bytes] = {}
    with h5py.File(folder / "deck.chk.h5") as file:
        file.visititems(
            lambda name, item: (
                found.update({name: item[()].tobytes()}) if isinstance(item, h5py.Dataset) else None
            )
        )
    return found


def check_whole(folder: Path, ended: subprocess.CompletedProcess) -> None:
    """Check the end of the run, what it says of itself, and its ledger."""
    check("exit 0", ended.returncode == 0, ended.stderr)
    check("the log says so", "equilibrium: reached" in ended.stdout)
    summary = json.loads((folder / "deck_summary.json").read_text())
    health = summary["health"]
    check("it ended early", summary["time_s"] < 1.9, summary["time_s"])
    check("on a look", summary["steps"] % 200 == 0, summary["steps"])
    check("equilibrium in the summary", health["equilibrium"] is True)
    check("unbalanced force", 0.0 <= health["unbalanced_force"] <= 1e-4, health["unbalanced_force"])
    ratio = summary["energy"]["kinetic_J"] / summary["energy"]["elastic_J"]
    check("kinetic over elastic energy", ratio <= 1e-8, ratio)
    check("and as said", abs(ratio - health["kinetic_over_elastic"]) <= 1e-12 * ratio)
    rows = list(csv.DictReader((folder / "deck_energy.csv").open()))
    check_ledger(rows)


def check_ledger(rows: list[dict[str, str]]) -> None:
    """Check that what damping takes is counted."""
    closure = max_of(float(row["relative_closure [-]"]) for row in rows)
    check("ledger closes", closure < 2.0e-3, closure)  # of order dt^2 of the integrator
    taken = [float(row["background_damping [J]"]) for row in rows]
    check("damping took energy", taken[-1] > 0.0 and taken == sorted(taken))


def check_adaptive(program: Path, scratch: Path, every: int) -> None:
    """Check adaptive damping: ledger, and the same bits for two threads and after a restart."""
    ends = ((f"a{every}", "0.2"), (f"b{every}", "0.08123"))
    folders = [folder_with(scratch, name, end) for name, end in ends]
    for folder in folders:
        lines = (folder / "deck.nml").read_text().splitlines()
        kept = [line for line in lines if not line.startswith("&equilibrium")]
        text = "\n".join(kept) + "\n"
        adaptive = f"&relaxation damping = 'adaptive', damping_every = {every}"
        text = text.replace("&dynamics    damping = 50.0", adaptive)
        (folder / "deck.nml").write_text(text)
    check("adaptive damping", run(program, folders[0], "--threads=1").returncode == 0)
    check_ledger(list(csv.DictReader((folders[0] / "deck_energy.csv").open())))
    check("its first part", run(program, folders[1], "--threads=1").returncode == 0)
    shutil.copy(folders[0] / "deck.nml", folders[1] / "deck.nml")
    ended = run(program, folders[1], "--threads=2", "--restart=auto")
    check("its second part, two threads", ended.returncode == 0, ended.stderr)
    check("adaptive damping: same bits", state(folders[0]) == state(folders[1]))


SERVO = """&curve id = 'press', times = 0.0, 0.05, values = 0.5, 1.0 /
&wall  id = 'lid', point = 0.0, 0.0, 0.12, normal = 0.0, 0.0, -1.0, material = 'quartz' /
&servo wall = 'lid', stress = 200.0, speed = 1.0, curve = 'press' /
"""


def check_servo(program: Path, scratch: Path) -> None:
    """Check a servo with a curve: it holds its stress, same bits after a restart, two threads."""
    folders = [folder_with(scratch, *item) for item in (("servo", "0.25"), ("cut", "0.2123"))]
    for folder in folders:
        deck = (folder / "deck.nml").read_text()
        kept = [line for line in deck.splitlines() if not line.startswith("&equilibrium")]
        (folder / "deck.nml").write_text("\n".join(kept) + "\n" + SERVO)
    ended = run(program, folders[0], "--threads=1")
    check("servo holds its stress", ended.returncode == 0, ended.stderr)
    run(program, folders[1], "--threads=1")
    shutil.copy(folders[0] / "deck.nml", folders[1] / "deck.nml")
    ended = run(program, folders[1], "--threads=2", "--restart=auto")
    check("its second part, two threads", ended.returncode == 0, ended.stderr)
    check("servo: same bits", state(folders[0]) == state(folders[1]))
    rows = [(folder / "deck_servos.csv").read_text().splitlines() for folder in folders]
    check("servo: same history", rows[0] == rows[1])
    late = folder_with(scratch, "late", "0.1")
    whole = (folders[0] / "deck.nml").read_text()
    without = "\n".join(line for line in whole.splitlines() if not line.startswith("&servo"))
    (late / "deck.nml").write_text(without.replace("t_end = 0.25", "t_end = 0.1") + "\n")
    check("a first part without servo", run(program, late, "--threads=1").returncode == 0)
    (late / "deck.nml").write_text(whole.replace("t_end = 0.25", "t_end = 0.4"))
    ended = run(program, late, "--threads=1", "--restart=auto")
    check("a servo that a restart adds", ended.returncode == 0, ended.stderr)
    moving = without.replace("t_end = 0.25", "t_end = 0.45")
    end = "-1.0, material = 'quartz' /"
    moving = moving.replace(end, end.replace(" /", ", velocity = 0.0, 0.0, 0.1 /"))
    (late / "deck.nml").write_text(moving + "\n")
    ended = run(program, late, "--threads=1", "--restart=auto")
    check("a third part without", ended.returncode == 0, ended.stderr)
    rows = list(csv.DictReader((late / "deck_walls.csv").open()))
    lid = [float(row["z [m]"]) for row in rows if float(row["wall [-]"]) == 6.0]
    way = lid[-1] - lid[-41]
    check("its wall has the velocity of the new deck", abs(way - 0.1 * 0.04) < 1e-12, way)


SURCHARGE = """&curve id = 'press', times = 0.0, 0.05, values = 0.5, 1.0 /
&surcharge stress = 200.0, curve = 'press', update_every = 200 /
"""


def check_surcharge(program: Path, scratch: Path) -> None:
    """Check a surcharge: same bits and history after a restart between two looks, two threads."""
    folders = [folder_with(scratch, *item) for item in (("load", "0.15"), ("loads", "0.09123"))]
    for folder in folders:
        deck = (folder / "deck.nml").read_text()
        kept = [line for line in deck.splitlines() if not line.startswith("&equilibrium")]
        (folder / "deck.nml").write_text("\n".join(kept) + "\n" + SURCHARGE)
    ended = run(program, folders[0], "--threads=1")
    check("surcharge", ended.returncode == 0, ended.stderr)
    check("the log says what carries it", "surcharge: " in ended.stdout)
    run(program, folders[1], "--threads=1")
    shutil.copy(folders[0] / "deck.nml", folders[1] / "deck.nml")
    ended = run(program, folders[1], "--threads=2", "--restart=auto")
    check("its second part, two threads", ended.returncode == 0, ended.stderr)
    check("surcharge: same bits", state(folders[0]) == state(folders[1]))
    rows = [(folder / "deck_surcharge.csv").read_text().splitlines() for folder in folders]
    check("surcharge: same history", rows[0] == rows[1])


def main() -> int:
    """Run all checks; return 1 if any failed."""
    program, scratch = Path(sys.argv[1]).resolve() / "talus-dem", Path(sys.argv[2])
    shutil.rmtree(scratch, ignore_errors=True)
    scratch.mkdir(parents=True)
    os.environ.pop("OMP_NUM_THREADS", None)
    os.environ["OMP_WAIT_POLICY"] = "passive"  # threads that spin stand in the way of other work
    whole = folder_with(scratch, "whole")
    check_whole(whole, run(program, whole, "--threads=1"))
    threads = folder_with(scratch, "threads")
    run(program, threads, "--threads=2")
    check("two threads: same bits", state(threads) == state(whole))
    part = folder_with(scratch, "part", "0.05123")
    ended = run(program, part, "--threads=1")
    check("too short a run: exit 2", ended.returncode == 2, ended.returncode)
    check("N203", "N203" in ended.stderr, ended.stderr)
    summary = json.loads((part / "deck_summary.json").read_text())
    check("not reached in the summary", summary["health"]["equilibrium"] is False)
    check("the packing is written all the same", (part / "end.h5").exists())
    shutil.copy(whole / "deck.nml", part / "deck.nml")
    ended = run(program, part, "--threads=2", "--restart=auto")
    check("gone on to equilibrium", ended.returncode == 0, ended.stderr)
    check("restart: same bits", state(part) == state(whole))
    for every in (10, 500):
        check_adaptive(program, scratch, every)
    check_servo(program, scratch)
    check_surcharge(program, scratch)
    print(f"{PASSED} passed, {len(FAILURES)} failed")
    return 1 if FAILURES else 0


if __name__ == "__main__":
    sys.exit(main())
