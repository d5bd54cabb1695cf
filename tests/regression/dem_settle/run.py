"""A small bed settles: ledger, thread count, restart bit for bit, a packing that can be read again.

Usage: run.py BIN SCRATCH
"""

import csv
import itertools
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np

from talus.compare import max_of
from talus.packing import make_packing, write_h5

HERE = Path(__file__).resolve().parent
AXES = np.array([2.5e-3, 2.0e-3, 1.5e-3])
HISTORIES = ["deck_energy.csv", "deck_driven.csv", "deck_walls.csv"]
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


def make_input(scratch: Path) -> None:
    """Write deck.nml and pack.h5: a 3 x 4 x 4 lattice, one large grain on top that is driven."""
    rng = np.random.default_rng(11)
    i, j, k = np.meshgrid(np.arange(3), np.arange(4), np.arange(4), indexing="ij")
    x = np.column_stack([i.ravel(), j.ravel(), k.ravel()]) * 5.6e-3 + 4.0e-3
    x = np.vstack([x + rng.uniform(-2e-4, 2e-4, x.shape), [[9.0e-3, 1.2e-2, 2.9e-2]]])
    quat = rng.normal(size=(len(x), 4))
    quat /= np.linalg.norm(quat, axis=1, keepdims=True)
    axes = np.vstack([np.tile(AXES, (len(x) - 1, 1)), [[4.0e-3, 3.0e-3, 5.0e-3]]])
    write_h5(scratch / "pack.h5", make_packing(x, axes, quat, groups={"tool": np.array([len(x)])}))
    shutil.copy(HERE / "deck.nml", scratch / "deck.nml")


def run(program: Path, folder: Path, *options: str) -> int:
    """Run the deck of a folder; return the exit code."""
    command = [str(program), str(folder / "deck.nml"), *options]
    return subprocess.run(command, capture_output=True, timeout=300).returncode


def folder_with(scratch: Path, name: str, t_end: str = "0.1") -> Path:
    """Make a folder with the deck, its end changed."""
    folder = scratch / name
    folder.mkdir()
    shutil.copy(scratch / "pack.h5", folder)
    text = (scratch / "deck.nml").read_text()
    (folder / "deck.nml").write_text(text.replace("t_end = 0.1", f"t_end = {t_end}"))
    return folder


def same_h5(first: Path, second: Path) -> list[str]:
    """Return the datasets that differ in any bit."""
    different = []
    with h5py.File(first) as a, h5py.File(second) as b:
        names: list[str] = []
        a.visititems(
            lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None
        )
        b.visititems(lambda name, _: names.append(name) if name not in a else None)
        for name in names:
            if name not in a or name not in b or a[name][()].tobytes() != b[name][()].tobytes():
                different.append(name)
    return different


def compare(name: str, whole: Path, other: Path) -> None:
    """Check that checkpoint, fields and histories of two runs agree in every bit."""
    for file in ("deck.chk.h5", "deck.h5", "end.h5"):
        different = same_h5(whole / file, other / file)
        check(f"{name}: {file}", not different, different[:5])
    for file in HISTORIES:
        check(f"{name}: {file}", (whole / file).read_bytes() == (other / file).read_bytes())


def rebuilds(folder: Path) -> int:
    """Return how often the list of candidates was rebuilt, restarts counted on."""
    return json.loads((folder / "deck_summary.json").read_text())["health"]["rebuilds"]


def check_ledger(whole: Path) -> None:
    """Check the ledger's closure and what must never be negative."""
    rows = list(csv.DictReader((whole / "deck_energy.csv").open()))
    closure = max_of(float(row["relative_closure [-]"]) for row in rows)
    # order dt^2 of the integrator; 1e-4 is asked at finer steps in the verification
    check("ledger closes", closure < 2.0e-3, closure)
    for column in ("friction [J]", "contact_damping [J]", "tangential_relaxation [J]"):
        values = [float(row[column]) for row in rows]
        check(f"{column} never falls", all(b >= a - 1e-15 for a, b in itertools.pairwise(values)))
    check("a row each millisecond", len(rows) == 101, len(rows))
    driven = list(csv.DictReader((whole / "deck_driven.csv").open()))
    check("the driven grain goes down", abs(float(driven[-1]["z [m]"]) - 0.019) < 1e-12)
    summary = json.loads((whole / "deck_summary.json").read_text())
    check("no late rebuild", summary["health"]["late_rebuilds"] == 0)
    check("contacts have formed", summary["contacts"] > 5, summary["contacts"])


def interrupted(program: Path, scratch: Path) -> None:
    """SIGTERM in the middle of a long run: exit 3, a checkpoint that is gone on from."""
    folder = folder_with(scratch, "interrupted", "100.0")
    child = subprocess.Popen([str(program), str(folder / "deck.nml")], stdout=subprocess.DEVNULL)
    limit = time.monotonic() + 60.0
    while not (folder / "deck_energy.csv").exists() and time.monotonic() < limit:
        time.sleep(0.05)
    child.send_signal(signal.SIGTERM)
    check("SIGTERM: exit 3", child.wait(timeout=60) == 3)
    with h5py.File(folder / "deck.chk.h5") as file:
        reached = float(file.attrs["time"])
    t_end = f"{reached + 0.003:.6e}"
    text = (folder / "deck.nml").read_text().replace("t_end = 100.0", f"t_end = {t_end}")
    (folder / "deck.nml").write_text(text)
    check("restart after SIGTERM", run(program, folder, "--restart=auto") == 0)


def main() -> int:
    """Run all checks; return 1 if any failed."""
    program, scratch = Path(sys.argv[1]).resolve() / "talus-dem", Path(sys.argv[2])
    shutil.rmtree(scratch, ignore_errors=True)
    scratch.mkdir(parents=True)
    os.environ.pop("OMP_NUM_THREADS", None)
    os.environ["OMP_WAIT_POLICY"] = "passive"  # threads that spin stand in the way of other work
    make_input(scratch)
    whole = folder_with(scratch, "whole")
    check("the whole run", run(program, whole, "--threads=1") == 0)
    check_ledger(whole)
    for number in (2, 3):
        threads = folder_with(scratch, f"threads_{number}")
        check(f"with {number} threads", run(program, threads, f"--threads={number}") == 0)
        compare(f"{number} threads", whole, threads)
    for half in ("0.05", "0.03234"):
        part = folder_with(scratch, f"part_{half}", half)
        check(f"first part to {half} s", run(program, part, "--threads=1") == 0)
        before = rebuilds(part)
        shutil.copy(whole / "deck.nml", part / "deck.nml")
        check(
            f"second part from {half} s", run(program, part, "--threads=3", "--restart=auto") == 0
        )
        compare(f"restart at {half} s", whole, part)
        check(f"list rebuilt before {half} s", before > 0, before)
        check(f"list rebuilt after {half} s", rebuilds(whole) > before, (before, rebuilds(whole)))
    shutil.copy(whole / "end.h5", whole / "pack.h5")
    text = (whole / "deck.nml").read_text().replace("t_end = 0.1", "t_end = 0.001")
    (whole / "deck.nml").write_text(text)
    check(
        "the packing written can be read", run(program, whole, f"--output={scratch / 'third'}") == 0
    )
    interrupted(program, scratch)
    print(f"{PASSED} passed, {len(FAILURES)} failed")
    return 1 if FAILURES else 0


if __name__ == "__main__":
    sys.exit(main())
