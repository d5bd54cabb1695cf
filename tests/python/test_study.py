"""Studies: plans, decks, results, indices of known functions, kills, schedulers, every fault."""

import csv
import itertools
import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from talus.cli import main
from talus.faults import FaultError
from talus.study import deck_text, statistics
from talus.study.definition import read_study
from talus.study.figures import scatter
from talus.study.folders import Store
from talus.study.parameters import Target, read_parameter
from talus.study.plans import make_points, saltelli_shares
from talus.study.sequence import MOST_COLUMNS, latin_points, sobol_points
from talus.study.table import collect

DECK = """! contact of quartz / steel
&run title = 'it''s a / test', gravity = 0.0, 0.0, -9.81 /
&material id = 'quartz', density = 2650.0, young = 29.0e9, poisson = 0.25 /
&material id = 'steel', density = 7850.0,
  young = 2.0e11, ! young = 1.0 /
  poisson = 0.3 /
&contact between = 'quartz', 'steel', law = 'hertz_mindlin', friction = 0.5 /
&contact between = 'quartz', 'quartz', law = 'hertz_mindlin' /
&particles file = 'a.h5', material = 'quartz' /
"""
SQUARE = """[study]
base = "base"
plan = "grid"
levels = 3
commands = ["printf 'time [s],y [N]\\\\n0,0\\\\n1,%s\\\\n2,{a}\\\\n' {a} >run.csv"]
[[parameter]]
name = "a"
low = 1.0
high = 3.0
[[result]]
name = "y"
file = "run.csv"
column = "y"
[[result]]
name = "twice"
expression = "y + a"
"""


def write(folder: Path, text: str = SQUARE, **swaps: str) -> Path:
    """Write a study and its base folder; return the study file."""
    (folder / "base").mkdir(exist_ok=True)
    (folder / "base/grains.nml").write_text(DECK)
    for old, new in swaps.items():
        text = text.replace(f"@{old}", new)
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"


def rows_of(folder: Path) -> list[dict]:
    """Return the rows of the table of a study."""
    lines = (folder / "study_results/results.csv").read_text().splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def test_sobol_sequence_is_even():
    """Each column has one point in each of 2^m slices; the first points are the published ones."""
    for rng in (None, np.random.default_rng(1)):
        points = sobol_points(64, MOST_COLUMNS, rng)
        for column in points.T:
            assert sorted(np.floor(64 * column)) == list(range(64))
    first = [[0, 0, 0], [0.5, 0.5, 0.5], [0.75, 0.25, 0.25], [0.25, 0.75, 0.75],
             [0.375, 0.375, 0.625]]  # fmt: skip
    assert np.array_equal(sobol_points(5, 3, None), first)
    squares = np.floor(8 * sobol_points(64, 2, None)).astype(int)
    assert len({tuple(row) for row in squares}) == 64


def test_latin_hypercube():
    """One point in each slice of each axis."""
    points = latin_points(17, 3, np.random.default_rng(2))
    for column in points.T:
        assert sorted(np.floor(17 * column)) == list(range(17))


def of(**words: object) -> object:
    """Return a parameter of these words."""
    return read_parameter({"name": "p"} | words, "here")


def test_distributions():
    """Quantiles of each distribution; bells are cut at low and high."""
    assert of(low=2.0, high=6.0).at(0.25) == 3.0
    assert of(distribution="log_uniform", low=1.0, high=100.0).at(0.5) == pytest.approx(10.0)
    whole = of(distribution="integer", low=1, high=4)
    assert [whole.at(s) for s in (0.0, 0.24, 0.25, 0.99, 1.0)] == [1, 1, 2, 4, 4]
    bell = of(distribution="normal", mean=5.0, deviation=2.0)
    assert bell.at(0.5) == pytest.approx(5.0)
    assert bell.at(0.8413447460685429) == pytest.approx(7.0)
    cut = of(distribution="normal", mean=5.0, deviation=2.0, low=4.0)
    assert cut.at(0.0) == pytest.approx(4.0)
    log = of(distribution="log_normal", median=3.0, factor=2.0)
    assert log.at(0.8413447460685429) == pytest.approx(6.0)
    assert [of(values=["a", "b"]).at(s) for s in (0.2, 0.7)] == ["a", "b"]


