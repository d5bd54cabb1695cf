"""Checkpoints and the heartbeat of partners written in Python (talus.port_frame, talus.port)."""

import errno
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from own_solvers import enter
from test_explicit_frame import SPAN, Chain, ask, begun

from talus.faults import FaultError
from talus.port_checkpoint import find_checkpoint, hash_of, read_checkpoint, write_checkpoint
from talus.port_test import Options
from talus.port_test import test_solver as find_faults
from talus.programs import find_program
from talus.verification import read_history

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "verification/couple"))
from bed import write_bed  # noqa: E402

EXAMPLE = ROOT / "examples/12-own-solver/elastic_block.py"
COUPLED = """&run     title = 'Bed on a block', t_end = {end} /
&program side = 'grains', deck = 'grains.nml', threads = 1 /
&program side = 'solid', deck = 'block.toml', launch = 'command', command = '{command}' /
&clock   exchange = 1.0e-5, scheme = '{scheme}' /
&facets  ghosts = 'ghosts', facets = 'z1', interface = '{interface}' /
&checkpoint every_time = 2.0e-4 /
&limits  allow = 'interface_work_error' /
"""  # works of a few exchanges of first contact: what is looked at is the bits
EXPLICIT = """import sys
from pathlib import Path
import tomllib
import numpy as np
sys.path.insert(0, "{example}")
from elastic_block import Block
from talus.port_explicit import Explicit
from talus.port_frame import start

class Hammer(Explicit):
    program = "hammer"
    capabilities = Explicit.capabilities + ",checkpoint"
    damping = 20.0
    step_limit = 2.0e-5

    def __init__(self, block):
        super().__init__(block.x, block.cells, block.facets)
        self.gravity, self.held, self.mass = block.gravity, block.held, block.mass
        self.k, self.weight = block.k, block.weight

    def internal_force(self, u):
        return (self.k @ u.ravel()).reshape(u.shape)

deck = tomllib.loads(Path(sys.argv[1]).read_text())
sys.exit(start(lambda: Hammer(Block(**deck))))
"""
SLOW = """import sys, time, tomllib
sys.path.insert(0, "{example}")
from elastic_block import Block
from talus.port import port_of

class Slow(Block):
    longest = {longest}

    def ready(self, request):
        time.sleep(4.0)
        return super().ready(request)

sys.exit(Slow(**tomllib.load(open(sys.argv[1], "rb"))).run(port_of(sys.argv)))
"""


def write_case(folder: Path, explicit: bool, end: str) -> None:
    """Write a bed, the block and decks of a run to that time."""
    case = ROOT / "verification/couple/own_solver"
    write_bed(folder)
    for name in ("grains.nml", "block.toml"):
        shutil.copy(case / name, folder)
    if explicit:
        (folder / "hammer.py").write_text(EXPLICIT.format(example=EXAMPLE.parent))
    program = "hammer.py" if explicit else EXAMPLE
    (folder / "coupled.nml").write_text(COUPLED.format(
        end=end, command=f"{sys.executable} {program}",
        scheme="iterated" if explicit else "average", interface="none" if explicit else "springs",
    ))  # fmt: skip


def run(folder: Path, *words: str) -> None:
    """Run to the end."""
    done = subprocess.run([str(find_program("talus-couple")), "coupled.nml", *words], cwd=folder,
                          capture_output=True, text=True)  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("explicit", [False, True])
