"""Grains that break: balances, same bits for threads, ranks, restarts, all kinds of boundaries."""

import os
import shutil
import subprocess
import sys
import time
from math import gamma
from pathlib import Path

import h5py
import numpy as np
import pytest

from talus.faults import FaultError
from talus.generate import cloud, uniform_sizes
from talus.grading_plots import figure
from talus.packing import write_h5
from talus.pictures import values_of
from talus.programs import find_program
from talus.verification import field_steps, launcher, read_history, write_packing

DENSITY = 2650.0  # [kg/m3]
HEAD = """&run       title = 'Crushed', t_end = {t_end}, gravity = 0.0, 0.0, 0.0 /
&material  id = 'quartz', density = 2650.0, young = 2.0e10, poisson = 0.25 /
&contact   between = 'quartz', 'quartz', law = 'hertz_mindlin', friction = 0.5,
           damping_ratio = 0.1 /
&particles file = 'pack.h5', material = 'quartz' /
&breakage  material = 'quartz', strength = {strength}, size = 2.0e-3, modulus = 3.0,
           smallest = {smallest}, {words} /
&dynamics  dt_factor = 0.3 /
&history   every_time = 1.0e-5 /
"""
RELAXED = "&relaxation dt_factor = 0.3 /"
LIMIT = "&limits overlap = 0.8 /\n"
SIDE = 8.0e-3  # [m]
SPEED = 8.0  # of the walls [m/s]
BOX = "".join(
    f"&wall id = '{name}{axis}', "
    f"point = {', '.join(str(SIDE * p * (k == axis)) for k in range(3))}, "
    f"normal = {', '.join(str(float(s * (k == axis))) for k in range(3))}, material = 'quartz', "
    f"velocity = {', '.join(str(-SPEED * p * (k == axis)) for k in range(3))} /\n"
    for axis in range(3)
    for name, p, s in (("low", 0, 1), ("high", 1, -1))
)  # fmt: skip
CELL = f"&cell size = {SIDE}, {SIDE}, {SIDE} /\n&cell_rate component = 'mean', rate = -1200.0 /\n"
OUTPUT = """&output every_time = 1.0e-4, packing = 'end.h5' /
&checkpoint every_time = 3.0e-5, keep = 9 /
"""


def write_loose(folder: Path, *, shapes: bool = False, periodic: bool = False) -> None:
    """Write 27 loose grains of some 1.7 mm, of which some are no ellipsoids."""
    sizes = 0.85e-3 * uniform_sizes(27, 0.15, np.random.default_rng(2))
    pack = cloud(sizes, np.full(3, SIDE), np.array([1.1, 1.0, 0.9]), seed=4, periodic=periodic)
    if shapes:
        pack.skew = np.zeros((27, 3))
        pack.skew[::3] = [0.2, -0.1, 0.15]
        pack.exponent = np.full(27, 2.0)
        pack.exponent[1::3] = 3.0
    write_h5(folder / "pack.h5", pack)


def run(
    folder: Path, *parts: str, t_end: float = 2.4e-4, words: str = "seed = 1", ranks: int = 1,
    threads: int = 1, options: tuple[str, ...] = (), strength: float = 5.0e6,
    smallest: float = 0.6e-3, relaxed: bool = False,
) -> str:  # fmt: skip
    """Run a deck to its end; return what is printed."""
    head = HEAD.format(t_end=t_end, words=words, strength=strength, smallest=smallest)
    if relaxed:
        head = head.replace("&dynamics  dt_factor = 0.3 /", RELAXED)
    (folder / "deck.nml").write_text(head + "".join(parts))
    first = launcher(ranks) if ranks > 1 else []
    command = [*first, str(find_program("talus-dem")), "deck.nml", f"--threads={threads}", *options]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def contents(path: Path) -> dict[str, bytes]:
    """Return all datasets of a file as bytes."""
    found: dict[str, bytes] = {}

    def keep(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset):
            found[name] = item[()].tobytes()

    with h5py.File(path) as file:
        file.visititems(keep)
    return found


def masses(grains: dict[str, np.ndarray]) -> np.ndarray:
    """Return the masses of grains [kg] by their semi-axes, means of both sides, and exponents."""
    p = grains.get("exponent", np.array([2.0]))
    octant = np.array([gamma(1.0 + 1.0 / k) ** 3 / gamma(1.0 + 3.0 / k) for k in p])
    return DENSITY * 8.0 * octant * grains["axes"].prod(1)


