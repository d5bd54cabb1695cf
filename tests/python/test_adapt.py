"""Elements that are opened before a body: exact at rest, the same bits after a restart, bounded."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from talus.mesh import box, write_mesh
from talus.packing import make_packing, write_h5
from talus.programs import find_program
from talus.verification import field_steps, read_history

D, HIGH = 1.0e-3, 16  # diameter, elements of the column [m]
WIDE = 2.02e-3  # of the column: spheres touch above one another, not side by side [m]
OVERLAP = 1.0e-3  # of the spheres, over their radius
COUPLED = """&run     title = 'Opened column', t_end = 1.2e-4, gravity = 0.0, 0.0, 0.0 /
&program side = 'grains', deck = 'grains.nml', threads = 1 /
&program side = 'solid', deck = 'solid.nml', threads = 1 /
&clock   exchange = 1.0e-6 /
&overlap free_elements = 'adapt', ghost_elements = 'adapt', partition = 'share', initial = 'dead_load' /
&adapt   centre = 1.0e-3, 1.0e-3, 6.0e-3, half = 1.0e-3, 1.0e-3, 1.0e-3, velocity = 0.0, 0.0, 100.0, free_within = 3.0e-3,
         every_time = 1.0e-5 MORE /
&checkpoint every_time = 2.5e-5, keep = 9 /
"""  # noqa: E501
GRAINS = """&run       title = 'Column of spheres', gravity = 0.0, 0.0, 0.0 /
&material  id = 'quartz', density = 2650.0, young = 1.0e9, poisson = 0.25 /
&contact   between = 'quartz', 'quartz', law = 'hertz_mindlin', friction = 0.5, damping_ratio = 0.05 /
&particles file = 'packing.h5', material = 'quartz' /
&tile      file = 'tile.h5', copies = 1, 1, COPIES /
&wall      id = 'x0', point = 0.0, 0.0, 0.0, normal = 1.0, 0.0, 0.0, material = 'quartz' /
&wall      id = 'x1', point = 2.02e-3, 0.0, 0.0, normal = -1.0, 0.0, 0.0, material = 'quartz' /
&wall      id = 'y0', point = 0.0, 0.0, 0.0, normal = 0.0, 1.0, 0.0, material = 'quartz' /
&wall      id = 'y1', point = 0.0, 2.02e-3, 0.0, normal = 0.0, -1.0, 0.0, material = 'quartz' /
&dynamics  dt = 2.0e-7 /
&output    every_time = 4.0e-5 /
"""  # noqa: E501
SOLID = """&run      title = 'Bar', gravity = 0.0, 0.0, 0.0 /
&mesh     file = 'bar.h5' /
&material id = 'soil', density = 1388.0, young = 1.0e8, poisson = 0.0 /
&section  group = 'all', material = 'soil' /
&support  group = 'z0', fix = 'x', 'y', 'z' /
&support  group = 'z1', fix = 'x', 'y', 'z' /
&analysis kind = 'explicit' /
"""


def spheres(layers: range) -> np.ndarray:
    """Return the centres of layers of a square column of spheres."""
    line = 0.5 * WIDE * (np.arange(2) + 0.5)
    return np.array([(a, b, D * (k + 0.5)) for k in layers for b in line for a in line])


def write(folder: Path, more: str = "") -> None:
    """Write the column: a tile of two layers, some awake, a mesh of an element a tile."""
    radius = 0.5 * D * (1.0 + OVERLAP)
    tile = make_packing(spheres(range(2)), np.full((8, 3), radius))
    tile.cell, tile.corner = np.diag([WIDE, WIDE, 2.0 * D]), np.zeros(3)
    tile.pairs = np.array([[i, i + 4] for i in range(1, 5)] * 2)
    tile.shift = np.repeat(np.array([[0, 0, 0], [0, 0, -1]], dtype=np.int32), 4, axis=0)
    tile.tangential = np.zeros((8, 3))
    write_h5(folder / "tile.h5", tile)
    bed = tile.repeated((1, 1, HIGH))
    bed.cell = bed.corner = bed.shift = None
    write_h5(folder / "packing.h5", bed.take(np.arange(8, 56)))
    size = np.array([WIDE, WIDE, 2 * D * HIGH])
    write_mesh(folder / "bar.h5", box(np.zeros(3), size, (1, 1, HIGH)))
    (folder / "coupled.nml").write_text(COUPLED.replace("MORE", more))
    (folder / "grains.nml").write_text(GRAINS.replace("COPIES", str(HIGH)))
    (folder / "solid.nml").write_text(SOLID)


def run(folder: Path, *words: str) -> subprocess.CompletedProcess:
    """Run talus-couple."""
    command = [str(find_program("talus-couple")), "coupled.nml", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


def test_a_column_at_rest_does_not_notice(tmp_path: Path) -> None:
    """Grains wake and ghosts become free; nothing moves, and all have the contacts of the bed."""
    write(tmp_path)
    done = run(tmp_path)
    assert done.returncode == 0, done.stdout
    rows = read_history(tmp_path / "coupled_conversions.csv")
    assert len(rows["time"]) > 4 and rows["woken"].sum() >= 32 and rows["freed"].sum() >= 32
    assert rows["awake"][-1] == rows["awake"][0] + rows["woken"].sum()
    audit = read_history(tmp_path / "coupled_audit.csv")
    assert audit["grains_kinetic"].max() < 1e-12 * audit["grains_elastic"][-1]
    assert np.abs(audit["total_energy"] - audit["conversion_energy"]
                  - audit["total_energy"][0]).max() < 1e-9 * audit["total_energy"][-1]  # fmt: skip
    last = field_steps(tmp_path / "grains.h5")[-1].grains
    row, copy = (last["id"] - 1) % 8, (last["id"] - 1) // 8
    x = spheres(range(2))[row] + copy[:, None] * np.array([0.0, 0.0, 2.0 * D])
    assert np.abs(last["x"] - x).max() < 1e-9 * D


def test_a_restart_has_the_same_bits(tmp_path: Path) -> None:
    """From every checkpoint, before and between conversions."""
    write(tmp_path, ", keep_behind = 4.0e-3, hold_behind = 1.0e-3")
    assert run(tmp_path).returncode == 0
    names = ("coupled_audit.csv", "grains_energy.csv")
    whole = {name: (tmp_path / name).read_bytes() for name in names if (tmp_path / name).exists()}
    assert read_history(tmp_path / "coupled_conversions.csv")["left"].sum() > 0
    manifests = sorted(tmp_path.glob("coupled.[0-9]*.manifest"))
    assert len(manifests) >= 3
    for manifest in manifests[:3]:
        done = run(tmp_path, f"--restart={manifest.name}")
        assert done.returncode == 0, done.stdout
        for name, content in whole.items():
            assert (tmp_path / name).read_bytes() == content, (manifest.name, name)


def test_no_more_grains_wake_than_allowed(tmp_path: Path) -> None:
    """N463, after the last checkpoint."""
    write(tmp_path, ", most_grains = 70")
    done = run(tmp_path)
    assert done.returncode == 2
    assert "error N463" in done.stderr and "more than most_grains = 70" in done.stderr


@pytest.mark.parametrize("steps", [0, 400])
def test_new_free_grains_come_to_rest(steps: int, tmp_path: Path) -> None:
    """With rest_steps they do; where they are at rest no step is taken."""
    write(tmp_path, f", rest_steps = {steps}" if steps else "")
    assert run(tmp_path).returncode == 0
    rows = read_history(tmp_path / "coupled_conversions.csv")
    assert rows["rest_steps"].max() == 0 and rows["unbalanced"].max() < 1e-9
