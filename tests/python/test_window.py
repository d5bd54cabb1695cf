"""A window that goes with a body: waking copies of a tile is exact, the same bits everywhere."""

import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
from channel import COUNT, HEAD, LENGTH, WIDTH, make_tile

from talus.packing import read_packing, write_h5
from talus.programs import find_program
from talus.verification import field_steps, launcher, read_history

WINDOW = """&window surface = 'bar', tile = 'tile.h5', behind = 0.05, ahead = 0.05, hold = 8.0e-3,
  moved = 4.0, every_time = 2.0e-3 /
&dynamics dt_factor = 0.3 /
&history every_time = 2.0e-3 /
&output every_time = 5.0e-2, fields = 'velocity', 'contacts', packing = 'end.h5' /
"""
STORE = "&checkpoint every_time = 5.0e-2, keep = 9 /\n"


def bar(height: float) -> str:
    """Return a bar across the bed that travels along x."""
    return (
        f"&cylinder id = 'bar', side = 'outside', centre = 0.08, {0.5 * WIDTH}, {height}, "
        f"axis = 0.0, 1.0, 0.0, radius = 4.0e-3, length = {2.0 * WIDTH}, velocity = 0.5, 0.0, 0.0, "
        "material = 'grain' /\n"
    )


def run(
    folder: Path, name: str, packing: str, t_end: float, *parts: str, ranks: int = 1,
    words: tuple[str, ...] = (),
) -> str:  # fmt: skip
    """Run a deck of these groups; return what is printed."""
    text = HEAD.replace("T_END", str(t_end)).replace("PACKING", packing) + "".join(parts)
    (folder / f"{name}.nml").write_text(text)
    first = launcher(ranks) if ranks > 1 else []
    command = [*first, str(find_program("talus-dem")), f"{name}.nml", "--threads=1", *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a tile at rest and a bed of five of them."""
    folder = tmp_path_factory.mktemp("window")
    make_tile(folder, run)
    write_h5(folder / "bed.h5", read_packing(folder / "tile.h5").repeated((5, 1, 1)))
    return folder


def contents(path: Path) -> dict[str, bytes]:
    """Return all datasets of a file as bytes."""
    found: dict[str, bytes] = {}

    def keep(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset):
            found[name] = item[()].tobytes()

    with h5py.File(path) as file:
        file.visititems(keep)
    return found


def test_a_bed_at_rest_does_not_notice(folder: Path) -> None:
    """Under a window that passes over it the bed stays at rest: same contacts, forces, energy."""
    text = run(folder, "over", "bed", 0.2, bar(0.2), WINDOW)
    rows = read_history(folder / "over_window.csv")
    energy = read_history(folder / "over_energy.csv")
    assert rows["front"][-1] - rows["front"][0] == 3
    assert rows["rear"][-1] - rows["rear"][0] == 4
    assert rows["entered"][-1] == 3 * COUNT and rows["left"][-1] == 4 * COUNT
    assert "window: copies 4 to 7" in text
    elastic = energy["elastic"][0]
    copies = rows["front"] - rows["rear"] + 1.0
    for count in (4.0, 5.0):
        alike = energy["elastic"][copies == count]
        assert np.abs(alike / alike[0] - 1.0).max() < 1e-6
        assert len(set(energy["contacts"][copies == count])) == 1
    assert energy["kinetic"].max() < 1e-12 * elastic
    assert energy["friction"][-1] < 1e-9 * elastic
    one = elastic - energy["elastic"][copies == 4.0][0]
    assert energy["entered"][-1] == pytest.approx(3.0 * one, rel=1e-6)
    gone = energy["left"][-1] - energy["left"][0]  # contacts of held grains went at the start
    assert gone == pytest.approx(4.0 * one, rel=1e-6)
    assert rows["moved"].max() < 1e-9
    last = field_steps(folder / "over.h5")[-1].grains
    tile = read_packing(folder / "tile.h5")
    copy, row = np.divmod(last["id"] - 1, COUNT)
    order = np.argsort(tile.id)
    x = tile.x[order][row] + copy[:, None] * [LENGTH, 0.0, 0.0]
    assert sorted(set(copy.tolist())) == [4, 5, 6, 7]
    assert np.abs(last["x"] - x).max() < 1e-9


def test_without_the_forces_of_contacts_it_would(folder: Path) -> None:
    """What the last test sees is there to be seen: a tile without tangential forces moves."""
    bare = read_packing(folder / "tile.h5")
    bare.tangential = 0.0 * bare.tangential
    other = folder / "bare"
    other.mkdir()
    write_h5(other / "tile.h5", bare)
    (other / "bed.h5").write_bytes((folder / "bed.h5").read_bytes())
    run(other, "over", "bed", 0.1, bar(0.2), WINDOW)
    energy = read_history(other / "over_energy.csv")
    assert energy["kinetic"].max() > 1e-6 * energy["elastic"][0]


def test_ranks_and_restarts_give_the_same_bits(folder: Path) -> None:
    """With a bar in the bed fields are the same on ranks, and goes on from a checkpoint, too."""
    bed = read_packing(folder / "bed.h5")
    away = np.hypot(bed.x[:, 0] - 0.08, bed.x[:, 2] - 0.02)
    write_h5(folder / "bored.h5", bed.take(away > 4.0e-3 + bed.axes[:, 0]))
    parts = (bar(0.02), WINDOW, STORE)
    run(folder, "drag", "bored", 0.2, *parts)
    rows = read_history(folder / "drag_window.csv")
    assert rows["front"][-1] > rows["front"][0] and rows["rear"][-1] > rows["rear"][0]
    energy = read_history(folder / "drag_energy.csv")
    assert np.abs(energy["relative_closure"]).max() < 5e-3
    assert read_history(folder / "drag_surfaces.csv")["force_x"][20:].mean() < -0.01
    fields, end = contents(folder / "drag.h5"), contents(folder / "end.h5")
    sorted(folder.glob("drag.chk.*.h5"))[-1].rename(folder / "part.h5")
    run(folder, "drag", "bored", 0.2, *parts, ranks=2)
    assert contents(folder / "drag.h5") == fields
    run(folder, "drag", "bored", 0.2, *parts, words=("--restart=part.h5",))
    assert contents(folder / "end.h5") == end
    run(folder, "drag", "bored", 0.2, *parts, words=("--restart=part.h5",), ranks=2)
    assert contents(folder / "end.h5") == end