def test_plans():
    """Grids have every combination, one at a time leaves the base in one parameter each."""
    two = [of(name="p", values=[1, 2]), of(name="q", low=0.0, high=1.0)]
    grid = make_points("grid", 0, 3, 1, two)
    assert [tuple(row.values()) for row in grid] == list(itertools.product([1, 2], [0, 0.5, 1]))
    alone = make_points("one_at_a_time", 0, 3, 1, two)
    assert alone[0] == {"p": 2, "q": 0.5}
    assert alone[1:] == [{"p": 1, "q": 0.5}, {"p": 2, "q": 0.0}, {"p": 2, "q": 1.0}]
    assert make_points("latin", 5, 0, 3, two) == make_points("latin", 5, 0, 3, two)
    assert make_points("latin", 5, 0, 3, two) != make_points("latin", 5, 0, 4, two)


def ishigami(x: np.ndarray) -> np.ndarray:
    """Return Ishigami's function, a = 7, b = 0.1, of shares (n, 3)."""
    x = np.pi * (2.0 * x - 1.0)
    return np.sin(x[:, 0]) * (1.0 + 0.1 * x[:, 2] ** 4) + 7.0 * np.sin(x[:, 1]) ** 2


def test_indices_of_ishigami():
    """Exact indices (Ishigami and Homma 1990) lie within 0.02 and the total ones in confidence.

    0.02 is four times what 4096 rows of random points would scatter by over the root of their
    number, 1/64; points of Sobol scatter less.
    """
    v1, v13, v2 = 0.5 * (1 + 0.1 * np.pi**4 / 5) ** 2, 0.01 * np.pi**8 * (1 / 18 - 1 / 50), 49 / 8
    total = v1 + v2 + v13
    first = np.array([v1, v2, 0.0]) / total
    whole = np.array([v1 + v13, v2, v13]) / total
    values = ishigami(saltelli_shares(4096, 3, np.random.default_rng(5)))
    found = statistics.sobol(values, 3)
    assert np.abs(found["first"] - first).max() < 0.02
    assert np.abs(found["total"] - whole).max() < 0.02
    for kind, exact in (("first", first), ("total", whole)):
        assert (found[f"{kind}_low"] <= exact).all()
        assert (exact <= found[f"{kind}_high"]).all()


def test_failed_rows_are_left_out_of_indices():
    """A failed point takes its whole row away; too few rows have no index."""
    values = ishigami(saltelli_shares(64, 3, np.random.default_rng(5)))
    whole = statistics.sobol(values, 3)
    values[3], values[64 * 4 + 9] = np.nan, np.nan
    assert (whole["rows"], statistics.sobol(values, 3)["rows"]) == (64, 62)
    values[:60] = np.nan
    assert statistics.sobol(values, 3) is None


def test_ranks_and_swings():
    """A monotone result of one parameter has coefficient 1; swings are differences of the table."""
    x = latin_points(100, 2, np.random.default_rng(3))
    found = statistics.regression(x, -np.exp(5.0 * x[:, 0]))
    assert found["rank"] == pytest.approx([-1.0, 0.0], abs=1e-12)
    assert list(statistics.ranks(np.array([[2.0], [1.0], [2.0]]))[:, 0]) == [2.5, 1.0, 2.5]
    values = {"p": [2, 1, 3, 2], "q": [0, 0, 0, 5]}
    swings = statistics.swings(values, np.array([10.0, 7.0, 12.0, 30.0]))
    assert swings == {"p": (7.0, 12.0), "q": (10.0, 30.0)}


