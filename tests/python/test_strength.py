"""Cones fitted to made-up tests: exact cones come back, bad tests are refused, figure and JSON."""

import json
from pathlib import Path

import numpy as np
import pytest
from test_specimens import write_walls

from talus import strength
from talus.cli import main
from talus.faults import FaultError

NINE = [a + b for a in "xyz" for b in "xyz"]
HEAD = (["time [s]", "volume [m3]"]
        + [f"edge_{e}{c} [m]" for e in "abc" for c in "xyz"]
        + [f"deform_{n} [-]" for n in NINE] + [f"rate_{n} [1/s]" for n in NINE]
        + [f"stress_{n} [Pa]" for n in NINE])  # fmt: skip
FRICTION, DILATION, COHESION = np.radians(30.0), np.radians(8.0), 2.0e3


def slope_of(angle: float) -> float:
    """B of a cone that meets Mohr and Coulomb's in triaxial compression [-]."""
    return 2.0 * np.sqrt(6.0) * np.sin(angle) / (3.0 - np.sin(angle))


def write_cell(path: Path, pressure: float, shear: bool, cohesion: float = COHESION) -> None:
    """Write a test on the cone: |s| = B p + A c throughout, dilation with the path of strain."""
    intercept = slope_of(FRICTION) / np.tan(FRICTION) * cohesion
    lines = [",".join(HEAD)]
    for t in np.linspace(0.0, 1.0, 401):
        p = pressure * (1.0 + 0.3 * np.sin(5.0 * t))
        norm = slope_of(FRICTION) * p + intercept
        walk = 0.2 * t
        volume = np.exp(slope_of(DILATION) * walk)
        if shear:
            deform = np.eye(3)
            deform[0, 2] = np.sqrt(2.0) * walk
            deviator = np.zeros((3, 3))
            deviator[0, 2] = deviator[2, 0] = norm / np.sqrt(2.0)
        else:
            axial = np.sqrt(2.0 / 3.0) * walk
            deform = np.diag(np.exp([axial / 2.0, axial / 2.0, -axial]))
            deviator = norm / np.sqrt(6.0) * np.diag([1.0, 1.0, -2.0])
        edges = np.eye(3) * np.cbrt(volume)
        stress = deviator - p * np.eye(3)
        row = [t, volume, *edges.ravel(), *deform.ravel(), *np.zeros(9), *stress.ravel()]
        lines.append(",".join(f"{v:.17g}" for v in row))
    path.write_text("\n".join(lines) + "\n")


def test_cone_comes_back(tmp_path: Path) -> None:
    """Friction, dilation and cohesion of a triaxial and a shear test on one cone."""
    write_cell(tmp_path / "triaxial_cell.csv", 100.0e3, False)
    write_cell(tmp_path / "shear_cell.csv", 40.0e3, True)
    tests = [strength.read_loading(tmp_path / f"{n}_cell.csv") for n in ("triaxial", "shear")]
    assert [test.name for test in tests] == ["triaxial", "shear"]
    assert tests[1].path[-1] == pytest.approx(0.2, rel=1e-9)
    assert tests[0].path[-1] == pytest.approx(0.2, rel=1e-5)
    for cone, _ in strength.fit_states(tests, "compression").values():
        assert cone.friction_deg == pytest.approx(30.0, abs=1e-8)
        assert cone.dilation_deg == pytest.approx(8.0, abs=2e-3)
        assert cone.cohesion_Pa == pytest.approx(COHESION, rel=1e-8)
        assert cone.scatter < 1e-10


def test_no_cohesion(tmp_path: Path) -> None:
    """One test, or a line that would meet the pressure above zero: through the origin."""
    write_cell(tmp_path / "one_cell.csv", 100.0e3, False, 0.0)
    write_cell(tmp_path / "two_cell.csv", 40.0e3, True, -500.0)
    one = strength.read_loading(tmp_path / "one_cell.csv")
    two = strength.read_loading(tmp_path / "two_cell.csv")
    cone = strength.fit_states([one], "compression")["peak"][0]
    assert cone.cohesion_Pa == 0.0
    assert cone.friction_deg == pytest.approx(30.0, abs=1e-8)
    write_cell(tmp_path / "one_cell.csv", 100.0e3, False, -500.0)
    one = strength.read_loading(tmp_path / "one_cell.csv")
    cone = strength.fit_states([one, two], "compression")["critical"][0]
    assert cone.cohesion_Pa == 0.0
    assert cone.friction_deg < 30.0


def test_walls(tmp_path: Path) -> None:
    """A box whose stress has a hump: the cone of triaxial compression has the angle at its top."""
    write_walls(tmp_path / "box_walls.csv")
    test = strength.read_loading(tmp_path / "box_walls.csv")
    assert test.name == "box"
    assert test.volume[-1] == pytest.approx(-0.6)
    with pytest.raises(FaultError, match="E559"):
        strength.peak_rows(test)
    rows = [np.arange(49, 52)]
    cone = strength.fit([test], rows)
    assert 29.7 < cone.friction_deg < 30.0
    assert cone.dilation_deg < 0.0


def test_other_cone(tmp_path: Path) -> None:
    """The cone through triaxial extension has the same slope and a larger angle."""
    write_cell(tmp_path / "one_cell.csv", 100.0e3, False, 0.0)
    one = strength.read_loading(tmp_path / "one_cell.csv")
    cone = strength.fit_states([one], "extension")["peak"][0]
    sine = np.sin(np.radians(cone.friction_deg))
    assert 2.0 * np.sqrt(6.0) * sine / (3.0 + sine) == pytest.approx(slope_of(FRICTION))
    assert cone.friction_deg > 40.0


def test_short_test(tmp_path: Path) -> None:
    """A test that has hardly moved has no strength (E559)."""
    write_cell(tmp_path / "one_cell.csv", 100.0e3, False)
    path = tmp_path / "one_cell.csv"
    path.write_text("\n".join(path.read_text().splitlines()[:8]) + "\n")
    with pytest.raises(FaultError, match="E559"):
        strength.fit_states([strength.read_loading(path)], "compression")
    assert main(["measure", str(path), "--strength", "-o", str(tmp_path)]) == 1


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """The command prints a table, writes figure and JSON; one packing is measured at a time."""
    write_cell(tmp_path / "a_cell.csv", 100.0e3, False)
    write_cell(tmp_path / "b_cell.csv", 40.0e3, True)
    files = [str(tmp_path / "a_cell.csv"), str(tmp_path / "b_cell.csv")]
    out = tmp_path / "out"
    assert main(["measure", *files, "--strength", "-o", str(out)]) == 0
    assert "30.0 deg" in capsys.readouterr().out
    facts = json.loads((out / "strength.json").read_text())
    assert facts["format"] == "talus-strength"
    assert facts["peak"]["friction_deg"] == pytest.approx(30.0)
    assert (out / "strength.png").read_bytes().startswith(b"\x89PNG")
    assert main(["measure", *files]) == 1
    assert main(["measure", *files, "--strength", "--layers", "3"]) == 1
