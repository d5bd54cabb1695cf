"""Tiles: made at a stress, density and edge; at rest when laid side by side; refused when wrong."""

import json
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
from talus.tile_even import cycle_text, even
from talus.tile_stamp import SHARES, check_images, measured_stress, read_stamp
from talus.verification import field_steps, read_history

STRESS, EDGE = 100.0e3, 0.02
SPHERES = ["--count", "200", "--axes", "1e-3", "1e-3", "1e-3", "--spread", "0.2"]
ELLIPSOIDS = ["--count", "300", "--axes", "2.5e-3", "2e-3", "1.5e-3", "--seed", "2"]
COMMON = ["--stress", "100e3", "--young", "2.9e9", "--making-friction", "0.3", "--edge", str(EDGE),
          "--least-edges", "5"]  # fmt: skip
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
    normal = np.diag(stamp.stress)
    assert np.abs(normal / normal.mean() - 1.0).max() < 5e-3  # EVEN
    assert stamp.normal_wanted == pytest.approx(np.full(3, STRESS))
    shear = np.linalg.norm(stamp.stress[[0, 0, 1], [1, 2, 2]])
    assert stamp.anisotropy == pytest.approx(np.sqrt(3.0) * shear / normal.mean(), abs=0.01)
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


def told(made: Path, name: str, **changes: object) -> Path:
    """Return a copy of the tile whose stamp tells other numbers."""
    (made / name).write_bytes((made / "tile.h5").read_bytes())
    with edited(made / name) as file:
        for key, value in changes.items():
            file["tile"].attrs[key] = value
    return made / name


def test_stamp_is_checked(made: Path) -> None:
    """Numbers of a stamp that do not belong together are refused; the first version is read."""
    stress = read_stamp(made / "tile.h5").stress
    for key, value in (("solid_fraction", 0.5), ("anisotropy", 0.3), ("coordination", 3.0)):
        with pytest.raises(FaultError, match="E516.*stamp tells"):
            read_stamp(told(made, "other.h5", **{key: value}))
    with pytest.raises(FaultError, match="E519.*bear"):
        read_stamp(told(made, "other.h5", mean_wanted=2.0 * STRESS))
    with pytest.raises(FaultError, match="E535.*normal stresses"):
        read_stamp(told(made, "other.h5", normal_wanted=STRESS * np.array([1.02, 0.99, 0.99])))
    old = told(made, "old.h5", version=np.int32(1))
    with edited(old) as file:
        for key in ("mean_wanted", "normal_wanted", "anisotropy"):
            del file["tile"].attrs[key]
    assert np.array_equal(read_stamp(old).stress, stress)


def test_check_tile(made: Path, capsys: pytest.CaptureFixture) -> None:
    """The check tells what the stamp tells, from a run; a tile that bears another stress fails."""
    assert main(["pack", "check-tile", str(made / "tile.h5"), "--json"]) == 0
    facts, stamp = json.loads(capsys.readouterr().out), read_stamp(made / "tile.h5")
    assert facts["solid fraction"] == pytest.approx(stamp.solid_fraction)
    assert facts["coordination number"] == pytest.approx(stamp.coordination)
    assert facts["mean stress [Pa]"] == pytest.approx(np.trace(stamp.stress) / 3.0, rel=1e-9)
    assert facts["anisotropy of the stress"] == pytest.approx(stamp.anisotropy, rel=1e-6)
    assert sum(facts["fabric xx, yy, zz"]) == pytest.approx(1.0)
    assert facts["unbalanced over mean contact force"] < 1e-6
    assert 0.0 < facts["largest overlap over the least semi-axis"] < 0.02
    assert facts["of grains that bear"] > facts["coordination number"] - 0.1
    softer = told(made, "softer.h5", young=2.8e9)
    assert main(["pack", "check-tile", str(softer)]) == 1
    assert "E519" in capsys.readouterr().err


@pytest.mark.parametrize("words", [["--stresses", "80e3", "100e3", "120e3"],
                                   ["--stress", "100e3", "--mean-only"]])  # fmt: skip
def test_other_stresses(words: list[str], tmp_path: Path) -> None:
    """Three normal stresses are held each, or the mean alone at edges that keep their ratio."""
    grains = ["--count", "200", "--axes", "1e-3", "1e-3", "1e-3", "--making-friction", "0.2"]
    more = ["--young", "2.9e9", "--least-edges", "5", "--seed", "2"]
    more += ["-o", str(tmp_path / "tile.h5")]
    assert main(["pack", "tile", *grains, *words, *more]) == 0
    stamp, tile = read_stamp(tmp_path / "tile.h5"), read_h5(tmp_path / "tile.h5")
    edges = np.diag(tile.cell) / tile.cell[0, 0]
    if "--mean-only" in words:
        assert np.allclose(edges, 1.0, rtol=1e-12)
        assert np.isnan(stamp.normal_wanted).all()
    else:
        assert np.diag(stamp.stress) == pytest.approx([80e3, 100e3, 120e3], abs=1e3)
    assert np.trace(stamp.stress) / 3.0 == pytest.approx(100e3, rel=5e-3)


class FakeCycles:
    """A material whose stress after a cycle changes with the square of the strain."""

    def __init__(self, normal: np.ndarray, jump: float):
        """Take the first stresses [Pa], and how much the first cycle fails by."""
        self.kept, self.last, self.jump = normal, normal, jump

    def cycle(self, number: int, strain: np.ndarray) -> np.ndarray:
        """Return the stresses after a cycle."""
        change = 1e10 * strain * np.linalg.norm(strain)
        self.last = self.kept + change + (self.jump * np.array([1, -1, 0]) if number < 3 else 0.0)
        return self.last

    def keep(self) -> None:
        """Go on from here."""
        self.kept = self.last


@pytest.mark.parametrize("jump", [0.0, 3e3])
def test_even_converges(jump: float) -> None:
    """Cycles bring the stresses together; what makes them worse is dropped."""
    fake = FakeCycles(1e5 * np.array([0.93, 1.05, 1.02]), jump)
    said = []
    assert even(fake, fake.kept, 2.9e9, said.append) < 5e-3
    assert np.abs(fake.kept / 1e5 - 1.0).max() < 5e-3
    assert "cycles" in said[0]


def test_cycle_returns() -> None:
    """The rates of a cycle bring the edges back: their integral over the whole time is zero."""
    text, end = cycle_text(np.array([2e-4, -1e-4, -1e-4]), 0.5)
    times = [float(word) for word in text.split("times = ")[1].split("/")[0].split(",")]
    values = [0.0, 1.0, 1.0, -1.0, -1.0, 0.0]
    assert np.trapezoid(values, times) == pytest.approx(0.0, abs=1e-15)
    assert 0.5 * np.trapezoid(values[:3], times[:3]) == pytest.approx(2e-4, rel=1e-3)
    assert end > times[-1]


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
    # only contacts that bear nothing may open: loose grains that just touch
    force = np.linalg.norm(field_steps(made / "tile_stages/check.h5")[0].contacts["force"], axis=1)
    loose = 8 * (force < 1e-5 * force.mean()).sum()
    assert abs(rows["contacts"][-1] - rows["contacts"][0]) <= loose
    assert loose <= 0.01 * rows["contacts"][0]
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
    assert main(["pack", "tile", *words, "--seed", "3"]) == 1
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
        ([*SPHERES, "--making-friction", "0.1"], "E500.*required"),
        (
            [*SPHERES, "--making-friction", "0.1", "--stresses", "1", "2", "3", "--mean-only"],
            "E500.*exclude",
        ),
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