def test_summary():
    """Mean, standard error and quantiles of the finite values."""
    facts = statistics.summary(np.array([1.0, 2.0, 3.0, np.nan]))
    assert (facts["count"], facts["mean"], facts["quantile_0.5"]) == (3, 2.0, 2.0)
    assert facts["standard_error"] == pytest.approx(1.0 / math.sqrt(3.0))


@pytest.mark.parametrize(
    ("group", "which", "key", "part", "value", "old", "new"),
    [
        ("contact", "1", "friction", 0, 0.25, "friction = 0.5", "friction = 0.25"),
        ("contact", "quartz, steel", "friction", 0, 0.25, "friction = 0.5", "friction = 0.25"),
        ("material", "steel", "young", 0, 1e11, "young = 2.0e11", "young = 100000000000.0"),
        ("run", "", "gravity", 3, -1.6, "0.0, -9.81", "0.0, -1.6"),
        ("run", "", "title", 0, "don't", "'it''s a / test'", "'don''t'"),
        ("contact", "2", "friction", 0, 0.1, "law = 'hertz_mindlin' /",
         "law = 'hertz_mindlin', friction = 0.1 /"),
    ],
)  # fmt: skip
def test_deck_text(group: str, which: str, key: str, part: int, value: object, old: str, new: str):
    """One value changes; comments, quotes and all else stay as they are."""
    kind = "string" if isinstance(value, str) else "real"
    text = deck_text.put(DECK, Target("grains.nml", group, which, key, part), value, kind)
    assert text == DECK.replace(old, new, 1) if group != "run" or part else old not in text
    assert new in text
    assert deck_text.put(text, Target("g", group, which, key, part), value, kind) == text


def test_a_study_runs(tmp_path: Path, capsys: pytest.CaptureFixture):
    """Table, HDF5, statistics, figures and page; a second call runs nothing."""
    path = write(tmp_path, SQUARE + '[[curve]]\nname = "c"\nfile = "run.csv"\nx="time"\ny="y"\n')
    assert main(["study", str(path)]) == 0
    rows = rows_of(tmp_path)
    assert [float(row["y"]) for row in rows] == [1.0, 2.0, 3.0]
    assert [float(row["twice"]) for row in rows] == [2.0, 4.0, 6.0]
    folder = tmp_path / "study_results"
    with h5py.File(folder / "results.h5") as file:
        assert list(file["results/y"]) == [1.0, 2.0, 3.0]
        assert file.attrs["format"] == "talus-study"
        assert "sha256 grains.nml" in file.attrs
    assert json.loads((folder / "statistics.json").read_text())["y"]["summary"]["mean"] == 2.0
    assert {p.name for p in (folder / "figures").glob("*.png")} == {
        "curve_c.png", "scatter_y.png", "scatter_twice.png"}  # fmt: skip
    assert "<h2>Points</h2>" in (folder / "study.html").read_text()
    stamp = (folder / "points/0002/exit").stat().st_mtime_ns
    assert main(["study", str(path)]) == main(["study", str(path), "--status"]) == 0
    assert (folder / "points/0002/exit").stat().st_mtime_ns == stamp
    assert "3 of 3 points are done, 0 of them failed" in capsys.readouterr().out


def test_repeats(tmp_path: Path):
    """Means and deviations over a parameter that repeats points; it has no picture of its own."""
    more = SQUARE.replace("{a} >run.csv", "$(({a} + {seed})) >run.csv").replace(
        "low = 1.0\nhigh = 3.0", "values = [1, 3]"
    )
    more += '[[parameter]]\nname = "seed"\nvalues = [0, 4]\nrepeat = true\n'
    more = more.replace('column = "y"', 'column = "y"\ntake = "max"')
    path = write(tmp_path, more)
    assert main(["study", str(path)]) == 0
    lines = (tmp_path / "study_results/means.csv").read_text().splitlines()
    assert lines[0] == "a,points,y,y_deviation,twice,twice_deviation"
    rows = [[float(v) for v in line.split(",")] for line in lines[1:]]
    # y is a and a + 4: mean a + 2, deviation 4/sqrt(2)
    assert rows == [pytest.approx([1, 2, 3, 8**0.5, 4, 8**0.5]),
                    pytest.approx([3, 2, 5, 8**0.5, 8, 8**0.5])]  # fmt: skip
    assert "Means over seed" in (tmp_path / "study_results/study.html").read_text()
    study = read_study(path)
    store = Store(study.output)
    assert store.load()
    table = collect(study, store)
    ax = scatter(study, table, 0).axes
    assert [a.get_xlabel() for a in ax] == ["a"]


