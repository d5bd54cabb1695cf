"""Two tiles in one bed: elements wake the one of their density; where both meet who fits wakes."""

from pathlib import Path

import numpy as np
import pytest
from opened_column import SOLID, WIDE, D, write
from test_adapt import check_restarts, run

from talus.checksum import edited
from talus.mesh import box, write_mesh
from talus.packing import read_packing, write_h5
from talus.programs import find_program
from talus.verification import field_steps, read_history, start_on_ranks

STAMP = {"young": 1.0e9, "poisson": 0.25, "density": 2650.0, "friction": 0.5,
         "making_friction": 0.2, "mean_wanted": 1.0, "solid_fraction": 0.52}  # fmt: skip
LOOSE = 0.999  # of the radii
MORE = ", rest_steps = 200"
HIGH = 16  # tiles


def write_library(folder: Path, more: str = MORE, strain: float = 0.0) -> int:
    """Write the column with a denser lower and a looser upper half; return the id between both."""
    write(folder, more)
    tile = read_packing(folder / "tile.h5")
    tile.axes = LOOSE * tile.axes
    write_h5(folder / "loose.h5", tile)
    for name in ("tile.h5", "loose.h5"):
        with edited(folder / name) as file:
            attributes = file.create_group("tile").attrs
            for key, value in STAMP.items():
                attributes[key] = value
    rows = (folder / "grains.nml").read_text().splitlines()
    k = next(k for k, row in enumerate(rows) if row.startswith("&tile"))
    rows[k] = rows[k].replace(" /", ", plastic_strain = 0.0 /")
    rows.insert(k + 1, rows[k].replace("tile.h5", "loose.h5").replace("0.0 /", f"{strain} /"))
    (folder / "grains.nml").write_text("\n".join(rows) + "\n")
    mesh = box(np.zeros(3), np.array([WIDE, WIDE, 2 * D * HIGH]), (1, 1, HIGH))
    mesh.volumes |= {"low": np.arange(HIGH // 2), "high": np.arange(HIGH // 2, HIGH)}
    write_mesh(folder / "bar.h5", mesh)
    mass = [2650.0 * 4.0 / 3.0 * np.pi * (part * 0.5 * D * 1.001) ** 3 for part in (1.0, LOOSE)]
    low, high = (repr(float(8.0 * m / (WIDE**2 * 2.0 * D))) for m in mass)
    text = SOLID.replace("1388.0", low).replace("group = 'all'", "group = 'low'")
    other = f"id = 'other', density = {high}, young = 1.0e8, poisson = 0.0"
    text += f"&material {other} /\n&section group = 'high', material = 'other' /\n"
    (folder / "solid.nml").write_text(text)
    return tile.count * HIGH


def test_each_half_wakes_its_own(tmp_path: Path) -> None:
    """By density; within the band beside the border grains of both are chosen from."""
    between = write_library(tmp_path)
    done = run(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = read_history(tmp_path / "coupled_conversions.csv")
    assert rows["guests"].sum() + rows["lost"].sum() < 25
    last = field_steps(tmp_path / "grains.h5")[-1].grains
    border, band = D * HIGH, 1.5 * 1.01 * D
    off = np.abs(last["x"][:, 2] - border) > band + 0.5 * D
    upper = last["x"][:, 2] > border
    assert (upper & off).sum() >= 8
    assert np.array_equal(last["id"][off] > between, upper[off])
    place = np.round(last["x"] / (0.5 * D)).astype(int)
    assert len(np.unique(place, axis=0)) == len(place)  # one grain in each place


def test_a_restart_has_the_same_bits(tmp_path: Path) -> None:
    """From checkpoints before and after both tiles meet."""
    write_library(tmp_path)
    check_restarts(tmp_path)


@pytest.mark.parametrize("how", ["threads", "ranks"])
def test_it_has_the_same_bits(how: str, tmp_path: Path) -> None:
    """On two threads or ranks of the grains."""
    write_library(tmp_path)
    assert run(tmp_path).returncode == 0
    one = (tmp_path / "coupled_audit.csv").read_bytes()
    deck = tmp_path / "coupled.nml"
    if how == "threads":
        deck.write_text(deck.read_text().replace("grains.nml', threads = 1",
                                                 "grains.nml', threads = 2"))  # fmt: skip
    else:
        start_on_ranks(deck, "grains", 2, find_program("talus-dem"))
    done = run(tmp_path)
    assert done.returncode == 0, done.stdout
    assert (tmp_path / "coupled_audit.csv").read_bytes() == one


def test_what_does_not_go_with_several_tiles(tmp_path: Path) -> None:
    """D483, D484 refused; W436 told."""
    cases = [
        (", birth = 'replay'", 0.0, 1, "error D483"),
        (", close_behind = 3.0e-3", 0.0, 1, "error D483"),
        (MORE, 0.1, 1, "error D484"),
        ("", 0.0, 0, "W436"),
    ]
    for k, (more, strain, code, text) in enumerate(cases):
        folder = tmp_path / str(k)
        folder.mkdir()
        write_library(folder, more, strain)
        done = run(folder)
        assert done.returncode == code, done.stdout + done.stderr
        assert text in done.stdout + done.stderr
