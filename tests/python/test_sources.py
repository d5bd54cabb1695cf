"""Grains that enter and leave: what others see of it, what is kept, what is booked, same bits."""

import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest

from talus.generate import cloud, uniform_sizes
from talus.packing import Packing, make_packing, read_h5, write_h5
from talus.programs import find_program
from talus.verification import field_steps, launcher, read_history

RADIUS = 2.0e-3  # [m]
MASS = 2500.0 * 4.0 / 3.0 * np.pi * RADIUS**3  # [kg]
HEAD = """&run       title = 'Open', t_end = {t_end}, gravity = 0.0, 0.0, {gravity} /
&material  id = 'glass', density = 2500.0, young = 1.0e8, poisson = 0.25 /
&contact   between = 'glass', 'glass', law = 'hertz_mindlin', friction = 0.5,
           damping_ratio = {damping} /
&particles {packing} material = 'glass' /
&history   every_time = 2.0e-3 /
"""  # fmt: skip
MOVE = "&dynamics /\n"
FLOOR = """&wall id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'glass' /
"""
TUB = FLOOR + "".join(
    f"&wall id = '{name}', point = {-0.015 * x}, {-0.015 * y}, 0.0, normal = {x}.0, {y}.0, 0.0, "
    "material = 'glass' /\n"
    for name, x, y in [("w", 1, 0), ("s", 0, 1), ("n", 0, -1)]
)
RAIN = """&source id = 'rain', {grains}, {rate}, region = 'box',
  lower = -0.012, -0.012, 0.03, upper = 0.012, 0.012, 0.045, velocity = 0.0, 0.0, -1.5,
  every_time = 1.0e-2 /
"""
SPILL = """&sink id = 'spill', region = 'plane', point = 0.02, 0.0, 0.0, normal = 1.0, 0.0, 0.0,
  every_time = 5.0e-3 /
"""
OUTPUT = (
    "&output every_time = 2.0e-2, fields = 'velocity', 'spin', 'contacts', packing = 'end.h5' /\n"
)
ROLLING = "rolling_friction = 0.1, twisting_friction = 0.05, rolling_stiffness = 1.0e-5,"
STORE = "&checkpoint every_time = 5.0e-2, keep = 9 /\n"


def deck(
    t_end: float, *parts: str, packing: str = "", gravity: float = -9.81, damping: float = 0.3,
    mode: str = MOVE,
) -> str:  # fmt: skip
    """Return a deck of these groups."""
    file = f"file = '{packing}'," if packing else ""
    head = HEAD.format(t_end=t_end, gravity=gravity, damping=damping, packing=file)
    return head + mode + "".join(parts)