def test_a_curve_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture):
    """The table is there, and the hint says how to go on without a run."""
    path = write(tmp_path, SQUARE + '[[curve]]\nname = "c"\nfile = "run.csv"\nx="time"\ny="z"\n')
    assert main(["study", str(path)]) == 1
    said = capsys.readouterr().err
    assert "E590" in said and "results.csv is written" in said and "--collect" in said
    path.write_text(path.read_text().replace('y="z"', 'y="y"'))
    assert main(["study", str(path), "--collect"]) == 0


def test_keys_of_decks(tmp_path: Path):
    """Values reach the decks of the points; the base stays as it was."""
    more = 'deck = "grains.nml"\nkey = "material[quartz].young"\n[[result]]'
    text = SQUARE.replace("[[result]]", more, 1).replace("low = 1.0", "low = 1.0e6")
    path = write(tmp_path, text.replace("high = 3.0", "high = 3.0e6"))
    assert main(["study", str(path)]) == 0
    deck = (tmp_path / "study_results/points/0003/grains.nml").read_text()
    assert "young = 3000000.0, poisson = 0.25" in deck
    assert "young = 2.0e11" in deck
    assert (tmp_path / "base/grains.nml").read_text() == DECK


def test_failed_points_stay(tmp_path: Path, capsys: pytest.CaptureFixture):
    """A failed point has code and message; the others are evaluated; --again runs it anew."""
    extra = "[ {a} != 2.0 ] || [ -e ../../../mended ] || { echo error D011: no; exit 7; }"
    text = SQUARE.replace("commands = [", f'commands = ["{extra}", ')
    path = write(tmp_path, text)
    assert main(["study", str(path)]) == 2
    assert "point 2: exit code 7: error D011: no" in capsys.readouterr().err
    row = rows_of(tmp_path)[1]
    assert (row["state"], row["exit_code"], row["y"]) == ("failed", "7", "nan")
    (tmp_path / "mended").touch()
    assert main(["study", str(path)]) == 2
    assert main(["study", str(path), "--again"]) == 0
    assert [row["state"] for row in rows_of(tmp_path)] == ["finished"] * 3


def test_limit(tmp_path: Path):
    """A point that runs past its limit is ended with all its processes and kept as failed."""
    text = SQUARE.replace("commands = [", 'commands = ["[ {a} != 2.0 ] || sleep 60", ')
    path = write(tmp_path, text + "[run]\nlimit = 0.5\n")
    start = time.monotonic()
    assert main(["study", str(path)]) == 2
    assert time.monotonic() - start < 30.0
    row = rows_of(tmp_path)[1]
    assert (row["exit_code"], row["message"]) == ("124", "error: it ran past the limit of 0.5 s")


def test_kills(tmp_path: Path):
    """Killed at random moments nothing is lost, and no command comes to its end twice."""
    log = tmp_path / "log"
    text = SQUARE.replace("levels = 3", "levels = 16").replace(
        "commands = [", f"commands = [\"sleep 0.1\", \"echo {{point}} >>'{log}'\", ")  # fmt: skip
    path = write(tmp_path, text + "[run]\ncores = 2\n")
    rng, kills = np.random.default_rng(), 0
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    for _ in range(60):
        command = [sys.executable, "-m", "talus", "study", str(path)]
        run = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL)
        try:
            code = run.wait(rng.uniform(0.15, 0.9) if kills < 4 else 60.0)
            break
        except subprocess.TimeoutExpired:
            run.send_signal(signal.SIGKILL)
            run.wait()
            kills += 1
    assert (code, kills >= 1) == (0, True)
    assert [float(row["y"]) for row in rows_of(tmp_path)] == list(np.linspace(1.0, 3.0, 16))
    assert sorted(map(int, log.read_text().split())) == list(range(1, 17))


