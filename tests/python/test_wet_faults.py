"""A liquid among grains and a rod in it: kills, full disks and threads lose nothing, not a bit."""

import os
import resource
import subprocess
import time
from pathlib import Path

import h5py
import numpy as np

from talus.programs import find_program
from talus.verification import write_packing

SIDE, LAYERS, PITCH = 8, 12, 1.0e-3
WALLS = "".join(
    f"&wall id = '{name}{axis}', point = {', '.join(str(at * (k == axis)) for k in range(3))}, "
    f"normal = {', '.join(str(float(sign * (k == axis))) for k in range(3))}, material = 'q' /\n"
    for axis in range(3)
    for name, at, sign in (("low", 0.0, 1), ("high", SIDE * PITCH, -1))
    if axis < 2 or sign > 0
)
DECK = """&run       title = 'Wet', t_end = {t_end}, gravity = 0.0, 0.0, -9.81 /
&material  id = 'q', density = 2650.0, young = 1.0e8, poisson = 0.25 /
&contact   between = 'q', 'q', law = 'hertz_mindlin', friction = 0.5, damping_ratio = 0.1 /
&particles file = 'packing.h5', material = 'q' /
&cylinder  id = 'rod', centre = 0.004, 0.004, 0.0105, axis = 0.0, 0.0, 1.0, radius = 1.9e-3,
           length = 0.01, side = 'outside', material = 'q', velocity = 0.0, 0.0, -0.2 /
&cylinder  id = 'ball', centre = 0.0058, 0.004, 0.0028, axis = 0.0, 1.0, 0.0, radius = 0.9e-3,
           length = 1.9e-3, side = 'outside', material = 'q' /
&body      surface = 'ball', free = 'x', 'y', 'z', 'rx', 'ry', 'rz', density = 3000.0 /
&fluid     id = 'water', density = 1000.0, viscosity = 1.0e-3, bulk_modulus = 2.2e9 /
&pore_grid fluid = 'water', lower = 0.0, 0.0, 0.0, upper = 0.008, 0.008, {upper},
           bricks = 2, 2, {bricks}, porosity_every = 7 /
&drain     side = 'z1', pressure = 0.0 /
&limits    overlap = 0.9 /
&dynamics  dt = 1.0e-6 /
&history   every_time = 1.0e-4 /
&output    every_time = {every}, packing = 'end.h5' /
&checkpoint every_time = {kept}, keep = 9 /
"""


def write(folder: Path, t_end: float, upper: float, bricks: int, kept: float) -> None:
    """Write deck and packing: a lattice with holes for rod and ball."""
    words = {"t_end": t_end, "upper": upper, "bricks": bricks, "every": t_end / 8.0, "kept": kept}
    folder.mkdir(exist_ok=True)
    (folder / "deck.nml").write_text(DECK.format(**words) + WALLS)
    places = np.meshgrid(*(np.arange(n) for n in (SIDE, SIDE, LAYERS)), indexing="ij")
    x = PITCH * (np.stack(places, -1).reshape(-1, 3) + 0.5)
    rod = (np.hypot(x[:, 0] - 4e-3, x[:, 1] - 4e-3) < 2.45e-3) & (x[:, 2] > 4.95e-3)
    ball = (np.hypot(x[:, 0] - 5.8e-3, x[:, 2] - 2.8e-3) < 1.45e-3) & (
        np.abs(x[:, 1] - 4e-3) < 1.5e-3
    )
    x = x[~(rod | ball)]
    write_packing(folder / "packing.h5", x, np.full((len(x), 3), 0.499e-3))


def command(*options: str) -> list[str]:
    """Return the command line."""
    return [str(find_program("talus-dem")), "deck.nml", *options]


def solve(folder: Path, *options: str, most: int = 0) -> subprocess.CompletedProcess:
    """Run to the end, with files of so many bytes at most."""

    def limit() -> None:
        if most > 0:
            hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
            resource.setrlimit(resource.RLIMIT_FSIZE, (most, hard))

    return subprocess.run(command(*options), cwd=folder, capture_output=True, text=True,
                          timeout=300, check=False, preexec_fn=limit)  # fmt: skip


def contents(path: Path) -> dict[str, bytes]:
    """Return all datasets of a file as bytes."""
    found: dict[str, bytes] = {}

    def keep(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset):
            found[name] = item[()].tobytes()

    with h5py.File(path) as file:
        file.visititems(keep)
    return found


def results(folder: Path) -> dict[str, object]:
    """Return what a run has left: grains at the end, histories of liquid, rod and ball."""
    names = ("pore", "tools", "bodies", "surfaces", "energy")
    rows = {name: (folder / f"deck_{name}.csv").read_text() for name in names}
    return {"end": contents(folder / "end.h5"), **rows}


