"""Codes of the command talus that no other test expects: each with its fault and exit code."""

import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from talus import generate, histories, pictures, programs
from talus.cli import main
from talus.faults import FaultError
from talus.packing import make_packing, write_h5

CSV = "time [s],kinetic [J]\n0,0\n1,2\n"


def spheres(path: Path, kind: int, groups: dict[str, np.ndarray] | None = None) -> None:
    """Write a packing of two spheres of one kind."""
    x = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 3.0]])
    kinds = np.full(2, kind, dtype=np.int32)
    write_h5(path, make_packing(x, np.ones((2, 3)), kind=kinds, groups=groups or {}))


@pytest.mark.parametrize(
    ("words", "expected", "text"),
    [
        ("pack edit fixed.h5 --tool -o a.h5", "E511", "no free grains to push into"),
        ("pack edit tooled.h5 --tool -o a.h5", "E511", "has a penetrator already"),
        ("pack edit fixed.h5 --keep-box 1 1 1 2 2 2 -o a.h5", "E511", "no grain is left"),
        ("pack edit fixed.h5 --drop-group wall -o a.h5", "E513", "no group 'wall'"),
        ("measure fixed.h5", "E540", "no free grains"),
        ("plot force", "E549", "needs a file"),
        ("plot audit a.csv b.csv", "E549", "requires one file"),
        ("plot nowhere", "E549", "is no folder and no kind of plot"),
        ("plot audit run_energy.csv", "E546", "run_energy.csv has no column"),
        ("plot energy run_energy.csv --output a.xyz", "E554", "written as 'a.xyz'"),
        ("render fixed.h5 --output a.xyz", "E554", "written as 'a.xyz'"),
        ("convert fixed.h5 --output a.stl", "E555", "'a.stl' is no folder"),
        ("report broken", "E552", "broken/run_summary.json"),
        ("report odd", "E552", "it is no summary of a run"),
        ("render half.h5 --output a.png", "E542", "step 0: no dataset grains/quat"),
        ("check nowhere.nml", "E531", "cannot read nowhere.nml"),
    ],
)
def test_codes(
    words: str, expected: str, text: str, tmp_path: Path, capsys: pytest.CaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """A fault of the input has its code and text, exit code 1, and leaves no file behind."""
    monkeypatch.chdir(tmp_path)
    spheres(Path("fixed.h5"), 1)
    spheres(Path("tooled.h5"), 0, {"tool": np.array([2])})
    Path("run_energy.csv").write_text(CSV)
    Path("broken").mkdir()
    Path("broken/run_summary.json").write_text('{"program": ')
    Path("odd").mkdir()
    Path("odd/run_summary.json").write_text('{"program": "talus-dem", "errors": [1]}')
    with h5py.File("half.h5", "w") as file:
        step = file.create_group("steps/000000")
        step.attrs["time"] = 0.0
        for name in ("id", "kind", "x", "axes"):
            step[f"grains/{name}"] = [1]
    before = sorted(tmp_path.rglob("*"))
    assert main(words.split()) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"error {expected}"), said
    assert text in said
    assert sorted(tmp_path.rglob("*")) == before


def test_shapes_of_the_library() -> None:
    """Names that the command line already refuses are refused by the library, too."""
    with pytest.raises(FaultError, match="no container 'huge'") as fault:
        generate.penetration("huge", 1)
    assert fault.value.code == "E510"
    with pytest.raises(FaultError, match="no lattice 'sc2'") as fault:
        generate.lattice("sc2", (1, 1, 1), 1.0, np.ones(3))
    assert fault.value.code == "E510"
    with pytest.raises(FaultError) as fault:
        histories.History(Path("a.csv"), {"time": np.zeros(1)}, {"time": "s"})["speed"]
    assert fault.value.code == "E546"


def test_programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A solver that is not there (E530), and one that answers nonsense (E533), are exit code 4."""
    monkeypatch.setenv("TALUS_BIN", str(tmp_path))
    with pytest.raises(FaultError, match="talus-dem is not in") as fault:
        programs.find_program("talus-dem")
    assert (fault.value.code, fault.value.exit_code) == ("E530", 4)
    solver = tmp_path / "talus-dem"
    solver.write_text("#!/bin/sh\necho no JSON\n")
    solver.chmod(0o755)
    deck = tmp_path / "deck.nml"
    deck.write_text("&particles file = 'a.h5' /\n")
    assert main(["check", str(deck)]) == 4


def test_nonsense_of_a_solver(
    tmp_path: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The hint of E533 holds the end of what the solver said."""
    solver = tmp_path / "talus-fem"
    solver.write_text("#!/bin/sh\necho out of order >&2\n")
    solver.chmod(0o755)
    monkeypatch.setenv("TALUS_BIN", str(tmp_path))
    (tmp_path / "deck.nml").write_text("&mesh file = 'a.h5' /\n")
    assert main(["check", str(tmp_path / "deck.nml")]) == 4
    said = capsys.readouterr().err
    assert said.startswith("error E533")
    assert "out of order" in said


def test_no_pyvista(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without pyvista pictures are refused with E550 and exit code 4."""
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(FaultError) as fault:
        pictures.load_pyvista()
    assert (fault.value.code, fault.value.exit_code) == ("E550", 4)


def test_empty_file(tmp_path: Path) -> None:
    """An HDF5 file without a format is no packing."""
    with h5py.File(tmp_path / "a.h5", "w"):
        pass
    assert main(["measure", str(tmp_path / "a.h5")]) == 1
