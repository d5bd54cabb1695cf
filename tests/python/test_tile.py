"""Tiles: made at a stress, density and edge; at rest when laid side by side; refused when wrong."""

import re
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest

from talus import tile as tiles
from talus.checksum import edited
from talus.cli import main
from talus.faults import FaultError
from talus.packing import Packing, make_packing, read_h5, read_packing, write_h5
from talus.programs import find_program
from talus.tile import Wanted, next_friction, run_deck, search_friction
from talus.tile_stamp import SHARES, check_images, measured_stress, read_stamp
from talus.verification import field_steps, read_history

STRESS, EDGE = 100.0e3, 0.02
SPHERES = ["--count", "320", "--axes", "1e-3", "1e-3", "1e-3", "--spread", "0.2"]
ELLIPSOIDS = ["--count", "300", "--axes", "2.5e-3", "2e-3", "1.5e-3"]
COMMON = ["--stress", "100e3", "--young", "2.9e9", "--making-friction", "0.3", "--edge", str(EDGE),
          "--least-edges", "6"]  # fmt: skip
DECK = """&run       title = 'Tile at rest', t_end = {t_end} /
&material  id = 'grain', density = 2650.0, young = 2.9e9, poisson = 0.25 /
&contact   between = 'grain', 'grain', law = 'hertz_mindlin', friction = 0.5, damping_ratio = 0.2 /
&particles file = '{name}.h5', material = 'grain' /
&cell /
&dynamics  dt_factor = 0.2 /
&output    every_time = 1.0, fields = 'contacts' /
&history   every_time = {t_end} /
"""