def steps(path: Path) -> dict[float, dict[str, bytes]]:
    """Return all steps of a field file by their times."""
    found = {}
    with h5py.File(path) as file:
        for step in file["steps"].values():
            assert step.attrs["complete"] == 1
            data: dict[str, bytes] = {}
            step.visititems(
                lambda name, item, data=data: (
                    data.update({name: item[()].tobytes()})
                    if isinstance(item, h5py.Dataset)
                    else None
                )
            )
            found[float(step.attrs["time"])] = data
    return found


def check_fields(folder: Path, whole: Path) -> None:
    """Fields are those of the whole run; a file that a kill has cut is put aside."""
    for name in ("deck.h5", "deck_pore.h5"):
        one, other = steps(folder / name), steps(whole / name)
        assert all(one[time] == other[time] for time in one)
        assert one.keys() == other.keys() or (folder / f"{name}.damaged").exists()


def checkpoints(folder: Path) -> set[int]:
    """Return the inodes of the checkpoints that there are."""
    with os.scandir(folder) as found:
        return {entry.inode() for entry in found if entry.name.startswith("deck.chk")}


def test_kills_change_no_bit(tmp_path: Path) -> None:
    """Killed at any moment a run goes on to the same bits; so does one on two threads."""
    one, two, cut = (tmp_path / name for name in ("one", "two", "cut"))
    for folder in (one, two, cut):
        write(folder, 6.0e-3, 0.016, 4, 1.002e-3)  # checkpoints fall within exchanges, too
    done = solve(one, "--threads=1")
    assert done.returncode == 0, done.stdout + done.stderr
    whole = results(one)
    assert len(str(whole["tools"]).splitlines()) == 1 + 2 * 61
    assert solve(two, "--threads=2").returncode == 0
    assert results(two) == whole
    check_fields(two, one)
    rng = np.random.default_rng(5)
    kills = 0
    for _ in range(20):
        seen = checkpoints(cut)
        words = command("--threads=1", "--restart=auto")
        with subprocess.Popen(words, cwd=cut, stdout=subprocess.DEVNULL) as running:
            while running.poll() is None and checkpoints(cut) == seen:
                time.sleep(0.002)
            time.sleep(rng.uniform(0.0, 0.05))
            kills += running.poll() is None
            running.kill()
        if running.returncode == 0:
            break
    assert kills > 2
    if running.returncode != 0:
        done = solve(cut, "--threads=1", "--restart=auto")
        assert done.returncode == 0, done.stdout + done.stderr
    assert results(cut) == whole
    check_fields(cut, one)


def test_a_full_disk_loses_no_step(tmp_path: Path) -> None:
    """Where the liquid's fields find no room: message, exit 4, whole steps; then it goes on."""
    whole = tmp_path / "whole"
    write(whole, 8.0e-4, 1.6, 400, 1.0e-4)
    done = solve(whole, "--threads=1")
    assert done.returncode == 0, done.stdout + done.stderr
    size = (whole / "deck_pore.h5").stat().st_size
    assert size > 1.2 * (whole / "deck.h5").stat().st_size
    fields = steps(whole / "deck_pore.h5")
    found = set()
    for share in (0.95, 0.9, 0.87):
        folder = tmp_path / str(share)
        write(folder, 8.0e-4, 1.6, 400, 1.0e-4)
        ended = solve(folder, "--threads=1", most=int(share * size))
        assert ended.returncode == 4, ended.stdout + ended.stderr
        assert "error S002: no room to write 'deck_pore.h5'" in ended.stderr
        left = steps(folder / "deck_pore.h5")
        assert all(data == fields[time] for time, data in left.items())
        found.add(len(left))
        again = solve(folder, "--threads=1", "--restart=auto")
        assert again.returncode == 0, again.stdout + again.stderr
        assert results(folder) == results(whole)
        assert steps(folder / "deck_pore.h5") == fields
    assert 0 < min(found) <= max(found) < 9


def test_a_damaged_file_is_told(tmp_path: Path) -> None:
    """A file of the liquid's fields that was cut is put aside when the run goes on, and told."""
    write(tmp_path, 2.0e-4, 0.016, 4, 1.0e-4)
    assert solve(tmp_path, "--threads=1").returncode == 0
    fields = tmp_path / "deck_pore.h5"
    fields.write_bytes(fields.read_bytes()[:3000])
    chosen = sorted(tmp_path.glob("deck.chk*.h5"), key=lambda path: path.stat().st_mtime)[0]
    chosen.rename(tmp_path / "middle.chk.h5")
    again = solve(tmp_path, "--threads=1", "--restart=middle.chk.h5")
    assert again.returncode == 0, again.stdout + again.stderr
    assert "field file moved to" in again.stdout and "deck_pore.h5.damaged" in again.stdout
    assert (tmp_path / "deck_pore.h5.damaged").exists()
    assert np.isclose(max(steps(fields)), 2.0e-4)
