"""Faults of users: one message with its code, exit code 1 or 4, nothing written."""

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from talus.cli import main
from talus.files import replaced
from talus.packing import make_packing, write_h5

ROOT = Path(__file__).resolve().parents[2]
ROW = "1 0 1 1 1 0 0 0 1 0 0 0 -\n"


def fault_of(arguments: list[str], capsys: pytest.CaptureFixture) -> tuple[int, str]:
    """Run a command that must fail; return its exit code and what it said."""
    code = main(arguments)
    said = capsys.readouterr().err
    assert code != 0, arguments
    assert said.startswith("error E5"), said
    return code, said


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ("", "required: command"),
        ("pack penetration --container smal -o a.h5", "did you mean 'small'?"),
        ("pack penetration --seedd 1 -o a.h5", "did you mean '--seed'?"),
        ("pack penetration --seed -1 -o a.h5", "-1 must not be negative"),
        ("pack lattice --pitch nan --axes 1 1 1 -o a.h5", "nan is not finite"),
        ("pack lattice --pitch 1 --axes 0 1 1 -o a.h5", "0 must be above 0"),
        ("pack cloud --count 0 --box 1 1 1 --axes 1 1 1 -o a.h5", "at least 1"),
        ("mesh block --size huge -o a.h5", "invalid size_of value: 'huge'"),
        ("render grains.h5 --size 0 0", "not from 50 to 8000 pixels"),
    ],
)
def test_words(words: str, text: str, capsys: pytest.CaptureFixture) -> None:
    """Words that are not understood are E500, with exit code 1."""
    code, said = fault_of(words.split(), capsys)
    assert code == 1
    assert "E500" in said
    assert text in said


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("mesh block --size 1e-9 -o a.h5", "E526"),
        ("mesh block --hole 0.1 -o a.h5", "E526"),
        ("mesh box --upper 1 -1 1 --cells 1 1 1 -o a.h5", "E526"),
        ("mesh convert junk.msh -o a.h5", "E520"),
        ("pack text2h5 junk.msh -o a.h5", "E502"),
        ("pack edit half.h5 -o a.h5", "E502"),
        ("pack cloud --count 9 --box 1 1 1 --axes 1 1 1 -o a.h5", "E512"),
        ("pack cloud --count 9 --box 1 1 1 --axes 1 1 1 --gradation 2:0 1:1 -o a.h5", "E514"),
        ("check junk.msh", "E532"),
        ("plot force junk.msh", "E545"),
        ("convert half.h5 -o v", "E543"),
        ("measure half.h5", "E502"),
        ("report .", "E553"),
    ],
)
def test_input(
    words: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Damaged input has its own code, exit code 1, and leaves no file behind."""
    monkeypatch.chdir(tmp_path)
    Path("junk.msh").write_bytes(bytes(range(256)))
    with h5py.File("half.h5", "w") as file:
        file.attrs["format"] = "talus-packing"
        file.create_group("grains")
    before = sorted(tmp_path.iterdir())
    code, said = fault_of(words.split(), capsys)
    assert code == 1
    assert expected in said
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        (ROW.replace("0 1 1 1", "0 nan 1 1"), "E504"),
        (ROW.replace("0 1 1 1", "0 -1 1 1"), "E504"),
        (ROW.replace("1 0 1 1", "1 7 1 1"), "E504"),
        (ROW.replace("1 0 0 0 -", "2 0 0 0 -"), "E504"),
        (ROW + ROW, "E503"),
        (ROW.replace("1 0 1 1", "9" * 30 + " 0 1 1"), "E502"),
        ("# no grains\n", "E502"),
    ],
)
def test_grains(row: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """Grains that no solver would take are named."""
    (tmp_path / "a.txt").write_text(row)
    code, said = fault_of(
        ["pack", "text2h5", str(tmp_path / "a.txt"), "-o", str(tmp_path / "a.h5")], capsys
    )
    assert code == 1
    assert expected in said
    assert not (tmp_path / "a.h5").exists()


def test_targets(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """A folder as target, or no folder for it, is a fault of the system (4)."""
    start = ["pack", "penetration", "--layers", "1", "-o"]
    (tmp_path / "folder.h5").mkdir()
    (tmp_path / "file").write_text("old")
    for target in ("folder.h5", "file/a.h5", "none/a.h5"):
        code, said = fault_of([*start, str(tmp_path / target)], capsys)
        assert code == 4
        assert "E501: cannot write" in said


def test_old_files_survive(tmp_path: Path) -> None:
    """What goes wrong while writing leaves the old file as it was, and no temporary one."""
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(RuntimeError), replaced(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_judge_of_the_penetration(tmp_path: Path) -> None:
    """The judge reads a folder of pieces, finished ones only, and tells orders that do not hold."""
    head = "time [s],id [-],x [m],y [m],z [m],force_z [N],work [J]\n"
    pieces = {
        "rigid_small_1": 3.0,
        "rigid_small_2": 5.0,
        "rigid_medium_1": 4.5,
        "rigid_large_1": 1.0,
    }
    pieces |= {"coupled_1.0e6_0.010": 1.0, "coupled_1.0e9_0.010": 2.0}
    for name, slope in pieces.items():
        rows = [f"{k},7,0,0,{-1e-3 * k},{slope * k},0\n" for k in range(70)]
        (tmp_path / name).mkdir()
        driven = "rigid_driven.csv" if name.startswith("rigid") else "grains_driven.csv"
        (tmp_path / name / driven).write_text(head + "".join(rows))
        (tmp_path / name / "finished").touch()
    (tmp_path / "rigid_large_2").mkdir()  # begun, not finished
    judge = [sys.executable, str(ROOT / "examples/01-penetration/judge.py"), str(tmp_path)]
    done = subprocess.run(judge, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    table = (tmp_path / "judge.csv").read_text()
    # mean of 4 k for k = 30 ... 60 over two seeds of 3 k and 5 k
    assert "containers,small,30,60,2,180,63.6396,1\n" in table
    assert "containers,large,30,60,1,45,nan,0.25\n" in table
    assert "small > medium > large,fail,medium > small" in table
    assert "rigid and moduli falling (0.010 m),pass," in table
    assert (tmp_path / "containers.png").exists() and (tmp_path / "moduli.png").exists()


def test_velocities_are_not_lost_in_silence(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """The text form has no velocities: h52text says so when there are some."""
    packing = make_packing(np.zeros((1, 3)), np.ones((1, 3)), v=np.ones((1, 3)))
    write_h5(tmp_path / "a.h5", packing)
    assert main(["pack", "h52text", str(tmp_path / "a.h5"), "-o", str(tmp_path / "a.txt")]) == 0
    assert "no velocities" in capsys.readouterr().out