def run(folder: Path, name: str, t_end: float = 5e-4) -> dict[str, np.ndarray]:
    """Run a packing in its cell by dynamics; return energies and stresses."""
    (folder / f"{name}_run.nml").write_text(DECK.format(name=name, t_end=t_end))
    words = [str(find_program("talus-dem")), f"{name}_run.nml", "--threads=1"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = read_history(folder / f"{name}_run_energy.csv")
    return rows | read_history(folder / f"{name}_run_cell.csv")


def stress_of(rows: dict[str, np.ndarray], row: int) -> np.ndarray:
    """Return the stress (3, 3) of a row of a run, positive in compression [Pa]."""
    return -np.array([[rows[f"stress_{a}{b}"][row] for b in "xyz"] for a in "xyz"])


@pytest.fixture(scope="module", params=["spheres", "ellipsoids"])
def made(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a tile of some grains."""
    folder = tmp_path_factory.mktemp(request.param)
    grains = SPHERES if request.param == "spheres" else ELLIPSOIDS
    assert main(["pack", "tile", *grains, *COMMON, "-o", str(folder / "tile.h5")]) == 0
    return folder


def test_stamp(made: Path) -> None:
    """The stamp holds what the packing is, and a changed packing is no tile."""
    tile, stamp = read_h5(made / "tile.h5"), read_stamp(made / "tile.h5")
    assert np.allclose(tile.cell, EDGE * np.eye(3), rtol=1e-12, atol=1e-15)
    solid = 4.0 / 3.0 * np.pi * tile.axes.prod(axis=1).sum()
    assert stamp.solid_fraction == pytest.approx(solid / EDGE**3, rel=1e-12)
    assert 0.55 < stamp.solid_fraction < 0.68
    assert abs(np.trace(stamp.stress) / 3.0 / STRESS - 1.0) < 2e-3  # servo's tolerance is 1e-3
    assert stamp.coordination == pytest.approx(2.0 * len(tile.pairs) / tile.count)
    size = np.sort(2.0 * np.median(tile.axes, axis=1))
    assert stamp.openings[[0, -1]] == pytest.approx(size[[0, -1]])
    assert not tile.v.any()
    assert not tile.omega.any()
    tile.x[0, 0] += 1e-9
    write_h5(made / "moved.h5", tile)
    with pytest.raises(FaultError, match="E516.*no tile"):
        read_stamp(made / "moved.h5")
    (made / "changed.h5").write_bytes((made / "tile.h5").read_bytes())
    with edited(made / "changed.h5") as file:
        file["contacts/tangential"][0, 0] += 1e-9
    with pytest.raises(FaultError, match="E516.*hash"):
        read_stamp(made / "changed.h5")


def test_eight_tiles_rest(made: Path) -> None:
    """2 x 2 x 2 tiles bear the stress, keep their energy and their contacts."""
    words = [str(made / "tile.h5"), "--repeat", "2", "2", "2", "-o", str(made / "eight.h5")]
    assert main(["pack", "edit", *words]) == 0
    stamp, rows = read_stamp(made / "tile.h5"), run(made, "eight")
    grains = read_h5(made / "eight.h5").count
    for row in (0, -1):
        assert abs(np.trace(stress_of(rows, row)) / 3.0 / STRESS - 1.0) < 2e-3
        assert np.abs(stress_of(rows, row) - stamp.stress).max() < 1e-3 * STRESS
    number = 2.0 * rows["contacts"] / grains
    assert number[0] == pytest.approx(stamp.coordination, rel=1e-12)
    assert number[-1] == pytest.approx(stamp.coordination, rel=3e-3)  # two contacts of a tile
    lost = rows["friction"][-1] + rows["contact_damping"][-1]
    assert lost < 1e-3 * rows["elastic"][0]
    assert abs(rows["elastic"][-1] / rows["elastic"][0] - 1.0) < 1e-3


def test_twice_the_edge(made: Path) -> None:
    """Twice the edge, the same stress in a run; forces are four times as large."""
    tile = read_packing(made / "tile.h5")
    write_h5(made / "double.h5", tile.scaled(2.0))
    one, two = run(made, "tile", 1e-5), run(made, "double", 2e-5)
    assert np.abs(stress_of(one, 0) - stress_of(two, 0)).max() < 1e-10 * STRESS
    assert two["elastic_tangential"][0] == pytest.approx(8.0 * one["elastic_tangential"][0])
    # tangential forces that are not scaled are another stress
    wrong = tile.scaled(2.0)
    wrong.tangential = tile.tangential
    write_h5(made / "wrong.h5", wrong)
    other = run(made, "wrong", 2e-5)
    assert np.abs(stress_of(one, 0) - stress_of(other, 0)).max() > 1e-3 * STRESS


def test_finished_stages_stay(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same command makes the same tile without a run; other grains are refused."""
    grains = SPHERES if "spheres" in made.name else ELLIPSOIDS

    def none(*_: object, **__: object) -> None:
        raise AssertionError("talus-dem was started")

    monkeypatch.setattr(tiles.subprocess, "run", none)
    words = [*grains, *COMMON, "--work", str(made / "tile_stages"), "-o", str(made / "again.h5")]
    assert main(["pack", "tile", *words]) == 0
    assert read_stamp(made / "again.h5").hash == read_stamp(made / "tile.h5").hash
    assert main(["pack", "tile", *words, "--seed", "2"]) == 1
    with h5py.File(made / "again.h5") as file:
        assert np.allclose(file["tile"].attrs["passing"], SHARES)


def test_checks_notice(made: Path) -> None:
    """A contact over another image, a missing one and another force are noticed."""
    tile = read_packing(made / "tile.h5")
    contacts = field_steps(made / "tile_stages" / "check.h5")[0].contacts
    stress, number = measured_stress(tile, contacts)
    assert number == len(tile.pairs)
    assert np.abs(stress - read_stamp(made / "tile.h5").stress).max() < 1e-9 * STRESS

    def changed() -> Packing:
        return tile.take(np.arange(tile.count))

    other = changed()
    other.shift = tile.shift + np.eye(3, dtype=int)[0]
    with pytest.raises(FaultError, match="E519.*image"):
        check_images(other)
    other = changed()
    other.tangential = 1.001 * tile.tangential
    with pytest.raises(FaultError, match="E519.*tangential"):
        measured_stress(other, contacts)
    fewer = tile.take(np.arange(tile.count))
    fewer.pairs, fewer.tangential = tile.pairs[1:], tile.tangential[1:]
    fewer.shift = tile.shift[1:]
    with pytest.raises(FaultError, match="E519.*contacts"):
        measured_stress(fewer, contacts)


def test_friction_of_making_is_found() -> None:
    """The search ends in a few trials, and tells when there is no such packing."""

    def fraction(mu: float) -> float:
        return 0.64 - 0.07 * mu / (mu + 0.2)

    for wanted in (0.638, 0.62, 0.6, 0.5825):
        found = [(0.1, fraction(0.1) - wanted)]
        while abs(found[-1][1]) > 1e-3:
            mu = next_friction(found)
            found.append((mu, fraction(mu) - wanted))
        assert len(found) < 7, found
    for wanted, end in ((0.7, 0.0), (0.5, 1.0)):
        found = [(0.1, fraction(0.1) - wanted)]
        while (mu := next_friction(found)) is not None:
            found.append((mu, fraction(mu) - wanted))
        assert found[-1][0] == end


class FakeStages:
    """Stages whose packing has one sphere and a solid fraction that falls with friction."""

    def press(self, friction: float, *_: object) -> Packing:
        """Return a sphere of 1 m3 in a cell."""
        edge = (0.64 - 0.07 * friction / (friction + 0.2)) ** (-1.0 / 3.0)
        pack = make_packing(np.zeros((1, 3)), np.full((1, 3), (0.75 / np.pi) ** (1.0 / 3.0)))
        pack.cell = edge * np.eye(3)
        return pack


def test_search_ends_or_says_why() -> None:
    """The friction that is found gives the fraction; E517 names the limit or the trials."""

    def search(fraction: float, trials: int = 12) -> float:
        wanted = Wanted(1e5, 0.5, 2650.0, 1e9, 0.25, fraction, trials=trials, tolerance=1e-4)
        return search_friction(FakeStages(), wanted, lambda _: None)

    mu = search(0.6)
    assert abs(0.64 - 0.07 * mu / (mu + 0.2) - 0.6) <= 1e-4
    with pytest.raises(FaultError, match="E517.*densest packing of these grains has 0.6400"):
        search(0.7)
    with pytest.raises(FaultError, match="E517.*loosest"):
        search(0.5)
    with pytest.raises(FaultError, match="E517.*no friction of making was found in 2"):
        search(0.6, 2)


def test_failed_stage_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stage that talus-dem does not finish is E518 and not kept; the next try runs it again."""
    program = tmp_path / "talus-dem"
    program.write_text("#!/bin/sh\necho 'error N203: not at rest'\nexit 2\n")
    program.chmod(0o755)
    monkeypatch.setenv("TALUS_BIN", str(tmp_path))
    write_h5(tmp_path / "cloud.h5", FakeStages().press(0.1))
    for _ in range(2):
        with pytest.raises(FaultError, match="E518.*stage press: error N203") as fault:
            run_deck(tmp_path, "press", "&particles file = 'cloud.h5' /\n")
        assert fault.value.exit_code == 2
    assert not (tmp_path / "press.done").exists()


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ([*SPHERES, "--stress", "1e5", "--solid-fraction", "0.6"], "E519.*mean diameters wide"),
        ([*SPHERES, "--stress", "1e5"], "E500.*required"),
        ([*SPHERES, *COMMON, "--poisson", "0.7"], "E500.*poisson"),
        (["--count", "9", "--stress", "1e5", "--solid-fraction", "0.6"], "E507"),
    ],
)
def test_refused(
    words: list[str], text: str, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    """Wrong input is refused before anything is run."""
    assert main(["pack", "tile", *words, "-o", str(tmp_path / "tile.h5")]) == 1
    assert re.search(text, capsys.readouterr().err)
    assert not list(tmp_path.glob("*_stages/press*"))