def test_a_coupled_run_goes_on(explicit: bool, tmp_path: Path,
                               monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    """Grains on a static block with springs, and on an explicit one: the same bits."""
    enter(tmp_path, monkeypatch)
    for name, ends in (("whole", ["1.28e-3"]), ("parts", ["6.4e-4", "1.28e-3"])):
        folder = tmp_path / name
        folder.mkdir()
        for k, end in enumerate(ends):
            write_case(folder, explicit, end)
            run(folder, *["--restart=auto"] * (k > 0))
    audits = [read_history(tmp_path / name / "coupled_audit.csv") for name in ("whole", "parts")]
    assert len(audits[0]["time"]) == len(audits[1]["time"]) == 128
    assert np.abs(audits[0]["force_on_solid_z"]).max() > 0.1
    for column, values in audits[0].items():
        assert np.array_equal(values, audits[1][column]), column
    last = [sorted((tmp_path / name).glob("*.x128*.chk.npz")) for name in ("whole", "parts")]
    assert len(last[0]) == len(last[1]) == 1
    (_, one), (_, other) = (read_checkpoint("hammer" if explicit else "elastic_block", file[0])
                            for file in last)  # fmt: skip
    assert one.keys() == other.keys()
    for name in one:
        assert np.array_equal(one[name], other[name]), name


class Keeping(Chain):
    """A chain that writes checkpoints."""

    capabilities = Chain.capabilities + ",checkpoint"


def test_a_rejected_trial_leaves_no_mark(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The accepted state is written, with its time; another chain goes on from it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("test_explicit_frame.Chain", Keeping)
    solid, force = begun(), np.ones((2, 3))
    ask(solid, "SET", what="dead_load", set="l", force=0.1 * force)
    ask(solid, "READY")
    ask(solid, "SOLVE", 0.0, SPAN, l__force=force, trial=1)
    ask(solid, "ACCEPT", 0.0, SPAN)
    ask(solid, "SOLVE", SPAN, 2 * SPAN, l__force=5.0 * force, trial=1)
    ask(solid, "REJECT", SPAN, 2 * SPAN)
    told = ask(solid, "CHECKPOINT", SPAN, SPAN, tag="x1")
    assert told["hash"] == hash_of(Path(told["path"]))
    wanted = ask(solid, "SOLVE", SPAN, 2 * SPAN, l__force=2.0 * force, trial=1)
    again = Keeping()
    hello = ask(again, "HELLO", run_id="r", restart=told["path"], protocol=2)
    assert hello["time"] == SPAN
    ask(again, "SELECT", set="l", role="load", id=np.array([1, 8]))
    ask(again, "SET", what="dead_load", set="l", force=0.1 * force)
    ask(again, "READY")
    found = ask(again, "SOLVE", SPAN, 2 * SPAN, l__force=2.0 * force, trial=1)
    for name, value in wanted.items():
        assert np.array_equal(value, found[name]), name


def test_what_cannot_be_gone_on_from(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Damaged, of another partner, of another mesh (E670); a partner that writes none (P427)."""
    monkeypatch.chdir(tmp_path)
    path = write_checkpoint("one", "a", 0.5, {"u": np.arange(3.0)})
    assert find_checkpoint("one", "a").resolve() == path
    assert find_checkpoint("one", "auto").resolve() == path
    assert find_checkpoint("two", "auto") is None
    time, state = read_checkpoint("one", path)
    assert time == 0.5 and state.keys() == {"u"}
    with pytest.raises(FaultError, match="E670: it is a checkpoint of one, not of two"):
        read_checkpoint("two", path)
    for words in (path.read_bytes()[:100], b"", b"nothing"):
        (tmp_path / "damaged").write_bytes(words)
        with pytest.raises(FaultError, match="E670: no checkpoint of one can be read"):
            read_checkpoint("one", tmp_path / "damaged")
    few = {name: np.zeros((3, 3)) for name in Chain().accepted_state()}
    other = write_checkpoint(Chain.program, "b", 0.5, few)
    with pytest.raises(FaultError, match="E670: its state does not fit .* 3 nodes, 8 are due"):
        ask(Keeping(), "HELLO", run_id="r", restart=str(other), protocol=2)
    with pytest.raises(FaultError, match="P427"):
        ask(Chain(), "HELLO", run_id="r", restart=str(other), protocol=2)
    with pytest.raises(FaultError, match="P427"):
        ask(begun(), "CHECKPOINT", tag="c")


def test_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """E671, and the earlier checkpoint is as it was."""
    monkeypatch.chdir(tmp_path)
    path = write_checkpoint("one", "a", 0.5, {"u": np.arange(3.0)})
    before = path.read_bytes()

    def refuse(file: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("os.fsync", refuse)
    with pytest.raises(FaultError, match="E671: the checkpoint cannot be written: No space left"):
        write_checkpoint("one", "a", 1.0, {"u": np.zeros(3)})
    assert [file.read_bytes() for file in tmp_path.iterdir()] == [before]


@pytest.mark.parametrize("transport", ["shared_memory", "hdf5"])
@pytest.mark.parametrize("longest", [30.0, 1.0])
def test_the_heart_beats_on(longest: float, transport: str, tmp_path: Path,
                            monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    """A partner that waits for 4 s in a request lives where 2 s may be silent, or is cut short."""
    enter(tmp_path, monkeypatch)
    monkeypatch.setattr("talus.port_test.ENDS", ())
    Path("slow.py").write_text(SLOW.format(example=EXAMPLE.parent, longest=longest))
    small = (ROOT / "verification/couple/own_solver/block.toml").read_text()
    Path("block.toml").write_text(small.replace("[4, 4, 3]", "[1, 1, 1]"))
    options = Options(time_limit=2.0, transport=transport, facets="z1")
    found = find_faults([sys.executable, "slow.py", "block.toml"], options)[0]
    if longest > 4.0:
        assert found == []
    else:
        assert any("no reply and no sign of life for 2 s" in line for _, line in found), found
