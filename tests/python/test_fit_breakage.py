"""The law of crushing from a made-up grading and compression: what made them comes back."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from talus import fit_breakage, fit_decks, fit_tests, histories
from talus.cli import build_parser, main
from talus.faults import FaultError
from talus.programs import find_program

# Collins-Craft et al. 2020, as case breakage has them
YOUNG, POISSON, SLOPE, ENERGY, OMEGA = 19.248e9, 0.268, 1.7, 4.65e6, 70.0
LEAST, LARGEST, FRACTAL = 1.0e-6, 105.0e-6, 2.6
THETA = 0.8026646
LAW = (
    "id = 'm', law = 'breakage', density = 1.0, young = {young}, poisson = 0.268, "
    "critical_slope = 1.7, breakage_energy = {energy}, breakage_angle_deg = {omega}, "
)
SIZES = "grain_size_min = 1.0e-6, grain_size_max = 1.0, fractal_dimension = 2.6"
START = {"young": 1.0e9, "energy": 1.0e5, "omega": 45.0}


def make(folder: Path, ratio: float = 1.0) -> None:
    """Write a compression of the law, lateral strain (1 - ratio) of the axial, and its grading."""
    t = np.linspace(0.0, 1.0, 81)[:, None]
    lateral = 1.0 / 3.0 if ratio == 1.0 else 0.0
    strain = -0.25 * t * np.array([lateral, lateral, 1.0 - 2.0 * lateral, 0.0, 0.0, 0.0])
    first = np.full((81, 6), -1.0e8) * [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]
    law = LAW.format(young=YOUNG, energy=ENERGY, omega=OMEGA) + f"grading_index = {THETA}"
    deck = folder / "bed.nml"
    deck.write_text(fit_tests.deck_of(law, fit_tests.Test("bed", strain, first)))
    subprocess.run([find_program("talus-fem"), deck, "--point"], check=True, stdout=-3)
    table = histories.read(folder / "bed_point.csv").columns
    write_grading(folder / "bed_grading.csv", table["time"], table["breakage"])
    (folder / "law.nml").write_text(
        f"! begins far away\n&material {LAW.format(**START)}\n  {SIZES} / ! of the test\n"
    )


def write_grading(path: Path, times: np.ndarray, breakage: np.ndarray) -> None:
    """Write F = (1 - B) F_0 + B F_u, all grains of the largest size at the start."""
    sizes = np.append(np.geomspace(LEAST, 0.999 * LARGEST, 80), LARGEST)
    power = 3.0 - FRACTAL
    ultimate = (sizes**power - LEAST**power) / (LARGEST**power - LEAST**power)
    passing = breakage[:, None] * ultimate + (1.0 - breakage[:, None]) * (sizes >= LARGEST)
    heads = ["time [s]"] + [f"{w}_{s:.9g} [-]" for w in ("passing", "resolved") for s in sizes]
    rows = np.column_stack([times, passing, passing])
    lines = [",".join(heads)] + [",".join(f"{v:.15g}" for v in row) for row in rows]
    path.write_text("\n".join(lines) + "\n")


def test_moments() -> None:
    """The ultimate grading's moment is that of its curve; one size has its square."""
    sizes = np.geomspace(LEAST, LARGEST, 4001)
    power = 3.0 - FRACTAL
    passing = (sizes**power - LEAST**power) / (LARGEST**power - LEAST**power)
    found = fit_breakage.second_moments(sizes, passing[None, :])[0]
    assert fit_breakage.ultimate_moment(LEAST, LARGEST, FRACTAL) == pytest.approx(found, rel=1e-6)
    one = fit_breakage.second_moments(np.array([0.999, 1.0]), np.array([[0.0, 1.0]]))
    assert one[0] == pytest.approx(1.0, rel=2e-3)
    wide = fit_breakage.second_moments(np.array([0.5, 1.0]), np.array([[0.0, 1.0], [1.0, 1.0]]))
    assert wide == pytest.approx([1.75 / 3.0, 0.25 / 3.0])  # even in size between sieves
    assert 1.0 - found / LARGEST**2 == pytest.approx(THETA, rel=1e-6)


