"""Choices of a fit: bounds, constants of some tests, tests left out, what is not told apart."""

import json
from pathlib import Path

import numpy as np
import pytest

from talus import fit, fit_decks, fit_tests, histories
from talus.cli import build_parser, main
from talus.faults import FaultError

YOUNG, POISSON, PRESSURE = 1.0e8, 0.25, 1.0e5  # [Pa], [-], [Pa]
LAW = "law = 'drucker_prager', density = 1.0, cohesion = 1.0e9, friction_deg = 30.0, "
GENERAL = np.array([3.0e-4, 2.0e-4, -1.0e-3, 1.0e-4, 0.0, 2.0e-4])
ISOTROPIC = np.array([-1.0e-3, -1.0e-3, -1.0e-3, 0.0, 0.0, 0.0])


def write(path: Path, direction: np.ndarray = GENERAL, young: float = YOUNG) -> Path:
    """Write an elastic test by Hooke's law, far below the strength of the deck's."""
    strain = np.linspace(0.0, 1.0, 5)[:, None] * direction
    shear = young / (2.0 * (1.0 + POISSON))
    first = shear * 2.0 * POISSON / (1.0 - 2.0 * POISSON)
    stress = shear * np.array([2.0, 2.0, 2.0, 1.0, 1.0, 1.0]) * strain
    stress[:, :3] += first * strain[:, :3].sum(axis=1)[:, None] - PRESSURE
    heads = [f"{what} {c}" for what in ("strain [-]", "stress [Pa]") for c in fit_tests.COMPONENTS]
    heads = [f"{h.split()[0]} {h.split()[2]} {h.split()[1]}" for h in heads]
    lines = [",".join(heads)]
    lines += [",".join(f"{v:.17g}" for v in row) for row in np.hstack([strain, stress])]
    path.parent.mkdir(exist_ok=True)
    path.write_text("\n".join(lines) + "\n")
    return path


def run(folder: Path, *words: object) -> dict:
    """Fit from constants that are off; return the JSON."""
    deck = folder / "law.nml"
    deck.write_text(f"&material id = 'm', {LAW} young = 0.8e8, poisson = 0.2 /\n")
    texts = ["fit", deck, *words, "--out", folder / "fit.json"]
    options = build_parser().parse_args([str(text) for text in texts])
    options.run(options)
    return json.loads((folder / "fit.json").read_text())


def code_of(folder: Path, *words: object) -> tuple[str, str]:
    """Return the code and the text of the fault of a fit."""
    with pytest.raises(FaultError) as fault:
        run(folder, *words)
    return fault.value.code, str(fault.value)


def test_bounds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A constant stops at its bound, and the other one is the best beside it."""
    test = write(tmp_path / "a.csv")
    found = run(tmp_path, test, "--free", "young", "poisson", "--bounds", "young=:0.9e8")
    assert found["constants"]["young"] == 0.9e8 and found["at_bound"] == ["young"]
    assert found["deviations"]["young"] is None and found["correlation"][0][0] is None
    assert "at its bound" in capsys.readouterr().out
    alone = run(tmp_path, test, "--free", "young=0.9e8", "poisson", "--bounds", "young=0.9e8:9e8")
    assert alone["constants"]["young"] == pytest.approx(YOUNG, rel=1e-6) and not alone["at_bound"]
    held = fit_decks.with_constants(f"id = 'm', {LAW} poisson = 0.2", {"young": 0.9e8})
    best = fit.fit(held, {"poisson": 0.2}, [fit_tests.read_test(test, {})])
    # a fit ends where a step changes the sum of squares by 1e-6
    near = 0.01 * best.deviations[0]
    assert found["constants"]["poisson"] == pytest.approx(best.values[0], abs=near)
    assert found["deviations"]["poisson"] == pytest.approx(best.deviations[0], rel=1e-3)


def test_bounds_refused(tmp_path: Path) -> None:
    """Bounds of what is not free, that are none, or that the start is outside of."""
    test = write(tmp_path / "a.csv")
    for bounds in ("poisson=0:0.4", "young=1e6", "young=1e9:2e9", "young=0.8e8:0.8e8"):
        assert code_of(tmp_path, test, "--free", "young", "--bounds", bounds)[0] == "E640"
    assert code_of(tmp_path, test, "--free", "young", "--bounds", "young=few:")[0] == "E560"


def test_labels(tmp_path: Path) -> None:
    """Tests of two packs have a modulus each and one Poisson's ratio."""
    soft, stiff = write(tmp_path / "soft.csv"), write(tmp_path / "stiff.csv", young=3.0 * YOUNG)
    words = [f"{soft}:young=low", f"{stiff}:young=high", "--free", "low=9e7", "high=2e8", "poisson"]
    found = run(tmp_path, *words)
    expected = {"low": YOUNG, "high": 3.0 * YOUNG, "poisson": POISSON}
    assert found["constants"] == pytest.approx(expected, rel=1e-6)
    code, text = code_of(tmp_path, f"{soft}:young=other", *words[1:])
    assert code == "E560" and "'other'" in text
    assert code_of(tmp_path, soft, "--free", "low=much")[0] == "E560"
    assert code_of(tmp_path, f"{soft}:young", "--free", "poisson")[0] == "E560"


