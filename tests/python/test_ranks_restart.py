"""Contacts with laws on top go through a checkpoint of ranks, slab by slab, law by law."""

import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest

from talus.programs import find_program
from talus.verification import launcher, write_packing

RADIUS = 1.0e-3
ROLLING = "rolling_friction = 0.1, twisting_friction = 0.05, rolling_stiffness = 1.0e-5"
TURNING = "law = 'mindlin_deresiewicz'"
DECK = """&run       title = 'Grains with laws on top', t_end = 2.0e-3, gravity = 0.0, 0.0, -300.0 /
&material  id = 'quartz', density = 2650.0, young = 1.0e8, poisson = 0.25 /
&contact   between = 'quartz', 'quartz', friction = 0.5, damping_ratio = 0.1, LAW /
&particles file = 'pack.h5', material = 'quartz' /
&wall      id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'quartz' /
&dynamics  dt = 2.0e-6 /
&checkpoint every_time = 1.0e-3, keep = 3 /
&output    every_time = 2.0e-3, packing = 'end.h5' /
"""
SAME = 1.0e-10  # of the motion since the start; sums of ranks come in another order


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a packing: 5 x 4 x 3 spheres that touch, roll and slide."""
    rng = np.random.default_rng(5)
    axes = np.meshgrid(np.arange(5), np.arange(4), np.arange(3), indexing="ij")
    x = 1.998 * RADIUS * np.column_stack([a.ravel() for a in axes])
    x += rng.uniform(-1e-6, 1e-6, x.shape) + [0.0, 0.0, 0.999 * RADIUS]
    motion = {"v": rng.normal(0, 0.005, x.shape), "omega": rng.normal(0, 50.0, x.shape)}
    write_packing(tmp_path / "pack.h5", x, np.full(x.shape, RADIUS), **motion)
    return tmp_path


def run(folder: Path, law: str, ranks: int, *words: str) -> np.ndarray:
    """Run the deck with a law; return places and spins at the end."""
    text = DECK.replace("LAW", law if "law" in law else f"law = 'hertz_mindlin', {law}")
    (folder / "deck.nml").write_text(text)
    command = [*launcher(ranks), str(find_program("talus-dem")), "deck.nml", "--threads=1", *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    with h5py.File(folder / "end.h5") as file:
        grains = file["grains"]
        return np.concatenate([grains["x"][...] / RADIUS, grains["omega"][...] / 50.0])


def keep(folder: Path, slabs: bool) -> None:
    """Set the checkpoint half-way apart, and look that ranks, and they alone, wrote it in slabs."""
    older = sorted(folder.glob("deck.chk.1*.h5"))[-1]
    older.rename(folder / "half.h5")
    for path in folder.glob("deck.chk*.h5"):
        path.unlink()
    with h5py.File(folder / "half.h5") as file:
        assert ("contacts" in file["state"]) == slabs
        assert ("pairs.history" in file["state"]) != slabs


@pytest.mark.parametrize("law", [ROLLING, TURNING, f"{TURNING}, {ROLLING}"])
def test_laws_go_on_from_a_checkpoint_of_ranks(folder: Path, law: str) -> None:
    """What contacts keep for the laws on top is there again, on any number of ranks."""
    whole = run(folder, law, 2)
    keep(folder, slabs=True)
    for ranks in (1, 2, 3):
        assert np.abs(run(folder, law, ranks, "--restart=half.h5") - whole).max() < SAME, ranks


def test_the_law_tells(folder: Path) -> None:
    """The motion hangs on what contacts keep for the law, or the test above would see nothing."""
    with_rolling, without = run(folder, ROLLING, 1), run(folder, "law = 'hertz_mindlin'", 1)
    assert np.abs(with_rolling - without).max() > 1e-3


@pytest.mark.parametrize(
    ("before", "after"), [("law = 'hertz_mindlin'", ROLLING), (ROLLING, "law = 'hertz_mindlin'"),
                          (f"{TURNING}, {ROLLING}", ROLLING)],
)  # fmt: skip
def test_a_law_may_come_or_go(folder: Path, before: str, after: str) -> None:
    """A law that the checkpoint does not have starts from nothing, on ranks as on one."""
    run(folder, before, 1)
    keep(folder, slabs=False)
    one, as_before = (run(folder, law, 1, "--restart=half.h5") for law in (after, before))
    assert np.abs(as_before - one).max() > 1e-6
    run(folder, before, 2)
    keep(folder, slabs=True)
    for ranks in (1, 2):
        assert np.abs(run(folder, after, ranks, "--restart=half.h5") - one).max() < SAME, ranks
