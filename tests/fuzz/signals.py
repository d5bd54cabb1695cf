"""Kills and signals at random moments of coupled runs; restarts give the bits of a whole run.

Usage: signals.py [--long] [--seed N] [--bin FOLDER] [--keep]
Each trial sends SIGKILL or another signal to one of the three programs, at a random moment from its
first instant on. The run must end within the limit with the right exit code, its restart must end
as the run that nobody disturbed, and nothing may stay behind it.
"""

import os
import signal
import sys
import time
from argparse import Namespace
from pathlib import Path

import runs

LIMIT = 25.0  # s for a run to end after a signal
ADAPT = "adapt"  # shared memory, grains wake and leave
T_END = {"shared_memory": 0.05, "hdf5": 0.008, ADAPT: 4.0e-4}  # s; some two seconds of wall time
SHORT = 0.4  # of it, and of the moments, without --long
STOPS = [signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT]


def model(folder: Path, share: float, transport: str) -> None:
    """Write the model of a transport, or the one in which grains wake."""
    if transport == ADAPT:
        runs.opened_column(folder, 1.0e-6 * round(1.0e6 * share * T_END[transport]))
    else:
        runs.model(folder, share * T_END[transport], transport)


def whole(given: Namespace, tally: runs.Tally, transport: str) -> tuple:
    """Return exit code and result of a run that nobody disturbs."""
    folder = given.scratch / f"whole-{transport}"
    model(folder, given.share, transport)
    code, text = runs.Run(given.bin, folder).end(120.0)
    tally.check(f"whole run over {transport} ends, code {code}", code in (0, 2), text)
    left = runs.remains(folder)
    tally.check(f"whole run over {transport} leaves nothing: {left}", not left)
    return code, runs.result(folder)


def victim(run: runs.Run, program: str, moment: float) -> int | None:
    """Wait for the moment [s] after the start; return the process of a program, None: not there."""
    begun = time.monotonic()
    if program == "talus-couple":
        time.sleep(moment)
        return run.pid
    while time.monotonic() - begun < moment or program not in run.solvers:
        if run.process.poll() is not None:
            return None
        run.solvers |= {k: v for k, v in runs.children(run.pid).items() if k in runs.SOLVERS}
        time.sleep(0.002)
    return run.solvers[program]


def disturb(run: runs.Run, program: str, number: int, moment: float) -> bool:
    """Send the signal at the moment; false when the program had ended before."""
    pid = victim(run, program, moment)
    if pid is None:
        return False
    run.solvers |= {k: v for k, v in runs.children(run.pid).items() if k in runs.SOLVERS}
    return runs.kill(pid, number)


def expected(program: str, number: int, good: int | None) -> set[int | None]:
    """Return the exit codes that a signal may lead to; `good` is that of a whole run.

    The run may have ended, or be about to, when the signal comes; solvers leave requests to stop to
    talus-couple once they are at the port.
    """
    if number == signal.SIGKILL:
        return {good, -9} if program == "talus-couple" else {good, 4}
    return {good, 3} if program == "talus-couple" else {good, 3, 4}


def one(given: Namespace, tally: runs.Tally, name: str, folder: Path, trial: tuple) -> None:
    """One trial: transport, program, signal, moment [s], and what a whole run gives."""
    transport, program, number, moment, (good, bits) = trial
    model(folder, given.share, transport)
    run = runs.Run(given.bin, folder)
    disturb(run, program, number, moment)
    code, text = run.end(LIMIT)
    tally.check(f"{name}: ends within {LIMIT} s", code is not None, text)
    tally.check(f"{name}: exit code {code}", code in expected(program, number, good), text)
    left = run.strays()
    tally.check(f"{name}: no solver stays: {left}", not left)
    again = runs.Run(given.bin, folder, "--restart=auto")
    code, text = again.end(120.0)
    tally.check(f"{name}: restart ends as a whole run, code {code}", code == good, text)
    different = runs.differences(runs.result(folder), bits)
    tally.check(f"{name}: restart gives the same bits, not {different[:5]}", not different)
    left = runs.remains(folder)
    tally.check(f"{name}: nothing stays after the restart: {left}", not left)


def main() -> int:
    """Run the trials."""
    given = runs.arguments(__doc__)
    tally = runs.Tally()
    given.share = 1.0 if given.long else SHORT
    programs = ["talus-couple", *runs.SOLVERS]
    good = {transport: whole(given, tally, transport) for transport in T_END}
    trials = 120 if given.long else 4
    only = os.environ.get("TALUS_FUZZ_ONLY")
    for k in range(trials):
        transport = given.rng.choice(sorted(T_END))
        program = given.rng.choice(programs)
        number = signal.SIGKILL if k % 3 else given.rng.choice(STOPS)
        moment = given.share * given.rng.uniform(0.0, given.rng.choice([0.3, 1.0, 2.5]))
        if only and int(only) != k:
            continue
        name = f"{k} {transport}: {signal.Signals(number).name} to {program} at {moment:.3f} s"
        one(given, tally, name, given.scratch / f"{k:03d}",
            (transport, program, number, moment, good[transport]))  # fmt: skip
    return runs.leave(given, tally)


if __name__ == "__main__":
    sys.exit(main())
