"""Grains of a bed of tiles that sleep: waking them gives what the whole bed has there."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from bed_asker import Bed
from channel import COUNT, HEAD, make_tile

from talus.packing import Packing, read_packing
from talus.programs import find_program


def run(folder: Path, name: str, packing: str, t_end: float, *parts: str) -> None:
    """Run a deck of these groups."""
    text = HEAD.replace("T_END", str(t_end)).replace("PACKING", packing) + "".join(parts)
    (folder / f"{name}.nml").write_text(text)
    command = [str(find_program("talus-dem")), f"{name}.nml", "--threads=1"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="module")
def tile(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Packing]:
    """Return a folder with a tile at rest, and the tile."""
    folder = tmp_path_factory.mktemp("bed")
    make_tile(folder, run)
    return folder, read_packing(folder / "tile.h5")


@pytest.fixture
def begin(tile: tuple[Path, Packing]) -> "object":
    """Give a way to start talus-dem; what still runs is killed."""
    here, started = Path.cwd(), []

    def start(packing: Packing) -> Bed:
        text = HEAD.replace("T_END", "1.0").replace("PACKING", "awake")
        text += "&tile file = 'tile.h5', copies = 5, 1, 1 /\n&dynamics dt = 2.0e-6 /\n"
        started.append(Bed(tile[0], packing, text))
        return started[-1]

    yield start
    os.chdir(here)
    for bed in started:
        bed.process.kill()
        bed.process.wait()


def test_sleeping_grains_stand_where_the_whole_bed_has_them(
    tile: tuple[Path, Packing], begin: object
) -> None:
    """Ids and places of what sleeps are those of `talus pack edit --repeat`."""
    whole = tile[1].repeated((5, 1, 1))
    bed = begin(tile[1].repeated((3, 1, 1)))
    asleep = bed.ask("DESCRIBE", what="asleep").fields
    assert np.array_equal(asleep["id"], whole.id[3 * COUNT :])
    assert np.abs(asleep["x"] - whole.x[3 * COUNT :]).max() < 1e-12
    bed.ask("STOP")
    assert bed.process.wait(60) == 0


def test_what_wakes_has_the_contacts_of_the_whole_bed(
    tile: tuple[Path, Packing], begin: object
) -> None:
    """Woken one after the other in two parts grains have the forces of the bed of five tiles."""
    whole = begin(tile[1].repeated((5, 1, 1)))
    forces = whole.contacts()
    whole.ask("STOP")
    assert whole.process.wait(60) == 0
    bed = begin(tile[1].repeated((3, 1, 1)))
    ids = bed.ask("DESCRIBE", what="asleep").fields["id"]
    part = ids[np.random.default_rng(3).uniform(size=len(ids)) < 0.5]
    bed.ask("WAKE", id=part)
    bed.ask("WAKE", id=np.setdiff1d(ids, part))
    found = bed.contacts()
    assert set(found) == set(forces)
    most = max(np.abs(force).max() for force in forces.values())
    assert max(np.abs(found[key] - forces[key]).max() for key in forces) < 1e-6 * most
    bed.ask("READY")
    bed.ask("STOP")
    assert bed.process.wait(60) == 0


def test_loads_do_not_outlive_their_sets(tile: tuple[Path, Packing], begin: object) -> None:
    """After a conversion no force acts on a grain that the partner does not name again."""
    bed = begin(tile[1].repeated((3, 1, 1)))
    last = int(3 * COUNT)

    def pushed() -> float:
        bed.ask("SELECT", set="one", role="report", id=[last], fields="v")
        bed.ask("READY")
        one = bed.ask("KICK_DRIFT", kick=0.0, drift=0.0).fields["one.v"]
        two = bed.ask("KICK_DRIFT", kick=1.0e-6, drift=0.0).fields["one.v"]
        return float((two - one)[0, 0])

    alone = pushed()
    bed.ask("SELECT", set="load", role="load", id=[last], fields="none")
    bed.ask("READY")
    bed.ask("KICK_DRIFT", kick=1.0e-6, drift=0.0, load__force=np.array([[5.0, 0.0, 0.0]]))
    bed.ask("SET", what="kind", id=[1], kind=[3])
    assert abs(pushed() - alone) < 1e-3 * abs(alone) + 1e-9
    bed.ask("STOP")