CASES = [
    ("walls", BOX, False, "seed = 1"),
    ("octahedral", BOX, True, "criterion = 'octahedral', seed = 3"),
    ("halves", BOX, True, "family = 'halves'"),
    ("vanish", BOX, False, "family = 'none'"),
    ("cell", CELL, False, "criterion = 'hertz', seed = 2"),
]


@pytest.mark.parametrize(("name", "bounds", "shapes", "words"), CASES)
def test_balances(tmp_path: Path, name: str, bounds: str, shapes: bool, words: str) -> None:
    """Mass of grains and fines is that of the start, the ledger closes, rows of events hold."""
    write_loose(tmp_path, shapes=shapes, periodic=name == "cell")
    strength = 5.0e8 if name == "cell" else 5.0e6
    run(tmp_path, bounds, OUTPUT, words=words, strength=strength)
    steps = field_steps(tmp_path / "deck.h5")
    rows = read_history(tmp_path / "deck_breakage.csv")
    events = read_history(tmp_path / "deck_broken.csv")
    assert rows["broken"][-1] == len(events["id"]) > 5
    at_end = len(steps[-1].grains["id"])
    assert at_end == 27 - rows["broken"][-1] + rows["fragments"][-1]
    kept, start = masses(steps[-1].grains).sum(), masses(steps[0].grains).sum()
    assert kept + rows["fines_mass"][-1] == pytest.approx(start, rel=1e-14)
    assert (events["stress"] > events["strength"]).all()
    assert (events["diameter"] > 0.6e-3).all()
    assert len(set(events["id"])) == len(events["id"])
    gone = set(events["id"].astype(int))
    assert not gone & set(steps[-1].grains["id"])
    energy = read_history(tmp_path / "deck_energy.csv")
    assert energy["relative_closure"][-1] < 5e-3
    assert energy["released"][-1] == rows["released"][-1] > 0.0
    assert energy["fines"][-1] == rows["fines"][-1] > 0.0


def test_threads_and_restarts_change_no_bit(tmp_path: Path) -> None:
    """The end is the same for two threads, and after a restart amid the breaks."""
    write_loose(tmp_path, shapes=True)
    run(tmp_path, BOX, OUTPUT)
    end = contents(tmp_path / "end.h5")
    events = (tmp_path / "deck_broken.csv").read_text()
    rows = (tmp_path / "deck_breakage.csv").read_text()
    kept = [path.rename(tmp_path / f"kept{path.name}") for path in tmp_path.glob("deck.chk.*.h5")]
    assert len(kept) > 5
    assert len(events.splitlines()) > 20
    run(tmp_path, BOX, OUTPUT, threads=2)
    assert contents(tmp_path / "end.h5") == end
    assert (tmp_path / "deck_broken.csv").read_text() == events
    for path in sorted(kept)[4:6]:
        run(tmp_path, BOX, OUTPUT, options=(f"--restart={path.name}",))
        assert contents(tmp_path / "end.h5") == end
        assert (tmp_path / "deck_broken.csv").read_text() == events
        assert (tmp_path / "deck_breakage.csv").read_text() == rows


def test_a_stop_after_a_break_goes_on_by_the_same_bits(tmp_path: Path) -> None:
    """A run that ends at the very step of a break, before any other list, goes on as the whole."""
    write_loose(tmp_path)
    run(tmp_path, BOX, OUTPUT)
    end = contents(tmp_path / "end.h5")
    events = read_history(tmp_path / "deck_broken.csv")
    at = events["time"][len(events["time"]) // 2]
    for path in tmp_path.glob("deck.chk.*.h5"):
        path.unlink()
    run(tmp_path, BOX, OUTPUT, t_end=at)
    assert read_history(tmp_path / "deck_broken.csv")["time"][-1] == at
    run(tmp_path, BOX, OUTPUT, options=("--restart=auto",))
    assert contents(tmp_path / "end.h5") == end


def test_kills_change_no_bit(tmp_path: Path) -> None:
    """Killed at any moment, amid breaks and lists, a run that goes on ends by the same bits."""
    write_loose(tmp_path)
    output = OUTPUT.replace("3.0e-5", "1.0e-5")
    run(tmp_path, BOX, output)
    end = contents(tmp_path / "end.h5")
    texts = {name: (tmp_path / f"deck_{name}.csv").read_text() for name in ("broken", "breakage")}
    assert len(texts["broken"].splitlines()) > 20
    for path in [tmp_path / "end.h5", *tmp_path.glob("deck.chk*"), *tmp_path.glob("deck_*.csv")]:
        path.unlink()
    command = [str(find_program("talus-dem")), "deck.nml", "--threads=1", "--restart=auto"]
    rng = np.random.default_rng(3)
    kills = 0
    for _ in range(20):
        seen = checkpoints(tmp_path)
        with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL) as running:
            while running.poll() is None and checkpoints(tmp_path) == seen:
                time.sleep(0.002)
            time.sleep(rng.uniform(0.0, 0.05))
            kills += running.poll() is None
            running.kill()
        if running.returncode == 0:
            break
    assert kills > 3
    if running.returncode != 0:
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    assert contents(tmp_path / "end.h5") == end
    for name, text in texts.items():
        assert (tmp_path / f"deck_{name}.csv").read_text() == text