@pytest.mark.parametrize(("scheduler", "submit", "index"), [
    ("slurm", "sbatch", "SLURM_ARRAY_TASK_ID"), ("pbs", "qsub", "PBS_ARRAY_INDEX")])  # fmt: skip
def test_schedulers(scheduler: str, submit: str, index: str, tmp_path: Path,
                    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture):  # fmt: skip
    """Arrays hold the points that are left; a stand-in for the scheduler runs them."""
    path = write(tmp_path, SQUARE + f'[run]\nscheduler = "{scheduler}"\noptions = ["--own=1"]\n')
    (tmp_path / "bin").mkdir()
    tool = tmp_path / "bin" / submit
    tool.write_text(f'#!/bin/sh\nfor i in 1 2 3; do {index}=$i sh "$1"; done\necho job 77\n')
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:/usr/bin:/bin")
    assert main(["study", str(path)]) == 0
    assert f"submit: {submit}" in capsys.readouterr().out
    text = (tmp_path / "study_results/jobs/array_001.sh").read_text()
    assert ("--array=1-3%50" if scheduler == "slurm" else "-J 1-3%50") in text
    assert "--own=1" in text
    tool.chmod(0o755)
    assert main(["study", str(path)]) == 0
    assert main(["study", str(path), "--collect"]) == 0
    assert [float(row["y"]) for row in rows_of(tmp_path)] == [1.0, 2.0, 3.0]
    assert main(["study", str(path)]) == 0
    assert "every point has finished" in capsys.readouterr().out
    asked = tmp_path / "bin" / ("squeue" if scheduler == "slurm" else "qstat")
    asked.write_text("#!/bin/sh\necho job 77\n")
    asked.chmod(0o755)
    assert main(["study", str(path)]) == 1
    assert "jobs of this study are in the queue: 77" in capsys.readouterr().err


NEW = '[[parameter]]\nname = "b"\n'
OF_DECK = 'deck = "grains.nml"\nkey = '
T_END = f'{OF_DECK}"run.t_end"\n'


