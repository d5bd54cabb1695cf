"""Grains that wake after a history of strain: the tile has gone through it."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from bed_asker import Asker, Bed
from sphere_tile import sphere_tile

from talus.packing import Packing, read_packing
from talus.programs import find_program
from talus.verification import read_history

HEAD = """&run       title = 'Tile', t_end = 1.0, gravity = 0.0, 0.0, 0.0 /
&material  id = 'grain', density = 2650.0, young = 2.9e8, poisson = 0.25 /
&contact   between = 'grain', 'grain', law = 'hertz_mindlin', friction = 0.5, damping_ratio = 0.05 /
&particles file = 'PACKING.h5', material = 'grain' /
"""
STRETCH = np.array([[0.997, 1.5e-3, 0.0], [1.5e-3, 1.0005, 0.0], [0.0, 0.0, 0.999]])
DIAMETER = 1.9e-3  # [m]


@pytest.fixture(scope="module")
def tile(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Packing]:
    """Return a folder with a tile at rest at one stress, and the tile."""
    made, folder = sphere_tile(tmp_path_factory), tmp_path_factory.mktemp("replay")
    (folder / "tile.h5").write_bytes(made.read_bytes())
    return folder, read_packing(made)


@pytest.fixture
def begin(tile: tuple[Path, Packing]) -> "object":
    """Give a way to start talus-dem; what still runs is killed."""
    here, started = Path.cwd(), []

    def start(more: str = "") -> Bed:
        whole = tile[1].repeated((3, 3, 3)).take(np.array([0]))
        whole.cell = whole.corner = whole.shift = None
        text = HEAD.replace("PACKING", "awake")
        text += f"&tile file = 'tile.h5', copies = 3, 3, 3 {more}/\n&dynamics dt = 2.0e-6 /\n"
        started.append(Bed(tile[0], whole, text))
        return started[-1]

    yield start
    os.chdir(here)
    for bed in started:
        bed.process.kill()
        bed.process.wait()


def strained(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Strain the tile by a deck of its own, to rest; return its stress before and after."""
    rate = 2.6e-3 / (DIAMETER * np.sqrt(2650.0 / 20.0e3))
    change = STRETCH - np.eye(3)
    time = np.linalg.norm(change) / rate
    names = "xyz"
    text = HEAD.replace("PACKING", "tile").replace("t_end = 1.0", f"t_end = {time + 0.04}")
    text += "&cell /\n&curve id = 'on', "
    text += f"times = 0.0, {time}, {time + 1e-9}, 1.0, values = 1.0, 1.0, 0.0, 0.0 /\n"
    for i in range(3):
        for j in range(3):
            if change[i, j] != 0.0:
                text += f"&cell_rate component = '{names[i]}{names[j]}', "
                text += f"rate = {change[i, j] / time}, curve = 'on' /\n"
    text += "&dynamics dt = 2.0e-6, damping = 200.0 /\n"
    text += "&history every_time = 0.01 /\n"
    (folder / "truth.nml").write_text(text)
    command = [str(find_program("talus-dem")), "truth.nml", "--threads=1"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    row = read_history(folder / "truth_cell.csv")
    first, last = (np.array([[row[f"stress_{a}{b}"][k] for b in names] for a in names])
                   for k in (0, -1))  # fmt: skip
    return first, last


def test_what_wakes_after_a_history_is_as_the_strained_tile(
    tile: tuple[Path, Packing], begin: object
) -> None:
    """Its stress is that of a cell strained by its own deck, and of the grains, also turned."""
    folder, pack = tile
    start, truth = strained(folder)
    c, s = np.cos(0.3), np.sin(0.3)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    bed = begin()
    asleep = bed.ask("DESCRIBE", what="asleep").fields
    n = len(asleep["id"])
    x = asleep["x"] @ (turn @ STRETCH).T
    reply = bed.ask("WAKE", id=asleep["id"], x=x,
                    turn=np.tile([np.cos(0.15), 0.0, 0.0, np.sin(0.15)], (n, 1)),
                    history=np.ones(n, dtype=np.int64), knots=np.array([1]),
                    stretch=STRETCH.reshape(1, 9)).fields  # fmt: skip
    replayed, pressure = reply["stress"].reshape(3, 3), reply["pressure"][0]
    found = bed.ask("DESCRIBE", what="contacts").fields
    volume = np.linalg.det(pack.cell) * np.linalg.det(STRETCH)
    grains = bed.ask("DESCRIBE", what="grains").fields
    place = dict(zip(grains["id"].tolist(), grains["x"], strict=True))
    stress = np.zeros((3, 3))
    for (a, b), force in zip(found["ids"].tolist(), found["force"], strict=True):
        share = sum((i - 1) // len(pack.x) == 13 for i in (a, b))
        stress += 0.5 * share * np.outer(place[b] - place[a], force) / volume
    stress = turn.T @ stress @ turn
    scale = np.abs(truth).max()
    assert abs(pressure / 20.0e3 - 1.0) < 0.01
    assert np.abs(truth - start - replayed).max() < 0.01 * scale
    assert np.abs(-stress - start - replayed).max() < 1e-3 * scale
    assert np.abs(replayed).max() > 0.5 * pressure  # it is far from the tile's


def wake_some(bed: Bed, first: int, history: list[np.ndarray]) -> np.ndarray:
    """Wake a few grains after a history; return its stress before and after."""
    ids = np.arange(first, first + 10)
    stretch = np.array(history).reshape(-1, 9)
    reply = bed.ask("WAKE", id=ids, history=np.ones(10, dtype=np.int64),
                    knots=np.array([len(stretch)]), stretch=stretch)  # fmt: skip
    return reply.fields["stress"]


def test_a_history_that_goes_on_has_the_bits_of_a_whole_one(begin: object) -> None:
    """What was followed before is gone on with: the same numbers as from the start."""
    half = 0.5 * (STRETCH + np.eye(3))
    bed = begin()
    wake_some(bed, 100, [half])
    later = wake_some(bed, 200, [half, STRETCH])
    bed.process.kill()
    assert np.array_equal(wake_some(begin(), 200, [half, STRETCH]), later)


def test_histories_that_cannot_be_followed_are_faults(begin: object) -> None:
    """Numbers that do not fit (P266), and a tile that does not rest in the steps allowed (N241)."""
    ask = {"id": np.array([500]), "history": np.array([1]), "stretch": STRETCH.reshape(1, 9)}
    for wrong in ({"knots": np.array([2])}, {"knots": np.array([1]), "history": np.array([2])},
                  {"knots": np.array([1]), "stretch": np.full((1, 9), np.nan)}):  # fmt: skip
        bed = begin()
        reply = Asker.ask(bed, "WAKE", 0.0, 0.0, **{**ask, **wrong})
        assert reply.status != 0
        assert "P266" in str(reply.fields)
        bed.process.kill()
    bed = begin(", replay_steps = 20 ")
    reply = Asker.ask(bed, "WAKE", 0.0, 0.0, **ask, knots=np.array([1]))
    assert reply.status != 0
    assert "N241" in str(reply.fields)
