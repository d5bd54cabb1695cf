"""`talus doctor`: faults of a machine are found, and each has a cure."""

import sys
from pathlib import Path

import pytest

from talus import cli, machine


def test_compiler_by_its_age() -> None:
    """Accept 12, refuse 11; none will do where the programs are installed."""
    assert not machine.of_compiler("GNU Fortran (Debian 12.2.0-14) 12.2.0").cure
    assert machine.of_compiler("GNU Fortran (Debian 11.3.0-1) 11.3.0").cure
    assert machine.of_compiler("").cure
    assert not machine.of_compiler("", installed=True).cure


def test_slow_kernel_of_openblas() -> None:
    """Refuse an old kernel that was set by hand on a CPU with AVX2 alone."""
    flags = {"avx2", "avx512f"}
    assert "SkylakeX" in machine.of_kernel("Prescott", flags, "Prescott").cure
    assert "Haswell" in machine.of_kernel("Prescott", {"avx2"}, "Prescott").cure
    assert not machine.of_kernel("Prescott", flags, "").cure
    assert not machine.of_kernel("Prescott", set(), "Prescott").cure


@pytest.mark.parametrize("asked", ["0", "5", "many"])
def test_threads(asked: str) -> None:
    """Refuse numbers of threads that 4 cores cannot serve, accept others."""
    assert machine.of_threads(asked, 4).cure
    assert not machine.of_threads("4,2", 4).cure and not machine.of_threads("", 4).cure


def test_space(tmp_path: Path) -> None:
    """Refuse a folder that is not there or too small."""
    assert not machine.of_space("disk", tmp_path, 1).cure
    assert machine.of_space("disk", tmp_path, 2**62).cure
    assert machine.of_space("disk", tmp_path / "none", 1).cure


def test_status_and_cure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Return 1 and say what to do where the folder of results is not there."""
    assert cli.main(["doctor", str(tmp_path / "none")]) == 1
    told = capsys.readouterr().out
    assert "wrong  disk" in told and "do: make it" in told


def test_missing_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Name a program that is not where TALUS_BIN points."""
    monkeypatch.setenv("TALUS_BIN", str(tmp_path))
    assert "TALUS_BIN" in machine.of_program("talus-dem").cure


def test_library_that_does_not_load(monkeypatch: pytest.MonkeyPatch) -> None:
    """Say so where h5py cannot be imported, and give the version where it can."""
    assert machine.of_hdf5().seen[0].isdigit()
    monkeypatch.setitem(sys.modules, "h5py", None)
    assert machine.of_hdf5().cure
