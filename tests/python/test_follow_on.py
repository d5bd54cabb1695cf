"""A run that goes on from the checkpoint of another deck: where it begins is in its histories."""

import os
import subprocess
from pathlib import Path

import numpy as np

from talus import cli
from talus.programs import find_program
from talus.verification import read_history

TEST = ("shear.nml", "--restart=compress.chk.h5")


def solve(folder: Path, *words: str) -> None:
    """Run talus-dem; it ends well."""
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    done = subprocess.run([find_program("talus-dem"), *words], cwd=folder, env=environment,
                          capture_output=True, text=True, timeout=120)  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr


def test_first_row(tmp_path: Path) -> None:
    """A test begins where the compression ended: its first row has the bits of the last one.

    Rates are those of the new deck; the energy by staggering, and the closure with it, follows the
    step, which is new.
    """
    words = ["--set", "grains=100", "strain=0.005", "compressed=0.08"]
    assert cli.main(["new", "triaxial", "--small", "-o", str(tmp_path), *words]) == 0
    solve(tmp_path, "compress.nml")
    solve(tmp_path, *TEST)
    for kind in ("cell", "energy"):
        ends, begins = (read_history(tmp_path / f"{n}_{kind}.csv") for n in ("compress", "shear"))
        names = [n for n in ends if not n.startswith(("rate", "staggering")) and "closure" not in n]
        assert len(names) > 14 and all(begins[n][0] == ends[n][-1] for n in names)
    rows = read_history(tmp_path / "shear_cell.csv")
    assert np.isclose(rows["stress_zz"][0], -2.0e4, rtol=0.02)
    before = (tmp_path / "shear_cell.csv").read_bytes()
    solve(tmp_path, *TEST)  # once more: no row twice
    assert (tmp_path / "shear_cell.csv").read_bytes() == before
