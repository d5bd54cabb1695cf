"""Ask talus-fem and FEniCSx the same at the port and compare the answers.

Usage: same_load.py FOLDER [FORCE]. FOLDER has block.h5, block.toml and solid.nml. A load of FORCE
[N] presses and shears the hole: in four static steps, and at once on the block that moves.
Displacements of all nodes after each step are compared, over the largest. Writes same_load.csv;
exit code 1 where a difference is above LIMIT.
"""

import os
import sys
from pathlib import Path

import numpy as np

from talus.mesh import read_mesh
from talus.port import Message
from talus.port_asker import SolverAsker
from talus.programs import find_program

LIMIT = 1.0e-6  # of the largest displacement
HERE = Path(__file__).parent
SYSTEM_PYTHON = os.environ.get("FENICSX_PYTHON", "/usr/bin/python3")
STEP, STEPS = 1.0e-5, 50  # s; explicit, below both step limits
LAWS = {"elastic": "linear_elastic", "neo_hookean": "neo_hookean"}


def asked(solver: SolverAsker, verb: str, *interval: float, **fields: object) -> Message:
    """Return the reply to a request, which is no fault."""
    reply = solver.ask(verb, *interval, **fields)[1]
    if reply.status:
        raise SystemExit(f"{verb}: {reply.text('error.code')} {reply.text('error.message')}")
    return reply


def moved(command: list[str], load: np.ndarray, explicit: bool) -> list[np.ndarray]:
    """Return the displacements (n, 3) [m] after each step under a load (n, 3) [N]."""
    with SolverAsker(command, "shared_memory", 60.0) as solver:
        asked(solver, "HELLO", run_id="same_load", restart="", protocol=2)
        asked(solver, "SELECT", set="all", role="load", id=np.arange(1, len(load) + 1))
        if explicit:
            asked(solver, "SET", what="dead_load", set="all", force=load)
        asked(solver, "READY")
        steps = []
        for k in range(STEPS if explicit else 4):
            verb, dt, part = ("ADVANCE", STEP, 0.0) if explicit else ("SOLVE", 1.0, (k + 1) / 4)
            reply = asked(solver, verb, k * dt, (k + 1) * dt, all__force=part * load)
            asked(solver, "ACCEPT", (k + 1) * dt, (k + 1) * dt)
            steps.append(np.array(reply.fields["all.u"]))
        asked(solver, "STOP")
    return steps


def decks(folder: Path, law: str, explicit: bool) -> list[list[str]]:
    """Write the decks of both solvers; return their commands."""
    toml = (folder / "block.toml").read_text().replace('"elastic"', f'"{law}"')
    if explicit:
        toml = toml.replace("explicit = false", "explicit = true")
    (folder / "same.toml").write_text(toml)
    deck = (folder / "solid.nml").read_text().replace("linear_elastic", LAWS[law])
    kind = f"'explicit', dt = {STEP}" if explicit else "'static'"
    (folder / "same.nml").write_text(deck.replace("'static'", kind))
    return [[str(find_program("talus-fem")), "same.nml"],
            [SYSTEM_PYTHON, str(HERE / "solid.py"), "same.toml"]]  # fmt: skip


def main() -> int:
    """Compare for both laws, static and explicit."""
    folder = Path(sys.argv[1])
    os.chdir(folder)
    block = read_mesh(Path("block.h5"))
    load = np.zeros(block.x.shape)
    face = np.unique(block.facets["hole"])
    load[face] = np.outer(1.0 + block.x[face, 0] / np.ptp(block.x[:, 0]), [0.3, 0.1, -1.0])
    load *= (float(sys.argv[2]) if len(sys.argv) > 2 else 2.0e4) / np.abs(load[:, 2].sum())  # N
    worst, rows = 0.0, ["analysis,law,largest displacement [m],difference over it"]
    for explicit in (False, True):
        for law in LAWS:
            fem, own = (moved(c, load, explicit) for c in decks(Path("."), law, explicit))
            largest = max(np.abs(u).max() for u in fem)
            off = max(np.abs(a - b).max() for a, b in zip(fem, own, strict=True)) / largest
            rows.append(f"{'explicit' if explicit else 'static'},{law},{largest:.6e},{off:.2e}")
            worst = max(worst, off)
    Path("same_load.csv").write_text("\n".join(rows) + "\n")
    print("\n".join(rows))
    return int(worst > LIMIT)


if __name__ == "__main__":
    sys.exit(main())