def checkpoints(folder: Path) -> set[int]:
    """Return the inodes of the checkpoints that there are."""
    with os.scandir(folder) as found:
        return {entry.inode() for entry in found if entry.name.startswith("deck.chk")}


OVERLAP = Path(__file__).parents[1] / "errors" / "base" / "overlap"
PRESSED = """&wall id = 'below', point = 0.0, 0.0, -4.0e-3, normal = 0.0, 0.0, 1.0,
  material = 'quartz', velocity = 0.0, 0.0, 5.0 /
&breakage material = 'quartz', strength = 1.0e6, size = 1.0e-3, size_exponent = 0.0,
  smallest = 0.6e-3, check_every = 10 /
&limits overlap = 0.9 /
&history every_time = 1.0e-6 /
"""


def test_an_overlap_in_motion_goes_on_by_the_same_bits(tmp_path: Path) -> None:
    """Grains behind an overlap break, those of it stay whole; stopped twice, no bit changes."""
    written = {}
    for name, ends in (("whole", ["4.0e-5"]), ("parts", ["3.0e-6", "2.1e-5", "4.0e-5"])):
        folder = tmp_path / name
        shutil.copytree(OVERLAP, folder)
        with (folder / "grains.nml").open("a") as deck:
            deck.write(PRESSED)
        environment = dict(os.environ, PYTHONPATH=os.environ.get("PYTHONPATH", "."))
        subprocess.run([sys.executable, "make_input.py"], cwd=folder, check=True, env=environment)
        text = (folder / "deck.nml").read_text() + "&checkpoint every_time = 4.0e-6, keep = 9 /\n"
        for end in ends:
            (folder / "deck.nml").write_text(text.replace("t_end = 4.0e-5", f"t_end = {end}"))
            again = ["--restart=auto"] if end != ends[0] else []
            command = [str(find_program("talus-couple")), "deck.nml", *again]
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
            assert done.returncode == 0, done.stdout + done.stderr
        names = ("deck_audit.csv", "grains_energy.csv", "grains_broken.csv", "grains_breakage.csv")
        written[name] = {file: (folder / file).read_text() for file in names}
    assert written["parts"] == written["whole"]
    broken = read_history(tmp_path / "whole" / "grains_broken.csv")
    assert sorted(broken["id"]) == [1, 2, 3, 4]
    energy = read_history(tmp_path / "whole" / "grains_energy.csv")
    assert energy["relative_closure"][-1] < 2e-3


def test_ranks_break_the_same_grains(tmp_path: Path) -> None:
    """On two ranks the first breaks are those of one rank: grains, strengths and order."""
    write_loose(tmp_path)
    run(tmp_path, BOX, OUTPUT, t_end=1.0e-4)
    one = read_history(tmp_path / "deck_broken.csv")
    mass = read_history(tmp_path / "deck_breakage.csv")
    run(tmp_path, BOX, OUTPUT, t_end=1.0e-4, ranks=2)
    two = read_history(tmp_path / "deck_broken.csv")
    n = min(10, len(one["id"]))
    assert n > 5
    assert (one["id"][:n] == two["id"][:n]).all()
    assert np.allclose(one["strength"][:n], two["strength"][:n], rtol=1e-14)
    assert np.allclose(one["stress"][:n], two["stress"][:n], rtol=1e-6)
    assert np.isfinite(mass["fines_mass"]).all()


