"""Sizes of grains by a law of the mass."""

from pathlib import Path

import numpy as np
import pytest

from talus import generate
from talus.cli import main
from talus.faults import FaultError
from talus.gradations import law_curve, quarters
from talus.packing import read_h5

WIDE = {  # law, parameters, limits that leave nothing of it out
    "normal": (["normal", "3e-3", "2e-4", "1.8e-3", "4.2e-3"], 3.0e-3, 0.5),
    "lognormal": (["lognormal", "2e-3", "0.2", "6e-4", "7e-3"], 2.0e-3, 0.5),
    "rosin-rammler": (["rosin-rammler", "2e-3", "6", "1e-4", "4e-3"], 2.0e-3, 1.0 - np.exp(-1.0)),
}


@pytest.mark.parametrize("law", WIDE)
def test_law_of_the_mass(law: str) -> None:
    """Half of the mass, or 63.2 % of it, passes the law's own size; moments are the law's."""
    words, size, share = WIDE[law]
    openings, passing = law_curve(words)
    assert passing[0] == pytest.approx(0.0, abs=1e-9)
    # 1e-3: parabola of the law between two of 200 openings
    assert np.interp(size, openings, passing) == pytest.approx(share, abs=1e-3)
    sizes = generate.sieved_sizes(100_000, openings, passing)
    mass = sizes**3 / (sizes**3).sum()
    assert mass[sizes <= size].sum() == pytest.approx(share, abs=3e-3)
    if law == "lognormal":
        middle = (mass * np.log(sizes)).sum()
        assert np.exp(middle) == pytest.approx(2e-3, rel=2e-3)
        assert np.sqrt((mass * (np.log(sizes) - middle) ** 2).sum()) == pytest.approx(0.2, rel=0.01)
    if law == "normal":
        assert np.sqrt((mass * (sizes - 3e-3) ** 2).sum()) == pytest.approx(2e-4, rel=0.01)


def test_limits_cut_the_law() -> None:
    """Between limits the mass is that of the law there, scaled to one."""
    openings, passing = law_curve(["lognormal", "2e-3", "0.5", "2e-3", "4e-3"])
    inner = law_curve(["lognormal", "2e-3", "0.5", "1e-5", "1"])
    whole = np.interp(3e-3, *inner) - np.interp(2e-3, *inner)
    whole /= np.interp(4e-3, *inner) - np.interp(2e-3, *inner)
    assert openings[[0, -1]] == pytest.approx([2e-3, 4e-3])
    assert np.interp(3e-3, openings, passing) == pytest.approx(whole, abs=2e-3)
    marks, shares = quarters(openings, passing)
    assert np.interp(marks, openings, passing) == pytest.approx(shares)


def test_cloud_by_a_law(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """A cloud has sizes within the limits, and says how well its grains follow the law."""
    words = "pack cloud --count 300 --box .05 .05 .05 --axes 3 2 1 --distribution lognormal 2e-3 .2"
    assert main([*words.split(), "1e-3", "4e-3", "-o", str(tmp_path / "c.h5")]) == 0
    assert "sieve curve, largest error of the mass" in capsys.readouterr().out
    middle = 2.0 * np.median(read_h5(tmp_path / "c.h5").axes, axis=1)
    assert ((middle >= 1e-3) & (middle <= 4e-3)).all()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("gauss 1e-3 1e-4 5e-4 2e-3", "rosin-rammler: size that 63.2 % pass"),
        ("normal 1e-3 x 5e-4 2e-3", "is no law of sizes"),
        ("normal 1e-3 0 5e-4 2e-3", "is no law of sizes"),
        ("normal 1e-3 nan 5e-4 2e-3", "is no law of sizes"),
        ("lognormal 1e-3 0.2 2e-3 1e-3", "is no law of sizes"),
        ("normal 1e-3 1e-4 5 6", "no mass between 5 and 6 m"),
    ],
)
def test_faults(words: str, said: str) -> None:
    """What is no law is a fault that names the laws."""
    with pytest.raises(FaultError, match="E514") as fault:
        law_curve(words.split())
    assert said in str(fault.value) + str(getattr(fault.value, "hint", ""))
