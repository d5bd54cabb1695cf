"""Grains that break between membranes and in the corner of three walls."""

from pathlib import Path

import numpy as np
import pytest
from test_breakage import HEAD, LIMIT, OUTPUT, contents, masses, run

from talus.verification import field_steps, read_history, write_packing

RADIUS, HALF, CELLS = 1.0e-3, 2.5e-3, 6  # of the grain, of the sheets [m], cells of a side
MEMBRANE = """&membrane id = '{name}', file = '{name}.stl', material = 'quartz', young = {young},
  thickness = 1.0e-4, density = 1000.0, pressure = 1.0e6, curve = 'rise',
  inside = 0.0, 0.0, 1.0e-3, damping = 2.0e4 /
"""
RISE = "&curve id = 'rise', times = 0.0, 1.0, values = 0.0, 2.0e3 /\n"


def write_sheet(path: Path, height: float, aside: tuple[float, float], cells: int = CELLS) -> None:
    """Write a square of triangles as binary STL, its cells moved aside."""
    place = np.linspace(-HALF, HALF, cells + 1)
    node = np.stack([*np.meshgrid(place, place, indexing="ij"), np.full((cells + 1,) * 2, height)],
                    -1)  # fmt: skip
    node[1:-1, 1:-1, :2] += aside
    a, b, c, d = node[:-1, :-1], node[1:, :-1], node[:-1, 1:], node[1:, 1:]
    triangles = np.concatenate([np.stack([a, b, d], 2), np.stack([a, d, c], 2)]).reshape(-1, 3, 3)
    record = np.dtype([("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("more", "<u2")])
    rows = np.zeros(len(triangles), record)
    rows["corner"] = triangles
    path.write_bytes(b"sheet".ljust(80) + np.uint32(len(rows)).tobytes() + rows.tobytes())


def squeeze(
    folder: Path, words: str, *options: str, threads: int = 1, ranks: int = 1,
    strength: float = 5.0e5, young: float = 2.0e8,
) -> None:  # fmt: skip
    """Press a sphere between two membranes whose pressure rises, to its break and beyond."""
    write_packing(folder / "pack.h5", np.array([[0.0, 0.0, RADIUS]]), np.full((1, 3), RADIUS))
    skins = [MEMBRANE.format(name=name, young=young) for name in ("below", "above")]
    words = f"check_every = 1, {words}"
    run(folder, *skins, RISE, OUTPUT, words=words, smallest=1.5e-3, strength=strength,
        t_end=2.1e-4, options=options, threads=threads, ranks=ranks)  # fmt: skip


def smooth(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave friction and most of the damping out of the decks, and write ten times as many rows."""
    text = HEAD.replace("friction = 0.5", "friction = 0.0").replace("1.0e-5 /", "1.0e-7 /")
    text = text.replace("damping_ratio = 0.1", "damping_ratio = 0.01")
    monkeypatch.setattr("test_breakage.HEAD", text)


SOFT, STIFF = 2.0e8, 5.0e10  # of the sheets [Pa]; stiff ones stay so flat that saddles touch
PLACES = [((2.0e-4, -2.0e-4), SOFT, "nominal"), ((1.0e-4, 5.0e-5), SOFT, "nominal"),
          ((0.0, 0.0), SOFT, "nominal"), ((0.0, 0.0), STIFF, "nominal"),
          ((2.0e-4, -2.0e-4), SOFT, "octahedral")]  # fmt: skip


@pytest.mark.parametrize(("aside", "young", "criterion"), PLACES)
def test_membranes_break_grains_as_plates_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, aside: tuple[float, float], young: float,
    criterion: str,
) -> None:  # fmt: skip
    """On a face, at an edge, upon a corner: the force of all contacts of a membrane counts."""
    smooth(monkeypatch)
    for name, height in (("below", 0.0), ("above", 2.0 * RADIUS)):
        write_sheet(tmp_path / f"{name}.stl", height, aside)
    weaker = 1.0 if criterion == "nominal" else 0.9  # before it slides to an edge
    squeeze(tmp_path, f"criterion = '{criterion}'", strength=weaker * 5.0e5, young=young)
    event = read_history(tmp_path / "deck_broken.csv")
    assert list(event["id"]) == [1]
    rows = read_history(tmp_path / "deck_surfaces.csv")
    before = rows["time"] < event["time"][0]
    force = np.zeros((2, 3))
    for k in range(2):
        mine = (rows["surface"] == k + 1) & before
        force[k] = [rows[f"force_{axis}"][mine][-1] for axis in "xyz"]
    size = np.linalg.norm(force, axis=1)
    stress = size.max() / (2.0 * RADIUS) ** 2
    if criterion == "octahedral":  # one contact a side, whose force goes through the centre
        tensor = RADIUS * sum(np.outer(f, f) / s for f, s in zip(force, size, strict=True))
        tensor /= 4.0 / 3.0 * np.pi * RADIUS**3
        stress = np.linalg.norm(tensor - np.trace(tensor) / 3.0 * np.eye(3)) / np.sqrt(3.0) / 0.9
    assert stress == pytest.approx(event["strength"][0], rel=0.01)  # as much as a row adds
    assert event["stress"][0] == pytest.approx(event["strength"][0], rel=0.01)
    assert read_history(tmp_path / "deck_breakage.csv")["fragments"][-1] == 14
    assert read_history(tmp_path / "deck_energy.csv")["relative_closure"][-1] < 2e-3


def test_membranes_threads_restarts_ranks(tmp_path: Path) -> None:
    """A break between membranes: threads and a restart change no bit, ranks no grain."""
    for name, height in (("below", 0.0), ("above", 2.0 * RADIUS)):
        write_sheet(tmp_path / f"{name}.stl", height, (1.0e-4, 5.0e-5))
    squeeze(tmp_path, "seed = 1")
    names = ("broken", "breakage", "surfaces", "energy")
    texts = {name: (tmp_path / f"deck_{name}.csv").read_text() for name in names}
    end = contents(tmp_path / "end.h5")
    assert len(read_history(tmp_path / "deck_broken.csv")["id"]) == 1
    kept = [path.rename(tmp_path / f"kept{path.name}") for path in tmp_path.glob("deck.chk.*.h5")]
    for options, threads in (((), 2), ((f"--restart={sorted(kept)[-2].name}",), 1)):
        squeeze(tmp_path, "seed = 1", *options, threads=threads)
        assert contents(tmp_path / "end.h5") == end
        assert {name: (tmp_path / f"deck_{name}.csv").read_text() for name in names} == texts
    event = read_history(tmp_path / "deck_broken.csv")
    squeeze(tmp_path, "seed = 1", ranks=2)
    two = read_history(tmp_path / "deck_broken.csv")
    assert list(two["id"]) == list(event["id"])
    for key in ("time", "stress", "force"):
        assert two[key] == pytest.approx(event[key], rel=1e-3)


def corner(folder: Path, words: str) -> None:
    """Press a small sphere into the corner of three walls by a large one that is driven."""
    x = np.array([[1.0, 1.0, 1.0]]) * RADIUS
    large = 3.0 * RADIUS
    x = np.vstack([x, x + (RADIUS + large) / np.sqrt(3.0)])
    write_packing(folder / "pack.h5", x, np.array([[RADIUS] * 3, [large] * 3]),
                  omega=np.zeros((2, 3)), kind=np.array([0, 1], dtype=np.int32))  # fmt: skip
    walls = "".join(
        f"&wall id = '{axis}', point = 0.0, 0.0, 0.0, normal = {normal}, material = 'quartz' /\n"
        for axis, normal in (("x", "1.0, 0.0, 0.0"), ("y", "0.0, 1.0, 0.0"), ("z", "0.0, 0.0, 1.0"))
    )
    driven = "&driven ids = 2, velocity = -0.3, -0.3, -0.3 /\n"
    run(folder, walls, driven, LIMIT, OUTPUT.replace("1.0e-4", "1.0e-7"), words=words,
        smallest=1.5e-3, t_end=1.0e-4)  # fmt: skip


@pytest.mark.parametrize("criterion", ["nominal", "octahedral"])
def test_a_grain_breaks_in_a_corner_of_three_walls(tmp_path: Path, criterion: str) -> None:
    """Four contacts, those with walls alike: mass, momentum, energy; fragments are in the grain."""
    corner(tmp_path, f"check_every = 1, criterion = '{criterion}'")
    event = read_history(tmp_path / "deck_broken.csv")
    assert list(event["id"]) == [1]
    rows = read_history(tmp_path / "deck_breakage.csv")
    assert rows["fragments"][-1] == 14
    steps = field_steps(tmp_path / "deck.h5")
    assert steps[0].grains["id"].size == 2
    first = next(step for step in steps if step.time >= event["time"][0])
    assert first.time - event["time"][0] < 1.1e-7
    born = first.grains["id"] > 2
    place = np.column_stack([event[axis] for axis in "xyz"])[0]
    reach = first.grains["axes"][born, 0]
    away = np.linalg.norm(first.grains["x"][born] - place, axis=1)
    assert born.sum() == 14
    assert (away + reach).max() < RADIUS * (1.0 + 1e-4)  # they have moved for a step
    start, kept = masses(steps[0].grains)[0], masses(first.grains)[born].sum()
    assert kept + rows["fines_mass"][-1] == pytest.approx(start, rel=1e-14)
    held = np.array([-rows[f"momentum_{axis}"][-1] for axis in "xyz"]) / rows["fines_mass"][-1]
    assert held == pytest.approx(held[0], rel=1e-6)
    energy = read_history(tmp_path / "deck_energy.csv")
    assert energy["relative_closure"][-1] < 5e-3
    assert energy["released"][-1] > 0.0