def test_strengths_are_those_of_ids(tmp_path: Path) -> None:
    """Strengths in the rows of events follow from ids, sizes and seed by the published hash."""
    write_loose(tmp_path)
    run(tmp_path, BOX, OUTPUT, words="seed = 7, size_exponent = 0.5")
    events = read_history(tmp_path / "deck_broken.csv")
    u = np.array([unit_number(int(k), 7) for k in events["id"]])
    wanted = 5.0e6 * (events["diameter"] / 2.0e-3) ** -0.5 * (-np.log(u)) ** (1.0 / 3.0)
    assert events["strength"] == pytest.approx(wanted, rel=1e-12)
    assert events["generation"].max() == 1


def unit_number(grain: int, seed: int) -> float:
    """Return the number between 0 and 1 of an id and a seed."""
    most = (1 << 64) - 1
    z = (grain * 0x9E3779B97F4A7C15 + seed * 0xD1B54A32D192ED03) & most
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 & most
    z = (z ^ (z >> 27)) * 0x94D049BB133111EB & most
    z ^= z >> 31
    return ((z >> 11) + 0.5) * 2.0**-53


def test_gradings_are_written_and_drawn(tmp_path: Path) -> None:
    """Gradings begin at none broken, rise with what breaks, go on at a restart and are drawn."""
    write_loose(tmp_path)
    sieves = "&grading sieves = 0.1e-3, 0.2e-3, 0.5e-3, 1.0e-3, 2.5e-3, finest = 0.01e-3 /\n"
    run(tmp_path, BOX, OUTPUT, sieves)
    rows = read_history(tmp_path / "deck_grading.csv")
    text = (tmp_path / "deck_grading.csv").read_text()
    assert rows["hardin"][0] == rows["einav"][0] == 0.0
    names = [name for name in rows if name.startswith("passing_")]
    for name in ("hardin", "einav", names[2]):
        assert (np.diff(rows[name]) >= -1e-12).all()
        assert rows[name][-1] > 0.1
    assert (rows[names[-1]] == 1.0).all()
    assert rows["mass"] + rows["fines"] == pytest.approx(rows["mass"][0], rel=1e-12)
    kept = sorted(tmp_path.glob("deck.chk.*.h5"))[4].rename(tmp_path / "kept.h5")
    run(tmp_path, BOX, OUTPUT, sieves, options=(f"--restart={kept.name}",))
    assert (tmp_path / "deck_grading.csv").read_text() == text
    assert figure(tmp_path / "deck_grading.csv") is not None
    with pytest.raises(FaultError) as fault:
        figure(tmp_path / "deck_energy.csv")
    assert fault.value.code == "E620"


def still_pair(folder: Path) -> None:
    """Write a spinning sphere that grazes another in flight, without friction."""
    x = np.array([[0.0, 0.0, 0.0], [2.0e-3 + 1e-9, 0.0, 0.0]])
    v = np.array([[1e-4, 3.0, -2.0], [0.0, 3.0, -2.0]])
    omega = np.array([[0.0, 0.0, 0.0], [900.0, -500.0, 2000.0]])
    write_packing(folder / "pack.h5", x, np.full((2, 3), 1.0e-3), v=v, omega=omega)


KEPT, KEPT_INERTIA = 0.5238612304555293, 0.4184633846915321  # of a sphere by fourteen fragments
SIX, EIGHT = np.sqrt(2.0) - 1.0, 0.2300931878706982  # radii of its fragments


