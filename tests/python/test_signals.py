"""Requests to stop: from the first instant on, each leads to a checkpoint and exit code 3."""

import signal
import subprocess
import time
from pathlib import Path

import pytest

from talus.packing import make_packing, write_h5
from talus.programs import find_program

DECK = """&run title = 'Falls', t_end = 1.0e3, gravity = 0.0, 0.0, -9.81 /
&material id = 'grain', density = 2650.0, young = 1.0e7, poisson = 0.25 /
&contact between = 'grain', 'grain', law = 'hertz_mindlin', friction = 0.5, damping_ratio = 0.3 /
&particles file = 'one.h5', material = 'grain' /
&dynamics dt = 1.0e-6 /
&checkpoint every_time = 1.0e2 /
"""
STOPS = [signal.SIGHUP, signal.SIGINT, signal.SIGQUIT, signal.SIGTERM]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a deck that would run for an hour."""
    write_h5(tmp_path / "one.h5", make_packing([[0.0, 0.0, 0.0]], [[1e-3, 1e-3, 1e-3]]))
    (tmp_path / "deck.nml").write_text(DECK)
    return tmp_path


def started(folder: Path, **options: object) -> subprocess.Popen:
    """Start talus-dem on the deck; a nohup before the tests themselves does not count."""
    command = [find_program("talus-dem"), "deck.nml", "--threads=1"]
    options.setdefault("preexec_fn", lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL))
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                            text=True, **options)  # fmt: skip


def heeds(process: subprocess.Popen, number: int) -> bool:
    """Does the process hold back or catch a signal by now?"""
    state = Path(f"/proc/{process.pid}/status").read_text()
    masks = [line.split()[1] for line in state.splitlines() if line[:6] in ("SigBlk", "SigCgt")]
    return any(int(mask, 16) >> (number - 1) & 1 for mask in masks)


def wait_for(condition: object, seconds: float = 30.0) -> None:
    """Look again and again until the condition holds."""
    end = time.monotonic() + seconds
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < end
        time.sleep(0.0005)


@pytest.mark.parametrize("number", STOPS, ids=lambda number: number.name)
@pytest.mark.parametrize("moment", ["first", "running"])
def test_a_stop_ends_with_checkpoint(folder: Path, number: int, moment: str) -> None:
    """Exit code 3, a checkpoint, the signal's name in the log, no lock and no backtrace left."""
    run = started(folder)
    wait_for(lambda: heeds(run, number))
    if moment == "running":
        wait_for(lambda: (folder / "deck.log").exists())
        time.sleep(0.1)
    run.send_signal(number)
    said, _ = run.communicate(timeout=60)
    assert run.returncode == 3, said
    assert f"signal {number.name}" in said
    assert "acktrace" not in said
    assert (folder / "deck.chk.h5").exists()
    assert not list(folder.glob("*.lock")) + list(folder.glob("*.tmp"))


def test_nohup_is_respected(folder: Path) -> None:
    """Who starts the program with SIGHUP ignored wants it to go on after a hang-up."""
    run = started(folder, preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
    wait_for(lambda: (folder / "deck.log").exists())
    run.send_signal(signal.SIGHUP)
    time.sleep(0.3)
    assert run.poll() is None
    run.send_signal(signal.SIGTERM)
    said, _ = run.communicate(timeout=60)
    assert run.returncode == 3
    assert "signal SIGTERM" in said