@pytest.mark.parametrize(
    ("old", "new", "code", "text"),
    [
        ('plan = "grid"', 'plam = "grid"', "E580", "did you mean 'plan'?"),
        ("levels = 3", "levels = 'x'", "E580", "levels = 'x' is no int"),
        ('column = "y"', "", "E580", "a column, a json key or an expression"),
        ("low = 1.0", f'{OF_DECK}"contact[1].frictoin"\nlow = 1.0', "E581", "'friction'?"),
        ("low = 1.0", f'{OF_DECK}"run.gravity"\nlow = 1.0', "E581", "run.gravity(1)"),
        ("low = 1.0", f'{OF_DECK}"material[steel].poisson"\nlow = 0.1', "E582", "out of its range"),
        ("low = 1.0\nhigh = 3.0", f'{OF_DECK}"contact[1].law"\nvalues = ["hertz"]', "E582",
         "law cannot be 'hertz'"),
        ("[[result]]", f"{T_END}{NEW}low=1\nhigh=2\n{T_END}[[result]]", "E583",
         "two parameters change t_end"),
        ('name = "twice"', 'name = "y"', "E583", "the name 'y' is there twice"),
        ("low = 1.0", "low = 4.0", "E584", "low = 4 is not below high = 3"),
        ("low = 1.0", 'distribution = "unform"\nlow = 1.0', "E584", "did you mean 'uniform'?"),
        ('plan = "grid"', 'plan = "gird"', "E585", "did you mean 'grid'?"),
        ('plan = "grid"', 'plan = "saltelli"\npoints = 12', "E585", "8 or 16"),
        ('plan = "grid"', 'plan = "grid"\nmost = 2', "E586", "the plan has 3 points"),
        ('base = "base"', 'base = "bass"', "E589", "no base folder"),
        ("low = 1.0", 'deck = "grain.nml"\nkey = "run.t_end"\nlow = 1.0', "E589", "'grains.nml'?"),
        ("low = 1.0", f'{OF_DECK}"contact.friction"\nlow = 1.0', "E589", "2 groups &contact"),
        ('column = "y"', 'column = "yy"', "E590", "did you mean 'y'?"),
        ('file = "run.csv"', 'file = "rum.csv"', "E590", "did you mean 'run.csv'?"),
        ('column = "y"', 'column = "y"\nfrom = 5', "E590", "it has 0 to 2"),
        ('"y + a"', '"y + aa"', "E591", "an unknown name 'aa'"),
        ('"y + a"', "\"open('x')\"", "E591", "calls what is no function"),
        ('"y + a"', '"y.__class__"', "E591", "Attribute is not allowed"),
        ("{a} >run", "{b} >run", "E592", "no parameter 'b'"),
        ("[[result]]", f"{NEW}low = 1\nhigh = 2\n[[result]]", "E592", "'b' is used nowhere"),
        ("[[result]]", '[run]\nscheduler = "slrum"\n[[result]]', "E593", "did you mean 'slurm'?"),
        ('commands = [', 'commands = ["exit 3", ', "E595", "every one of the 3 points failed"),
    ],
)  # fmt: skip
def test_faults(old: str, new: str, code: str, text: str, tmp_path: Path,
                capsys: pytest.CaptureFixture):  # fmt: skip
    """Each fault has its code and says what is wrong."""
    assert old in SQUARE
    assert main(["study", str(write(tmp_path, SQUARE.replace(old, new, 1)))]) in (1, 2)
    said = capsys.readouterr().err
    assert f"error {code}:" in said
    assert text in said


def test_faults_of_the_folder(tmp_path: Path, capsys: pytest.CaptureFixture):
    """Nothing begun (E594), a changed study (E587), two drivers (E588)."""
    path = write(tmp_path)
    assert main(["study", str(path), "--collect"]) == 1
    assert "error E594" in capsys.readouterr().err
    assert main(["study", str(path)]) == 0
    path.write_text(SQUARE.replace('"y + a"', '"y * a"'))
    assert main(["study", str(path), "--collect"]) == 0
    assert float(rows_of(tmp_path)[2]["twice"]) == 9.0
    path.write_text(SQUARE.replace("high = 3.0", "high = 4.0"))
    assert main(["study", str(path)]) == 1
    assert "error E587" in capsys.readouterr().err
    path.write_text(SQUARE)
    (tmp_path / "base/grains.nml").write_text(DECK + "\n")
    assert main(["study", str(path)]) == 1
    assert "error E587" in capsys.readouterr().err


def test_two_drivers(tmp_path: Path, capsys: pytest.CaptureFixture):
    """The second driver of a folder is refused."""
    from talus.study.folders import lock_file

    path = write(tmp_path)
    held = lock_file(tmp_path / "study_results/driver.lock")
    assert main(["study", str(path)]) == 4
    os.close(held)
    assert "error E588" in capsys.readouterr().err
    with pytest.raises(FaultError, match="largest number is 20"):
        sobol_points(4, 21, None)


def test_plan_prints(tmp_path: Path, capsys: pytest.CaptureFixture):
    """--plan prints the points and runs nothing."""
    assert main(["study", str(write(tmp_path)), "--plan"]) == 0
    assert capsys.readouterr().out == "point,a\n1,1.0\n2,2.0\n3,3.0\n"
    assert not (tmp_path / "study_results").exists()