def test_own_constant_wins(tmp_path: Path) -> None:
    """A number of one test stays although the constant is free for the others."""
    one, other = write(tmp_path / "a.csv"), write(tmp_path / "b.csv", young=2.0 * YOUNG)
    found = run(tmp_path, one, f"{other}:young={2.0 * YOUNG}", "--free", "young", "poisson")
    expected = {"young": YOUNG, "poisson": POISSON}
    assert found["constants"] == pytest.approx(expected, rel=1e-6)


def test_left_out(tmp_path: Path) -> None:
    """A test that is left out changes no constant; its misfit is that of the moduli."""
    test, other = write(tmp_path / "a.csv"), write(tmp_path / "b.csv", young=1.2 * YOUNG)
    points = tmp_path / "points"
    words = [test, "--free", "young", "poisson", "--left-out", other, "--points", points]
    found = run(tmp_path, *words)
    assert found["constants"]["young"] == pytest.approx(YOUNG, rel=1e-6)
    assert found["misfit"]["a"] < 1e-6 and found["tests"] == ["a"]
    law, grains = (fit_tests.read_test(path, {}) for path in (test, other))
    weights = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
    off = ((law.stress - grains.stress)[1:] ** 2 @ weights).sum()
    size = (grains.stress[1:] ** 2 @ weights).sum()
    assert found["misfit_left_out"]["b"] == pytest.approx(np.sqrt(off / size), rel=1e-5)
    table = histories.read(points / "b_point.csv").columns
    assert table["stress zz"] == pytest.approx(law.stress[:, 2], rel=1e-6)


def test_not_told_apart(tmp_path: Path) -> None:
    """Isotropic compression has one modulus: the message names its two constants, no others."""
    one, other = write(tmp_path / "a.csv", ISOTROPIC), write(tmp_path / "b.csv")
    words = [f"{one}:young=e,poisson=nu", f"{other}:poisson=0.25", "--free", "young"]
    code, text = code_of(tmp_path, *words, "e=8e7", "nu=0.2")
    assert code == "E563" and "e, nu apart" in text and "young" not in text
    assert code_of(tmp_path, one, "--free", "young", "density")[0] == "E563"


def test_names(tmp_path: Path) -> None:
    """Tests of one name in two folders are told apart; one test twice is refused."""
    one, other = write(tmp_path / "x/a.csv"), write(tmp_path / "y/a.csv")
    found = run(tmp_path, one, other, "--free", "young", "poisson")
    assert found["tests"] == ["x_a", "y_a"]
    assert code_of(tmp_path, one, "--free", "young", "--left-out", one)[0] == "E641"


def test_not_converged(tmp_path: Path, capsys: pytest.CaptureFixture[str],
                       monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    """A fit that uses up its steps says so, one that ends does not."""
    test = write(tmp_path / "a.csv")
    words = [test, "--free", "young", "poisson"]
    assert run(tmp_path, *words)["converged"] and "NOT" not in capsys.readouterr().out
    monkeypatch.setattr(fit, "MOST_STEPS", 1)
    assert not run(tmp_path, *words)["converged"]
    assert "NOT CONVERGED in 1 steps" in capsys.readouterr().out


def test_told() -> None:
    """Constants with wide deviations and close pairs are named."""
    correlation = np.array([[1.0, -0.99, 0.1], [-0.99, 1.0, 0.2], [0.1, 0.2, 1.0]])
    found = fit.Fit(["a", "b", "c"], np.array([1.0, -2.0, 3.0]), np.array([0.5, 2.5, np.nan]),
                    correlation, 0.1, 1, 9)  # fmt: skip
    assert found.loose() == ["b"]
    assert found.pairs(0.95) == [("b", "a", -0.99)]


def test_command_prints(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The command tells constants and the misfit of each test, fitted or left out."""
    deck = tmp_path / "law.nml"
    deck.write_text(f"&material id = 'm', {LAW} young = 0.8e8, poisson = 0.2 /\n")
    test, other = write(tmp_path / "a.csv"), write(tmp_path / "b.csv", young=1.2 * YOUNG)
    words = ["fit", deck, test, "--free", "young", "--left-out", other]
    assert main([str(word) for word in words]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith("b, left out of the fit") and line.endswith("%") for line in lines)
