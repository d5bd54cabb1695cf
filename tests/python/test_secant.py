"""Secants of made-up tests: a linear one gives its constants, others the curve; faults."""

import json
from pathlib import Path

import numpy as np
import pytest
from test_specimens import write_walls

from talus import fit_tests, secant
from talus.cli import main
from talus.faults import FaultError
from talus.specimens import Specimen

YOUNG, POISSON, SIDE = 2.0e7, 0.2, 8.0e4


def linear(name: str = "linear") -> Specimen:
    """Return a linear test that is shortened along x at constant lateral stress."""
    strain = np.array([0.0, 1.0e-4, 1.0e-3, 3.0e-3, 1.0e-2])
    lengths = np.exp(np.outer(strain, [-1.0, POISSON, POISSON]))
    stress = np.column_stack([SIDE + YOUNG * strain, np.full(5, SIDE), np.full(5, SIDE)])
    return Specimen(name, strain, lengths, stress, 0, None)


def test_linear() -> None:
    """Constants at, between and before rows; half the strength at half the strain."""
    for strain in (1.0e-2, 2.0e-3, 5.0e-5):
        found = secant.secant_at(linear(), strain)
        assert found.strain == strain
        assert found.young_Pa == pytest.approx(YOUNG, rel=1e-10)
        assert found.poisson == pytest.approx(POISSON, rel=1e-9)
        assert found.of_strength == pytest.approx(strain / 1.0e-2, rel=1e-10)
    assert secant.strain_to(linear(), 0.3) == pytest.approx(3.0e-3)


def test_beyond() -> None:
    """A strain that the test does not reach, or none, is refused."""
    for strain in (1.1e-2, 0.0, -1.0e-3):
        with pytest.raises(FaultError, match="reaches 1 %") as caught:
            secant.secant_at(linear(), strain)
        assert caught.value.code == "E557"


def test_beside() -> None:
    """A cylinder of volume pi a^2 h out of the mantle of radius r: u = a^2/2r, strain u/r."""
    a, r, h = 6.0e-3, 26.0e-3, 40.0e-3
    strain = secant.strain_beside(np.pi * a**2 * h, 2.0 * np.pi * r * h, r)
    assert strain == pytest.approx(0.5 * (a / r) ** 2)


def test_law(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Secants of an elastic law in uniaxial stress (*_point.csv) are its constants."""
    young, poisson, strain = 3.0e6, 0.25, np.linspace(0.0, 0.02, 11)
    heads = [f"strain {c} [-]" for c in fit_tests.COMPONENTS] + [
        f"stress {c} [Pa]" for c in fit_tests.COMPONENTS
    ]
    zero = np.zeros_like(strain)
    side = poisson * strain
    columns = [strain, side, side, -strain, zero, zero, zero]
    columns += [zero - 1.0e4, zero - 1.0e4, -1.0e4 - young * strain, zero, zero, zero]
    lines = [",".join(["time [s]", *heads])] + [
        ",".join(f"{v:.17g}" for v in row) for row in zip(*columns, strict=True)
    ]
    (tmp_path / "law_point.csv").write_text("\n".join(lines) + "\n")
    assert main(["measure", str(tmp_path / "law_point.csv"), "--json", "--secant", "0.01"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found[0]["young_Pa"] == pytest.approx(young)
    assert found[0]["poisson"] == pytest.approx(poisson)
    assert found[0]["of_strength"] == pytest.approx(0.5)


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Strains in their order, that beside a body, half the strength last; other options refused."""
    write_walls(tmp_path / "run_walls.csv")
    words = ["measure", str(tmp_path / "run_walls.csv"), "--json"]
    assert main([*words, "--secant", "0.5", "0.25", "--beside", "3.0", "5.0", "2.0"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [one["strain"] for one in found[:3]] == [0.5, 0.25, pytest.approx(0.3)]
    start = 200.0 * np.exp(-0.25 / 0.02)
    assert found[0]["young_Pa"] == pytest.approx((200.0 - start) / 0.5, rel=1e-6)
    assert found[0]["poisson"] == pytest.approx(0.2, rel=1e-6)
    assert found[-1]["of_strength"] >= 0.5
    assert found[-1]["strain"] == pytest.approx(0.39, abs=1e-9)
    assert main([*words[:2], "--secant", "0.5"]) == 0
    assert "poisson" in capsys.readouterr().out
    assert main([words[0], words[1], words[1], "--secant", "0.5"]) == 1
    assert "E557" in capsys.readouterr().err