def run(folder: Path, text: str, *words: str, ranks: int = 1, threads: int = 1) -> str:
    """Run a deck to its end; return what is printed."""
    (folder / "deck.nml").write_text(text)
    first = launcher(ranks) if ranks > 1 else []
    command = [*first, str(find_program("talus-dem")), "deck.nml", f"--threads={threads}", *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def filled(grains: str, rate: str = "mass_rate = 0.25", t_end: float = 0.2) -> str:
    """Return a deck of a tub that rain fills until it spills."""
    return deck(t_end, TUB, RAIN.format(grains=grains, rate=rate), SPILL, OUTPUT, STORE)


def contents(path: Path, *left_out: str) -> dict[str, bytes]:
    """Return all datasets of a file as bytes."""
    found: dict[str, bytes] = {}

    def keep(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and not any(word in name for word in left_out):
            found[name] = item[()].tobytes()

    with h5py.File(path) as file:
        file.visititems(keep)
    return found


def mixed_shapes(folder: Path) -> str:
    """Write a packing of ellipsoids, poly-ellipsoids and superquadrics to draw from."""
    pack = cloud(uniform_sizes(30, 0.2, np.random.default_rng(2)), np.full(3, 0.03),
                 np.array([2.2e-3, 2.0e-3, 1.7e-3]), seed=4)  # fmt: skip
    pack.skew = np.zeros((30, 3))
    pack.skew[10:20] = [0.2, -0.1, 0.15]
    pack.exponent = np.full(30, 2.0)
    pack.exponent[20:] = 3.0
    write_h5(folder / "shapes.h5", pack)
    return "file = 'shapes.h5'"


def test_mass_and_energy_are_booked(tmp_path: Path) -> None:
    """What has entered less what has left is there, by number, mass and energy."""
    grains = f"semi_axes = {RADIUS}, scatter = 0.2"
    text = run(tmp_path, filled(grains))
    fed = read_history(tmp_path / "deck_sources.csv")
    gone = read_history(tmp_path / "deck_sinks.csv")
    last = field_steps(tmp_path / "deck.h5")[-1].grains
    assert gone["grains"][-1] > 20
    assert len(last["id"]) == fed["grains"][-1] - gone["grains"][-1]
    mass = 2500.0 * 4.0 / 3.0 * np.pi * (last["axes"].prod(1)).sum()
    assert fed["mass"][-1] - gone["mass"][-1] == pytest.approx(mass, rel=1e-12)
    assert fed["mass"][-1] == pytest.approx(0.25 * 0.2, abs=MASS * 1.2**3)
    energy = read_history(tmp_path / "deck_energy.csv")
    assert energy["entered"][-1] == pytest.approx(fed["energy"][-1], rel=1e-12)
    assert energy["left"][-1] == pytest.approx(gone["energy"][-1], rel=1e-12)
    fall = 0.5 * fed["mass"][-1] * 1.5**2
    assert fed["energy"][-1] == pytest.approx(fall, rel=1e-12)
    assert np.abs(energy["relative_closure"]).max() < 0.01
    assert "source rain" in text and "sink spill" in text


def test_what_finds_no_room_enters_later(tmp_path: Path) -> None:
    """A source whose region is full lets what is due wait, says so, and makes up for it."""
    source = f"""&source id = 's', semi_axes = {RADIUS}, number_rate = 2.0e4, stop = 5.0e-3,
      region = 'box', lower = 0.0, 0.0, 0.0, upper = 0.01, 0.01, 0.01, velocity = 0.0, 0.0, -4.0,
      every_time = 5.0e-3 /
    """  # fmt: skip
    text = run(tmp_path, deck(0.1, source, gravity=0.0))
    fed = read_history(tmp_path / "deck_sources.csv")
    assert "no room for all that were due" in text
    assert fed["waits"][-1] > 0
    assert fed["grains"][0] < fed["grains"][-1] == 100
    assert (np.diff(fed["waits"]) >= 0).all()


def test_closure_falls_with_the_square_of_the_step(tmp_path: Path) -> None:
    """Entering and leaving add nothing to the error of the steps, which is of second order."""
    found = []
    for factor in (0.3, 0.1):
        mode = f"&dynamics dt_factor = {factor} /\n"
        rain = RAIN.format(grains=f"semi_axes = {RADIUS}", rate="mass_rate = 0.25")
        run(tmp_path, deck(0.1, TUB, rain, SPILL, mode=mode))
        energy = read_history(tmp_path / "deck_energy.csv")
        found.append(np.abs(energy["relative_closure"]).max())
    assert found[1] < 0.2 * found[0]


def test_grains_enter_clear_of_each_other_and_at_random(tmp_path: Path) -> None:
    """Centres are uniform in the region, sizes in the scatter, orientations over all turns."""
    source = """&source id = 's', semi_axes = 1.2e-4, 1.0e-4, 0.8e-4, scatter = 0.3,
      number_rate = 2.0e4, region = 'REGION', PLACE, every_time = 1.0e-1, tries = 1000 /
    """  # fmt: skip
    places = {
        "box": "lower = -0.01, -0.01, 0.0, upper = 0.01, 0.01, 0.02",
        "cylinder": "base = 0.0, 0.0, 0.0, radius = 0.01, length = 0.02",
        "sphere": "centre = 0.0, 0.0, 0.01, radius = 0.01",
    }
    for kind, place in places.items():
        text = source.replace("REGION", kind).replace("PLACE", place)
        run(tmp_path, deck(0.1, text, OUTPUT, gravity=0.0))
        g = field_steps(tmp_path / "deck.h5")[-1].grains
        n = len(g["id"])
        assert n == 2000
        assert (g["id"] == np.arange(1, n + 1)).all()
        radius = g["axes"].max(1)
        apart = np.linalg.norm(g["x"][:, None] - g["x"][None], axis=2)
        np.fill_diagonal(apart, 1.0)
        assert (apart >= radius[:, None] + radius[None]).all()
        y = g["x"] - [0.0, 0.0, 0.01]
        inside = 0.01 - radius
        if kind == "box":
            assert (np.abs(y) <= inside[:, None]).all()
            share = [(np.abs(y[:, k]) / inside) for k in range(3)]
        elif kind == "cylinder":
            across = np.hypot(y[:, 0], y[:, 1])
            assert (across <= inside).all() and (np.abs(y[:, 2]) <= inside).all()
            share = [(across / inside) ** 2, np.abs(y[:, 2]) / inside]
        else:
            assert (np.linalg.norm(y, axis=1) <= inside).all()
            share = [(np.linalg.norm(y, axis=1) / inside) ** 3]
        scale = g["axes"][:, 0] / 1.2e-4
        assert scale.min() > 0.7 and scale.max() < 1.3
        share.append((scale - 0.7) / 0.6)
        # an axis of the body, in space: each component is uniform from -1 to 1
        w, a, b, c = g["quat"].T
        share.append(0.5 + 0.5 * (1.0 - 2.0 * (a**2 + b**2)))
        share.append(0.5 + (b * c + w * a))
        share.append(0.5 + (a * b - w * c))
        assert c.size == n
        for values in share:  # Kolmogorov-Smirnov, 0.1 %
            steps = np.arange(1, n + 1) / n
            assert np.abs(np.sort(values) - steps).max() < 1.95 / np.sqrt(n)


def two_heaps(spacing: float) -> tuple[Packing, Packing]:
    """Return two heaps of spheres that touch, the second one far to the right."""
    rng = np.random.default_rng(9)
    sites = np.indices((3, 3, 3)).reshape(3, -1).T * 1.99 * RADIUS
    heaps = []
    for k in range(2):
        x = sites + rng.uniform(-1e-5, 1e-5, sites.shape) + [spacing * k, 0.0, RADIUS]
        axes = np.full(x.shape, RADIUS)
        heap = make_packing(x, axes, None, None, np.arange(1, 28) + 27 * k)
        heap.v = rng.normal(0.0, 0.02, x.shape)
        heaps.append(heap)
    return heaps[0], heaps[1]


@pytest.mark.parametrize("ranks", [1, 2])
def test_others_go_on_as_if_nothing_had_happened(tmp_path: Path, ranks: int) -> None:
    """A heap moves by the same bits, whether another one leaves, enters or is never there."""
    left, right = two_heaps(0.1)
    write_h5(tmp_path / "left.h5", left)
    write_h5(tmp_path / "right.h5", right)
    write_h5(tmp_path / "both.h5", left.join(right))
    mode = "&dynamics dt = 5.0e-6 /\n"
    sink = """&sink id = 'right', region = 'plane', point = 0.05, 0.0, 0.0, normal = 1.0, 0.0, 0.0,
      start = 0.01, every_time = 1.0e-2 /\n"""
    source = """&source id = 'right', placement = 'packing', file = 'right.h5', start = 0.01,
      every_time = 1.0, grains = 27 /\n"""
    source = source.replace("every_time = 1.0,", "every_time = 0.01,")
    found = []
    for packing, part in (("left.h5", ""), ("both.h5", sink), ("left.h5", source)):
        run(tmp_path, deck(0.02, FLOOR, part, OUTPUT, packing=packing, mode=mode), ranks=ranks)
        last = field_steps(tmp_path / "deck.h5")[-1].grains
        mine = last["id"] <= 27
        found.append({k: v[mine].tobytes() for k, v in last.items() if k in ("x", "v", "omega")})
        assert len(last["id"]) == (54 if part == source else 27)
    assert found[0] == found[1]
    assert found[0] == found[2]


def test_a_packing_enters_with_its_contacts(tmp_path: Path) -> None:
    """Grains at rest that enter with their contacts stay at rest, with the same elastic energy."""
    left, _ = two_heaps(0.1)
    left.v[:] = 0.0
    write_h5(tmp_path / "heap.h5", left)
    rest = (
        "&relaxation damping = 'adaptive', dt_factor = 0.2 /\n&equilibrium unbalanced = 1.0e-8 /\n"
    )
    smooth = "&material id = 'plate', density = 2500.0, young = 1.0e8, poisson = 0.25 /\n"
    smooth += "&contact between = 'glass', 'plate', law = 'hertz_mindlin', friction = 0.0 /\n"
    box = smooth + FLOOR.replace("glass", "plate") + "".join(
        f"&wall id = '{name}', point = {x}, {y}, 0.0, normal = {a}, {b}, 0.0, "
        "material = 'plate' /\n"
        for name, x, y, a, b in [
            ("w", -1.99e-3, 0.0, 1.0, 0.0), ("e", 9.93e-3, 0.0, -1.0, 0.0),
            ("s", 0.0, -1.99e-3, 0.0, 1.0), ("n", 0.0, 9.93e-3, 0.0, -1.0),
        ]
    )  # fmt: skip
    run(tmp_path, deck(2.0, box, OUTPUT, packing="heap.h5", mode=rest))
    before = read_history(tmp_path / "deck_energy.csv")["elastic"][-1]
    (tmp_path / "end.h5").rename(tmp_path / "rest.h5")
    source = """&source id = 'heap', placement = 'packing', file = 'rest.h5', start = 1.0e-3,
      every_time = 1.0e-3, grains = 27 /\n"""
    run(tmp_path, deck(2.0e-2, box, source, OUTPUT))
    energy = read_history(tmp_path / "deck_energy.csv")
    assert energy["entered"][-1] == pytest.approx(before, rel=1e-6)
    assert energy["elastic"][-1] == pytest.approx(before, rel=1e-6)
    assert energy["elastic_tangential"][-1] > 0.0
    assert np.abs(energy["friction"]).max() < 1e-6 * before
    assert energy["kinetic"].max() < 1e-8 * before


@pytest.mark.parametrize("kind", ["spheres", "shapes", "law"])
def test_threads_ranks_and_restarts_give_the_same_bits(tmp_path: Path, kind: str) -> None:
    """A run whose grains enter and leave repeats on threads, on ranks and from a checkpoint."""
    grains = {
        "spheres": lambda: f"semi_axes = {RADIUS}, scatter = 0.2",
        "shapes": lambda: mixed_shapes(tmp_path),
        "law": lambda: (
            f"semi_axes = {RADIUS}, size_law = 'rosin_rammler', size_middle = 4e-3, "
            "size_spread = 5.0, size_limits = 2.5e-3, 5e-3"
        ),
    }[kind]()
    text = filled(grains, t_end=0.12)
    run(tmp_path, text)
    fields = contents(tmp_path / "deck.h5")
    state = contents(tmp_path / "deck.chk.h5")
    half = sorted(tmp_path.glob("deck.chk.*.h5"))[0]
    half.rename(tmp_path / "half.h5")
    rows = (tmp_path / "deck_sources.csv").read_text(), (tmp_path / "deck_sinks.csv").read_text()
    run(tmp_path, text, threads=2)
    assert contents(tmp_path / "deck.h5") == fields
    assert contents(tmp_path / "deck.chk.h5") == state
    run(tmp_path, text, ranks=2)
    assert contents(tmp_path / "deck.h5") == fields
    for file in ("sources", "sinks"):
        (tmp_path / f"deck_{file}.csv").unlink()
    run(tmp_path, text, "--restart=half.h5")
    end = [step.grains["x"].tobytes() for step in field_steps(tmp_path / "deck.h5")][-1]
    run(tmp_path, text, "--restart=half.h5", ranks=2)
    assert field_steps(tmp_path / "deck.h5")[-1].grains["x"].tobytes() == end
    whole = tmp_path / "again"
    whole.mkdir()
    for path in tmp_path.glob("*.h5"):
        (whole / path.name).write_bytes(path.read_bytes())
    run(whole, text)
    assert contents(whole / "deck.h5") == fields
    last = sorted(name for name in fields if name.endswith("grains/x"))[-1]
    assert fields[last] == end
    assert rows[0] == (whole / "deck_sources.csv").read_text()


BELT = """&surface id = 'belt', rectangle = -0.03, -0.015, 0.0, 0.05, -0.015, 0.0, 0.05, 0.015, 0.0,
  velocity = 0.3, 0.0, 0.0, material = 'glass' /
"""
FALLEN = """&sink id = 'fallen', region = 'plane', point = 0.0, 0.0, -0.02, normal = 0.0, 0.0, -1.0,
  every_time = 5.0e-3 /
"""


@pytest.mark.parametrize("kind", ["rolling", "turning", "adaptive"])
def test_what_contacts_and_damping_keep_goes_along(tmp_path: Path, kind: str) -> None:
    """On a moving belt, with models that remember, ranks and restarts give the same bits."""
    mode = "&relaxation damping = 'adaptive', dt_factor = 0.2 /\n" if kind == "adaptive" else MOVE
    rain = RAIN.format(grains=f"semi_axes = {RADIUS}, scatter = 0.2", rate="mass_rate = 0.2")
    text = deck(0.12, BELT, rain, FALLEN, OUTPUT, STORE.replace("5.0e-2", "3.0e-2"), mode=mode)
    if kind == "rolling":
        text = text.replace("friction = 0.5,", "friction = 0.5, " + ROLLING)
    if kind == "turning":
        text = text.replace("'hertz_mindlin'", "'mindlin_deresiewicz'")
    run(tmp_path, text)
    end = contents(tmp_path / "end.h5")
    fields = contents(tmp_path / "deck.h5")
    assert len(read_h5(tmp_path / "end.h5").id) > 100
    if kind != "adaptive":
        assert read_history(tmp_path / "deck_sinks.csv")["grains"][-1] > 5
    sorted(tmp_path.glob("deck.chk.*.h5"))[-1].rename(tmp_path / "part.h5")
    run(tmp_path, text, ranks=2)
    assert contents(tmp_path / "deck.h5") == fields
    run(tmp_path, text, "--restart=part.h5")
    assert contents(tmp_path / "end.h5") == end
    run(tmp_path, text, "--restart=part.h5", ranks=2)
    assert contents(tmp_path / "end.h5") == end


def test_the_packing_at_the_end_can_be_gone_on_from(tmp_path: Path) -> None:
    """It holds the grains that are left, groups without those that have gone; ids go on."""
    left, right = two_heaps(0.1)
    both = left.join(right)
    both.groups["ends"] = np.array([1, 2, 53, 54])
    write_h5(tmp_path / "both.h5", both)
    sink = """&sink id = 'right', region = 'box', lower = 0.05, -1.0, -1.0, upper = 1.0, 1.0, 1.0,
      every_time = 1.0e-3 /\n"""
    run(tmp_path, deck(2.0e-3, FLOOR, sink, OUTPUT, packing="both.h5"))
    end = read_h5(tmp_path / "end.h5")
    assert end.count == 27
    assert end.groups["ends"].tolist() == [1, 2]
    (tmp_path / "end.h5").rename(tmp_path / "next.h5")
    run(tmp_path, deck(2.0e-3, FLOOR, OUTPUT, packing="next.h5"))


def test_a_cell_takes_grains_over_its_faces(tmp_path: Path) -> None:
    """In a periodic cell grains enter clear of images, and leave by where they are folded."""
    cell = "&cell size = 0.02, 0.02, 0.06, origin = -0.01, -0.01, 0.0, periodic = 'a', 'b' /\n"
    source = f"""&source id = 's', semi_axes = {RADIUS}, number_rate = 2000.0, region = 'box',
      lower = -0.012, -0.012, 0.03, upper = 0.012, 0.012, 0.05, velocity = 0.3, 0.2, -0.5,
      every_time = 1.0e-2 /\n"""
    sink = """&sink id = 'trap', region = 'box', lower = -0.004, -0.004, -1.0,
      upper = 0.004, 0.004, 0.004, every_time = 5.0e-3 /\n"""  # fmt: skip
    run(tmp_path, deck(0.2, cell, FLOOR, source, sink, OUTPUT, STORE))
    fed = read_history(tmp_path / "deck_sources.csv")
    gone = read_history(tmp_path / "deck_sinks.csv")
    energy = read_history(tmp_path / "deck_energy.csv")
    assert gone["grains"][-1] > 10
    assert len(read_h5(tmp_path / "end.h5").id) == fed["grains"][-1] - gone["grains"][-1]
    assert np.abs(energy["relative_closure"]).max() < 0.02
    fields = contents(tmp_path / "deck.h5")
    run(tmp_path, deck(0.2, cell, FLOOR, source, sink, OUTPUT, STORE), ranks=2)
    assert contents(tmp_path / "deck.h5") == fields