@pytest.mark.parametrize("path", ["isotropic", "one-dimensional"])
def test_grading_tells(tmp_path: Path, path: str) -> None:
    """Theta, breakage, modulus, energy and angle come from grading and compression alone."""
    make(tmp_path, 1.0 if path == "isotropic" else 0.0)
    _, breakage, index, largest = fit_breakage.read_breakage(
        tmp_path / "bed_grading.csv", LEAST, FRACTAL
    )
    table = histories.read(tmp_path / "bed_point.csv").columns
    assert largest == pytest.approx(LARGEST)
    assert index == pytest.approx(THETA, rel=1e-3)
    assert np.abs(breakage - table["breakage"]).max() < 2e-3
    test = fit_tests.read_test(tmp_path / "bed_point.csv", {})
    known = {"poisson": POISSON, "critical_slope": SLOPE, "grain_size_min": LEAST,
             "fractal_dimension": FRACTAL}  # fmt: skip
    found = fit_breakage.find(test, tmp_path / "bed_grading.csv", known)
    # rows are 0.3 % of strain apart, and elastic strain at yield is 2.9 %
    assert found.young == pytest.approx(YOUNG, rel=0.05)
    assert found.energy == pytest.approx(ENERGY, rel=0.06)
    assert found.angle_deg == pytest.approx(OMEGA, abs=1.0)


def test_fit(tmp_path: Path) -> None:
    """The fit begins there and ends at the constants that made the test; the deck has them."""
    make(tmp_path)
    words = ["fit", tmp_path / "law.nml", tmp_path / "bed_point.csv", "--free", "young",
             "breakage_energy", "breakage_angle_deg", "--grading", tmp_path / "bed_grading.csv",
             "--deck", tmp_path / "new.nml", "--out", tmp_path / "fit.json"]  # fmt: skip
    assert main([str(word) for word in words]) == 0
    found = json.loads((tmp_path / "fit.json").read_text())
    # theta comes from sieves, and with it what the others have to be
    assert found["constants"]["young"] == pytest.approx(YOUNG, rel=1e-3)
    assert found["constants"]["breakage_energy"] == pytest.approx(ENERGY, rel=2e-3)
    assert found["constants"]["breakage_angle_deg"] == pytest.approx(OMEGA, rel=1e-3)
    assert found["misfit"]["bed_point"] < 1e-3
    new = tmp_path / "new.nml"
    material = fit_decks.read_material(new)
    assert "grain_size" not in material and "fractal" not in material
    assert fit_decks.start_value(material, "grading_index", new) == pytest.approx(THETA, rel=1e-3)
    assert new.read_text().startswith("! begins far away") and "! of the test" in new.read_text()


def refusal(words: list[object]) -> FaultError:
    """Return the fault of a fit."""
    options = build_parser().parse_args(["fit", *(str(word) for word in words)])
    with pytest.raises(FaultError) as fault:
        options.run(options)
    return fault.value


def test_refused(tmp_path: Path) -> None:
    """Another law, friction before crushing, too little breakage and unknown sizes are refused."""
    make(tmp_path, 0.0)
    law, bed, grading = (tmp_path / n for n in ("law.nml", "bed_point.csv", "bed_grading.csv"))
    words = [law, bed, "--free", "young", "--grading", grading]
    text = law.read_text()
    law.write_text(text.replace("'breakage'", "'linear_elastic'"))
    assert refusal(words).code == "E642"
    law.write_text(text.replace("critical_slope = 1.7", "critical_slope = 0.5"))
    assert "larger critical_slope" in refusal(words).hint
    law.write_text(text.replace("grain_size_min = 1.0e-6,", "grain_size_min = 1.0,"))
    assert "sieve" in str(refusal(words))
    law.write_text(text.replace("grain_size_min = 1.0e-6,", ""))
    assert refusal(words).code == "E560"
    law.write_text(text)
    table = histories.read(bed).columns
    write_grading(grading, table["time"], 1e-3 * table["breakage"])
    assert "breakage goes from" in str(refusal(words))