def broken_in_flight(folder: Path, mass: str) -> tuple[dict, dict, np.ndarray]:
    """Break one of two grains in flight; return rows of breakage, energy, the momentum at the end.

    Momentum is that of the masses that move: those of the solid, or times the factor of the choice.
    """
    still_pair(folder)
    text = HEAD.format(t_end=4.0e-5, words=f"fragment_mass = '{mass}', check_every = 1",
                       strength=1.0e-9, smallest=1.5e-3)  # fmt: skip
    if mass == "scaled":
        text = text.replace("&dynamics  dt_factor = 0.3 /", RELAXED)
    text = text.replace("friction = 0.5", "friction = 0.0")
    text = text.replace("every_time = 1.0e-5", "every_time = 1.0e-6")
    (folder / "deck.nml").write_text(text + "&output every_time = 1.0e-6 /\n")
    command = [str(find_program("talus-dem")), "deck.nml", "--threads=1"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    last = field_steps(folder / "deck.h5")[-1].grains
    heavier = {"solid": 1.0, "parent": 1.0 / KEPT, "scaled": (1e-3 / last["axes"][:, 0]) ** 2}
    push = (masses(last) * np.where(last["generation"], heavier[mass], 1.0))[:, None] * last["v"]
    rows = read_history(folder / "deck_breakage.csv")
    assert list(read_history(folder / "deck_broken.csv")["id"]) == [2]
    return rows, read_history(folder / "deck_energy.csv"), push.sum(0)


def test_fragments_share_the_mass_of_their_grain(tmp_path: Path) -> None:
    """With `parent` no mass nor momentum leaves, with `scaled` no momentum; energies are exact."""
    volume = 4.0 / 3.0 * np.pi * 1.0e-9
    push = 2.0 * DENSITY * volume * np.array([0.5e-4, 3.0, -2.0])
    move = 0.5 * DENSITY * volume * 13.0
    spin = 0.2 * DENSITY * volume * 1.0e-6 * (900.0**2 + 500.0**2 + 2000.0**2)
    weight = 6.0 * SIX + 8.0 * EIGHT  # of scaled fragments, over that of the grain
    turn = sum(n * r * (0.4 * r**2 + 2.0 / 3.0 * c**2) for n, r, c in
               ((6.0, SIX, 1.0 - SIX), (8.0, EIGHT, 1.0 - EIGHT))) / 0.4  # fmt: skip
    for mass, left in (("solid", (KEPT, KEPT_INERTIA)), ("parent", (1.0, KEPT_INERTIA / KEPT)),
                       ("scaled", (1.0 / weight, turn / weight**2))):  # fmt: skip
        rows, energy, at_end = broken_in_flight(tmp_path, mass)
        if mass != "solid":
            assert at_end == pytest.approx(push, abs=1e-8 * np.abs(push).max())
            assert np.abs(rows["momentum_y"][-1]) < 1e-12 * push[1]
        lost = rows["fines_mass"][-1] / (DENSITY * volume)
        assert lost == pytest.approx(0.0 if mass == "parent" else 1.0 - KEPT, abs=1e-8)
        fines = (1.0 - left[0]) * move + (1.0 - left[1]) * spin
        assert energy["fines"][-1] == pytest.approx(fines, rel=2e-6)
        assert energy["relative_closure"][-1] < 1e-6


def test_scaled_fragments_keep_the_step(tmp_path: Path) -> None:
    """In relaxation the step stays that of the grains; restarts, threads, gradings as ever."""
    sieves = "&grading sieves = 0.1e-3, 0.2e-3, 0.5e-3, 1.0e-3, 2.5e-3, finest = 0.01e-3 /\n"
    write_loose(tmp_path)
    steps = {}
    for mass in ("solid", "scaled"):
        words = f"fragment_mass = '{mass}'"
        for path in tmp_path.glob("deck.chk.*.h5"):
            path.unlink()
        run(tmp_path, BOX, OUTPUT, sieves, LIMIT, words=words, t_end=3.0e-4, relaxed=True)
        rows = read_history(tmp_path / "deck_grading.csv")
        assert read_history(tmp_path / "deck_broken.csv")["generation"].max() >= 1.0
        assert rows["mass"] + rows["fines"] == pytest.approx(rows["mass"][0], rel=1e-12)
        steps[mass] = read_history(tmp_path / "deck_energy.csv")["dt"]
        assert read_history(tmp_path / "deck_energy.csv")["relative_closure"][-1] < 5e-3
    assert steps["solid"][-1] < 0.25 * steps["solid"][0]
    assert steps["scaled"][-1] > 0.4 * steps["scaled"][0]  # that of contacts pressed this deep
    end = contents(tmp_path / "end.h5")
    kept = sorted(tmp_path.glob("deck.chk.*.h5"))[4].rename(tmp_path / "kept.h5")
    run(tmp_path, BOX, OUTPUT, sieves, LIMIT, words=words, t_end=3.0e-4, relaxed=True, threads=2,
        options=(f"--restart={kept.name}",))  # fmt: skip
    assert contents(tmp_path / "end.h5") == end


FLOOR = """&wall id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'quartz' /
"""
PLATES = {
    "wall": "&wall id = 'top', point = 0.0, 0.0, 2.0e-3, normal = 0.0, 0.0, -1.0, "
    "material = 'quartz', velocity = 0.0, 0.0, -0.5 /\n",
    # the edge of both triangles leads through the contact
    "surface": "&surface id = 'top', rectangle = -3.0e-3, -3.0e-3, 2.0e-3, 3.0e-3, -3.0e-3, "
    "2.0e-3, 3.0e-3, 3.0e-3, 2.0e-3, material = 'quartz', velocity = 0.0, 0.0, -0.5 /\n",
}  # fmt: skip


@pytest.mark.parametrize("criterion", ["nominal", "octahedral"])
def test_surfaces_break_grains_as_walls_do(tmp_path: Path, criterion: str) -> None:
    """A sphere under a surface, upon an edge of its triangles, breaks as under a wall."""
    found = {}
    for name, plate in PLATES.items():
        write_packing(tmp_path / "pack.h5", np.array([[0.0, 0.0, 1.0e-3]]), np.full((1, 3), 1.0e-3))
        words = f"check_every = 1, criterion = '{criterion}'"
        run(tmp_path, FLOOR, plate, t_end=1.5e-4, words=words, smallest=1.5e-3)
        found[name] = read_history(tmp_path / "deck_broken.csv")
        assert len(found[name]["id"]) == 1
        rows = read_history(tmp_path / "deck_breakage.csv")
        assert rows["fragments"][-1] == 14
    for key in ("time", "stress", "force"):
        assert found["surface"][key] == pytest.approx(found["wall"][key], rel=2e-3)
    area = (found["wall"]["force"] / found["wall"]["stress"])[0]
    assert area == pytest.approx(4e-6, rel=1e-12 if criterion == "nominal" else 2e-2)


def test_held_grains_never_break_and_others_may_enter(tmp_path: Path) -> None:
    """Fixed and driven grains bear any stress; ids of fragments and of a source do not meet."""
    x = np.array([[0.0, 0.0, 1.0e-3], [0.0, 0.0, 3.0e-3], [0.0, 0.0, 5.0e-3]])
    write_packing(tmp_path / "pack.h5", x, np.full((3, 3), 1.0e-3),
                  kind=np.array([1, 0, 0], dtype=np.int32))  # fmt: skip
    held = "&driven ids = 3, velocity = 0.0, 0.0, -1.0 /\n"
    source = """&source id = 's', semi_axes = 0.8e-3, number_rate = 2.0e5, stop = 4.0e-5,
      region = 'box', lower = 0.01, 0.0, 0.0, upper = 0.02, 0.01, 0.01, every_time = 2.0e-5 /
    &sink id = 'far', region = 'plane', point = 1.0, 0.0, 0.0, normal = 1.0, 0.0, 0.0,
      every_time = 2.0e-5 /
    """  # fmt: skip
    run(tmp_path, held, source, OUTPUT, t_end=2.0e-4, smallest=1.5e-3)
    events = read_history(tmp_path / "deck_broken.csv")
    fed = read_history(tmp_path / "deck_sources.csv")
    last = field_steps(tmp_path / "deck.h5")[-1].grains
    assert list(events["id"]) == [2]
    assert fed["grains"][-1] > 3
    assert len(last["id"]) == 2 + 14 + fed["grains"][-1]
    assert len(set(last["id"])) == len(last["id"])
    assert {1, 3} <= set(last["id"])
    assert (last["generation"] == 1).sum() == 14
    steps = field_steps(tmp_path / "deck.h5")
    assert values_of(steps[0], steps[-1], "generation").max() == 1.0
    del steps[-1].grains["generation"]
    with pytest.raises(FaultError) as fault:
        values_of(steps[0], steps[-1], "generation")
    assert fault.value.code == "E621"


def test_check_foretells_what_may_come(tmp_path: Path) -> None:
    """--check tells generations, grains and step, and warns where there may be too many grains."""
    write_loose(tmp_path)
    text = run(tmp_path, BOX, options=("--check",), words="most_grains = 100")
    assert "'nominal', 'fourteen', 2 generations at most: 2484 grains" in text
    assert "more than 100 that may be" in text
    text = run(tmp_path, BOX, options=("--check",), smallest=0.85e-3)
    assert "1 generation at most: 378 grains" in text
    assert "that may be" not in text
