"""Fits to made-up tests: their constants come back; what cannot be fitted is refused."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from talus import fit, fit_decks, fit_tests, histories
from talus.cli import main
from talus.faults import FaultError
from talus.programs import find_program

LAWS = {
    "drucker_prager": (
        "law = 'drucker_prager', density = 1.0, young = {young}, poisson = 0.25, "
        "cohesion = {cohesion}, friction_deg = {friction_deg}, dilation_deg = {dilation_deg}",
        {"young": 1.0e8, "cohesion": 2.0e4, "friction_deg": 35.0, "dilation_deg": 10.0},
        {"young": 0.8e8, "cohesion": 1.5e4, "friction_deg": 30.0, "dilation_deg": 5.0},
    ),
    "cam_clay": (
        "law = 'cam_clay', density = 1.0, poisson = 0.3, critical_slope = {critical_slope}, "
        "compression_index = {compression_index}, swelling_index = {swelling_index}, "
        "specific_volume = 1.9",
        {"critical_slope": 1.2, "compression_index": 0.2, "swelling_index": 0.05},
        {"critical_slope": 1.0, "compression_index": 0.25, "swelling_index": 0.04},
    ),
    "sanisand": (
        "law = 'sanisand', density = 1.0, poisson = 0.05, stiffness_number = 125.0, "
        "critical_slope = {critical_slope}, extension_ratio = 0.712, critical_void_ratio = 0.934, "
        "critical_line_slope = 0.019, plastic_hardening = 7.05, hardening_void = 0.968, "
        "bounding_rate = 1.1, dilatancy = {dilatancy}, dilatancy_rate = 3.5, fabric_limit = 4.0, "
        "fabric_rate = 600.0",
        {"critical_slope": 1.25, "dilatancy": 0.704},
        {"critical_slope": 1.15, "dilatancy": 0.9},
    ),
}


def write_tests(folder: Path, law: str, noise: float = 0.0) -> list[str]:
    """Write two compressions at other pressures by the law with its true constants."""
    text, true, _ = LAWS[law]
    rng = np.random.default_rng(1)
    names = []
    for k, pressure in enumerate((1.0e5, 2.0e5)):
        own = f", void_ratio = {0.8 + 0.1 * k}" if law == "sanisand" else ""
        t = np.linspace(0.0, 1.0, 31)[:, None]
        strain = t * np.array([0.3, 0.2, -1.0, 0.1, 0.0, 0.2]) * 0.03
        made = fit_tests.Test("made", strain, np.full((31, 6), -pressure) * [1, 1, 1, 0, 0, 0])
        deck = folder / f"test{k}.nml"
        deck.write_text(fit_tests.deck_of(text.format(**true) + own + ", id = 'm'", made))
        subprocess.run([find_program("talus-fem"), deck, "--point"], check=True, stdout=-3)
        table = histories.read(folder / f"test{k}_point.csv").columns
        heads = [f"strain {c} [-]" for c in fit_tests.COMPONENTS]
        heads += [f"stress {c} [Pa]" for c in fit_tests.COMPONENTS]
        data = np.stack([table[h.split(" [")[0]] for h in heads], axis=1)
        data[1:, 6:] += noise * pressure * rng.standard_normal(data[1:, 6:].shape)
        path = folder / f"made{k}.csv"
        lines = [",".join(heads)] + [",".join(f"{v:.17g}" for v in row) for row in data]
        path.write_text("\n".join(lines) + "\n")
        names.append(f"{path}:void_ratio={0.8 + 0.1 * k}" if own else str(path))
    return names


def write_start(folder: Path, law: str) -> Path:
    """Write the deck with the constants to begin with."""
    text, _, start = LAWS[law]
    deck = folder / "start.nml"
    deck.write_text(f"! a comment / with a slash\n&material id = 'm', {text.format(**start)} /\n")
    return deck


@pytest.mark.parametrize("law", LAWS)
def test_recovers(tmp_path: Path, law: str) -> None:
    """Exact tests give back the constants that made them."""
    tests, deck = write_tests(tmp_path, law), write_start(tmp_path, law)
    out = tmp_path / "fit.json"
    assert main(["fit", str(deck), *tests, "--free", *LAWS[law][1], "--out", str(out)]) == 0
    found = json.loads(out.read_text())
    for name, value in LAWS[law][1].items():
        assert found["constants"][name] == pytest.approx(value, rel=1e-4)
    assert found["residual"] < 1e-5


def test_deck(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """--deck writes the deck with the constants and nothing else changed; never over its start."""
    tests, deck = write_tests(tmp_path, "drucker_prager"), write_start(tmp_path, "drucker_prager")
    words = ["fit", str(deck), *tests, "--free", "young", "friction_deg", "--deck"]
    new = tmp_path / "new.nml"
    assert main([*words, str(new)]) == 0
    before, after = deck.read_text().splitlines(), new.read_text().splitlines()
    assert before[0] == after[0] and len(before) == len(after)
    material = fit_decks.read_material(new)
    for name, value in {"young": 1.0e8, "friction_deg": 35.0}.items():
        # the constants that were not free are not those of the tests
        assert fit_decks.start_value(material, name, new) == pytest.approx(value, rel=0.15)
    for name, value in LAWS["drucker_prager"][2].items():
        if name not in ("young", "friction_deg"):
            assert fit_decks.start_value(material, name, new) == value
    capsys.readouterr()
    assert main([*words, str(deck)]) == 1
    assert "error E636" in capsys.readouterr().err and deck.read_text().splitlines() == before


def test_uncertainty(tmp_path: Path) -> None:
    """With noise of 1 % the constants are within four deviations, and these shrink with noise."""
    spreads = []
    for noise in (0.01, 0.001):
        tests = write_tests(tmp_path, "cam_clay", noise)
        deck = write_start(tmp_path, "cam_clay")
        material = fit_decks.read_material(deck)
        start = {n: fit_decks.start_value(material, n, deck) for n in LAWS["cam_clay"][1]}
        found = fit.fit(material, start, [fit_tests.read_test(Path(t), {}) for t in tests])
        true = np.array(list(LAWS["cam_clay"][1].values()))
        assert np.all(np.abs(found.values - true) < 4.0 * found.deviations)
        spreads.append(found.deviations)
    assert spreads[0] / spreads[1] == pytest.approx(np.full(3, 10.0), rel=0.2)


def test_refused(tmp_path: Path) -> None:
    """Unknown constants, tables without stress, laws that fail and idle constants are faults."""
    tests, deck = write_tests(tmp_path, "cam_clay"), write_start(tmp_path, "cam_clay")
    for code, arguments in {
        "E560": [*tests, "--free", "friction_deg"],
        "E563": [*tests, "--free", "density", "critical_slope"],
    }.items():
        with pytest.raises(FaultError) as fault:
            run(deck, arguments)
        assert fault.value.code == code
    other = tmp_path / "other.csv"
    other.write_text("time [s],strain xx [-]\n0.0,0.0\n1.0,0.1\n2.0,0.1\n")
    with pytest.raises(FaultError) as fault:
        run(deck, [str(other), "--free", "critical_slope"])
    assert fault.value.code == "E561"
    with pytest.raises(FaultError) as fault:
        run(deck, [f"{tests[0]}:compression_index=0.01", "--free", "critical_slope"])
    assert fault.value.code == "E562"
    assert "not above swelling_index" in str(fault.value)


def run(deck: Path, arguments: list[str]) -> None:
    """Run the command without its handling of faults."""
    from talus.cli import build_parser

    options = build_parser().parse_args(["fit", str(deck), *arguments])
    options.run(options)
