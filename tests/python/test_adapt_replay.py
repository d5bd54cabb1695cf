"""Grains that wake after the replay of their history in coupled runs: restarts, ranks, faults."""

import subprocess
from pathlib import Path

import numpy as np
import pytest
from opened_column import write as write_column
from sphere_tile import EDGE, sphere_tile

from talus.mesh import box, write_mesh
from talus.packing import read_packing, write_h5
from talus.programs import find_program
from talus.verification import read_history, start_on_ranks

COPIES, CELLS = (4, 2, 2), (10, 5, 5)
MIDDLE = np.array([0.012, 0.012, 0.012])
COUPLED = """&run     title = 'Strained, then opened', t_end = 1.5e-3, gravity = 0.0, 0.0, 0.0 /
&program side = 'grains', deck = 'grains.nml', threads = 1 /
&program side = 'solid', deck = 'solid.nml', threads = 1 /
&clock   exchange = 1.0e-5 /
&overlap free_elements = 'adapt', ghost_elements = 'adapt', partition = 'share', initial = 'dead_load', mass = 'nearest' /
&adapt   centre = 0.012, 0.012, 0.012, half = 1.0e-3, 1.0e-3, 1.0e-3, velocity = 5.0, 0.0, 0.0, free_within = 2.0e-3,
         ghost_layers = 1, every_time = 2.0e-4, birth = 'replay' MORE /
&checkpoint every_time = 5.0e-4, keep = 9 /
"""  # noqa: E501
GRAINS = """&run       title = 'Grains', gravity = 0.0, 0.0, 0.0 /
&material  id = 'grain', density = 2650.0, young = 2.9e8, poisson = 0.25 /
&contact   between = 'grain', 'grain', law = 'hertz_mindlin', friction = 0.5, damping_ratio = 0.05 /
&particles file = 'awake.h5', material = 'grain' /
&tile      file = 'tile.h5', copies = 4, 2, 2 TILE /
&dynamics  dt = 2.0e-6 /
"""
SOLID = """&run      title = 'Solid', gravity = 0.0, 0.0, 0.0 /
&mesh     file = 'bed.h5' /
&material id = 'soil', density = 1590.0, young = 4.0e6, poisson = 0.25 /
&section  group = 'all', material = 'soil' /
&support  group = 'x0', fix = 'x' /
&support  group = 'y0', fix = 'y' /
&support  group = 'y1', fix = 'y' /
&support  group = 'z0', fix = 'z' /
&support  group = 'z1', fix = 'z' /
&curve    id = 'push', times = 0.0, 1.0e-3, 1.0, values = 0.0, 1.0, 1.0 /
&motion   group = 'x1', component = 'x', curve = 'push', scale = -1.0e-4 /
&analysis kind = 'explicit' /
"""


@pytest.fixture(scope="module")
def tile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a tile at rest at one stress."""
    return sphere_tile(tmp_path_factory)


def write(folder: Path, tile: Path, more: str = "", replay: str = "") -> None:
    """Write decks, mesh, tile and the grains that are awake at first."""
    (folder / "tile.h5").write_bytes(tile.read_bytes())
    whole = read_packing(tile).repeated(COPIES)
    bed = whole.take(np.flatnonzero((np.abs(whole.x - MIDDLE) < 0.008).all(1)))
    bed.cell = bed.corner = bed.shift = None
    write_h5(folder / "awake.h5", bed)
    write_mesh(folder / "bed.h5", box(np.zeros(3), EDGE * np.array(COPIES), CELLS))
    (folder / "coupled.nml").write_text(COUPLED.replace("MORE", more))
    (folder / "grains.nml").write_text(GRAINS.replace("TILE", replay))
    (folder / "solid.nml").write_text(SOLID)


def run(folder: Path, *words: str) -> subprocess.CompletedProcess:
    """Run talus-couple."""
    command = [str(find_program("talus-couple")), "coupled.nml", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


def test_a_restart_has_the_same_bits(tile: Path, tmp_path: Path) -> None:
    """From checkpoints between conversions, with histories; on two ranks of the grains alike."""
    write(tmp_path, tile)
    done = run(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = read_history(tmp_path / "coupled_conversions.csv")
    assert rows["replays"].sum() > 3 and rows["woken"].sum() > 100 and rows["freed"].sum() > 10
    assert 0.0 < rows["gap_stress"].max() < 0.5
    names = ("coupled_audit.csv", "coupled_conversions.csv")
    whole = {name: (tmp_path / name).read_bytes() for name in names}
    manifests = sorted(tmp_path.glob("coupled.[0-9]*.manifest"))
    assert len(manifests) >= 2
    for manifest in manifests[:2]:
        done = run(tmp_path, f"--restart={manifest.name}")
        assert done.returncode == 0, done.stdout
        for name, content in whole.items():
            assert (tmp_path / name).read_bytes() == content, (manifest.name, name)
    start_on_ranks(tmp_path / "coupled.nml", "grains", 2, find_program("talus-dem"))
    assert run(tmp_path).returncode == 0
    assert (tmp_path / names[0]).read_bytes() == whole[names[0]]


def test_a_law_far_from_the_grains_ends_the_run(tile: Path, tmp_path: Path) -> None:
    """N462 where the stress of tile and continuum differ by more than allowed."""
    write(tmp_path, tile, ", most_gap = 1.0e-3")
    done = run(tmp_path)
    assert done.returncode == 2
    assert "error N462" in done.stderr and "in element" in done.stderr


def test_a_tile_that_does_not_rest_ends_the_run(tile: Path, tmp_path: Path) -> None:
    """N241 through the port."""
    write(tmp_path, tile, replay=", replay_unbalanced = 1.0e-9, replay_steps = 40")
    done = run(tmp_path)
    assert done.returncode == 2
    assert "error N241" in done.stderr


def test_a_tile_too_small_cannot_be_replayed(tmp_path: Path) -> None:
    """N241: two spheres across; with `'tile'` the same bed runs."""
    write_column(tmp_path, ", birth = 'replay'")
    deck = tmp_path / "solid.nml"
    deck.write_text(deck.read_text().replace("&support  group = 'z1', fix = 'x', 'y', 'z' /", """
&curve    id = 'push', times = 0.0, 1.0, values = 0.0, 1.0 /
&motion   group = 'z1', component = 'z', curve = 'push', scale = -1.0 /
&support  group = 'z1', fix = 'x', 'y' /"""))
    done = run(tmp_path)
    assert done.returncode == 2, done.stdout
    assert "error N241" in done.stderr and "less than two ranges" in done.stderr
