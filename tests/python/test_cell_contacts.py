"""Contacts in packings of periodic cells: runs go on from them, repeated cells keep them."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from talus.cli import main
from talus.faults import FaultError
from talus.generate import cloud, uniform_sizes
from talus.images import nearest_shifts, reduced, shifts_of
from talus.packing import Packing, check_packing, make_packing, read_h5, write_h5
from talus.programs import find_program
from talus.verification import field_steps, launcher, read_history

DECK = """&run       title = 'Grains in a cell', t_end = {t_end} /
&material  id = 'glass', density = 2500.0, young = 1.0e9, poisson = 0.25 /
&contact   between = 'glass', 'glass', law = 'hertz_mindlin', friction = 0.5, DASHPOT /
&particles file = '{source}.h5', material = 'glass' /
&cell      {cell} /
&output    every_time = 1.0, fields = 'contacts', packing = '{name}_end.h5' /
&history   every_time = 1.0e-4 /
{mode}
"""
DYNAMIC = "&dynamics dt_factor = 0.2 /"
PRESS = f"""&cell_stress component = 'mean', stress = 50.0e3, rate = 4.0, tolerance = 0.05 /
&cell_rate component = 'xz', rate = 2.0 /
{DYNAMIC}"""
REST = """&relaxation damping = 'adaptive', dt_factor = 0.2 /
&equilibrium unbalanced = 1.0e-8, energy_ratio = 1.0e-12, check_every = 200 /"""


def run(
    folder: Path, name: str, source: str, mode: str = DYNAMIC, t_end: float = 1e-3, cell: str = "",
    ranks: int = 1, damping: float = 0.3,
) -> str:  # fmt: skip
    """Run from source.h5 to name_end.h5; return what is printed."""
    deck = DECK.format(name=name, source=source, mode=mode, t_end=t_end, cell=cell)
    deck = deck.replace("DASHPOT", f"damping_ratio = {damping}")
    (folder / f"{name}.nml").write_text(deck)
    first = launcher(ranks) if ranks > 1 else []
    words = [*first, str(find_program("talus-dem")), f"{name}.nml", "--threads=1"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with 60 spheres sheared and pressed in a cell, and the same at rest."""
    folder = tmp_path_factory.mktemp("cell")
    sizes = uniform_sizes(60, 0.2, np.random.default_rng(3))
    pack = cloud(sizes, np.full(3, 11e-3), np.full(3, 1e-3), seed=7, periodic=True)
    write_h5(folder / "cloud.h5", pack)
    run(folder, "press", "cloud", PRESS, 0.15)
    run(folder, "rest", "press_end", REST, 0.3)
    return folder


def contacts(folder: Path, name: str, step: int) -> dict[tuple, np.ndarray]:
    """Return forces of contacts on the second grain [N] by both ids and the normal's octant."""
    c = field_steps(folder / f"{name}.h5")[step].contacts
    keys = zip(c["ids"].tolist(), np.sign(c["normal"]).tolist(), strict=True)
    return {(*ids, *octant): f for (ids, octant), f in zip(keys, c["force"], strict=True)}


def difference(one: dict[tuple, np.ndarray], other: dict[tuple, np.ndarray]) -> float:
    """Return the largest difference of a force over the mean force; contacts are the same."""
    assert one.keys() == other.keys()
    apart = max(float(np.linalg.norm(one[key] - other[key])) for key in one)
    return apart / float(np.mean([np.linalg.norm(f) for f in one.values()]))


def bare(packing: Packing) -> Packing:
    """Return the packing without contacts."""
    fresh = packing.take(np.arange(packing.count))
    fresh.pairs, fresh.tangential, fresh.shift = fresh.pairs[:0], fresh.tangential[:0], None
    return fresh


def test_forces_go_on_in_motion(folder: Path) -> None:
    """Forces of contacts begin where they were, to round-off."""
    run(folder, "move", "press_end", damping=0.0)
    text = run(folder, "moved", "move_end", t_end=1e-4, damping=0.0)
    kept = read_h5(folder / "move_end.h5")
    number = len(kept.pairs)
    assert f"{number}   of these contacts begin with the tangential force" in text
    assert (kept.shift != 0).any(axis=1).sum() > 0.2 * number
    assert np.abs(kept.v).max() > 1e-4
    last = contacts(folder, "move", -1)
    # 1e-11: centres are folded over edges of 10 mm, overlaps are 1e-5 m
    assert difference(contacts(folder, "moved", 0), last) < 1e-11
    write_h5(folder / "without.h5", bare(kept))
    run(folder, "unsprung", "without", t_end=1e-4, damping=0.0)
    assert difference(contacts(folder, "unsprung", 0), last) > 0.1


def test_dashpots_are_no_springs(folder: Path) -> None:
    """What dashpots bear is not in the packing: the energy of springs goes on to round-off."""
    run(folder, "damped", "press_end", t_end=2e-4)
    run(folder, "damped_on", "damped_end", t_end=1e-4)
    rows = {name: read_history(folder / f"{name}_energy.csv") for name in ("damped", "damped_on")}
    for key in ("elastic_normal", "elastic_tangential"):
        assert abs(rows["damped_on"][key][0] / rows["damped"][key][-1] - 1.0) < 1e-11


def test_rest_lasts(folder: Path) -> None:
    """A pack at rest loses less than 1e-5 of its elastic energy; without contacts, much more."""
    loss = {}
    write_h5(folder / "rest_bare.h5", bare(read_h5(folder / "rest_end.h5")))
    nearest = read_h5(folder / "rest_end.h5")
    nearest.shift = None
    write_h5(folder / "rest_nearest.h5", nearest)
    for name, source in (("on", "end"), ("off", "bare"), ("near", "nearest")):
        run(folder, name, f"rest_{source}", t_end=2e-3)
        rows = read_history(folder / f"{name}_energy.csv")
        loss[name] = rows["friction"][-1] / rows["elastic"][0]
        loss[name] += rows["contact_damping"][-1] / rows["elastic"][0]
    assert loss["on"] < 1e-5
    assert loss["off"] > 1e-2
    # in a cell this wide the nearest image is the only one
    assert difference(contacts(folder, "near", 0), contacts(folder, "on", 0)) == 0.0


def test_repeated_cell_keeps_its_contacts(folder: Path) -> None:
    """2 x 2 x 2 cells: eight times the energy, the same stress and coordination, lasting rest."""
    line = ["pack", "edit", str(folder / "rest_end.h5"), "--repeat", "2", "2", "2", "-o"]
    assert main([*line, str(folder / "eight.h5")]) == 0
    one, eight = read_h5(folder / "rest_end.h5"), read_h5(folder / "eight.h5")
    assert len(eight.pairs) == 8 * len(one.pairs)
    run(folder, "single", "rest_end", t_end=5e-4)
    run(folder, "eightfold", "eight", t_end=5e-4)
    rows = {name: read_history(folder / f"{name}_energy.csv") for name in ("single", "eightfold")}
    for key in ("elastic_normal", "elastic_tangential"):
        assert abs(rows["eightfold"][key][0] / rows["single"][key][0] - 8.0) < 8e-12
    assert rows["eightfold"]["contacts"][0] == 8 * rows["single"]["contacts"][0]
    assert rows["eightfold"]["friction"][-1] < 1e-5 * rows["eightfold"]["elastic"][0]
    cell = {name: read_history(folder / f"{name}_cell.csv") for name in rows}
    keys = [f"stress_{a}{b}" for a in "xyz" for b in "xyz"]
    stress = {name: np.array([cell[name][key][0] for key in keys]) for name in rows}
    assert np.abs(stress["eightfold"] - stress["single"]).max() < 1e-12 * 50e3


def test_ranks_write_the_same_contacts(folder: Path) -> None:
    """Two ranks and one write the same contacts, images and forces."""
    for ranks in (1, 2):
        run(folder, f"ranks{ranks}", "press_end", t_end=2e-4, ranks=ranks)
    one, two = (read_h5(folder / f"ranks{ranks}_end.h5") for ranks in (1, 2))

    def table(packing: Packing) -> dict[tuple, np.ndarray]:
        keys = np.column_stack([packing.pairs, packing.shift]).tolist()
        return dict(zip(map(tuple, keys), packing.tangential, strict=True))

    assert difference(table(two), table(one)) < 1e-9  # sums of ranks come in another order


def test_open_faces_are_told(folder: Path) -> None:
    """Forces over faces that a run lacks are left out with a warning."""
    kept = read_h5(folder / "rest_end.h5")
    lost = int((kept.shift[:, 2] != 0).sum())
    text = run(folder, "open", "rest_end", t_end=1e-6, cell="periodic = 'a', 'b'")
    assert f"{lost} contacts of the packing lie over faces of its cell" in " ".join(text.split())
    used = len(kept.pairs) - lost
    assert f"{used}   of these contacts begin with the tangential force" in text


def row_of_two() -> Packing:
    """Return two spheres in a cell so narrow that they touch over two images."""
    pack = make_packing(np.array([[0.5, 5.0, 5.0], [2.46, 5.0, 5.0]]) * 1e-3, np.full((2, 3), 1e-3))
    pack.cell = np.diag([3.93e-3, 1e-2, 1e-2])
    pack.pairs = np.array([[1, 2], [1, 2]])
    pack.shift = np.array([[0, 0, 0], [-1, 0, 0]])
    pack.tangential = np.array([[0.0, 2e-2, 0.0], [0.0, 0.0, -3e-2]])
    return pack


def test_two_images_repeated(tmp_path: Path) -> None:
    """Contacts over two images become contacts of a chain, each with its own force."""
    chain = row_of_two().repeated((3, 1, 1))
    write_h5(tmp_path / "chain.h5", chain)
    found = sorted(
        [*pair, *shift, *force]
        for pair, shift, force in zip(
            chain.pairs.tolist(), chain.shift.tolist(), chain.tangential.tolist(), strict=True
        )
    )
    near, over = [0.0, 2e-2, 0.0], [0.0, 0.0, -3e-2]
    assert found == [
        [1, 2, 0, 0, 0, *near], [1, 6, -1, 0, 0, *over], [3, 2, 0, 0, 0, *over],
        [3, 4, 0, 0, 0, *near], [5, 4, 0, 0, 0, *over], [5, 6, 0, 0, 0, *near],
    ]  # fmt: skip
    text = run(tmp_path, "run", "chain", t_end=1e-7)
    assert "6   of these contacts begin with the tangential force of the packing (6 in" in text
    at = {key[:2]: force[1:].tolist() for key, force in contacts(tmp_path, "run", 0).items()}
    even, odd, ends = near[1:], [-force for force in over[1:]], over[1:]
    want = {(1, 2): even, (2, 3): odd, (3, 4): even, (4, 5): odd, (5, 6): even, (1, 6): ends}
    assert at.keys() == want.keys()
    for pair, force in want.items():
        assert np.allclose(at[pair], force, rtol=1e-9, atol=1e-12), pair


def test_numbers_of_a_repeated_cell() -> None:
    """Ids are row + N (i + n_x (j + n_y k)); a contact over a corner wraps around."""
    pack = row_of_two()
    pack.id, pack.pairs = np.array([30, 10]), np.array([[30, 10]])
    pack.shift, pack.tangential = np.array([[1, -1, 1]]), np.ones((1, 3))
    pack.surcharge = np.array([5.0, 0.0])
    many = pack.repeated((2, 3, 2))
    at = {int(i): x for i, x in zip(many.id, many.x, strict=True)}
    assert np.allclose(at[2 + 2 * (1 + 2 * (2 + 3 * 1))] - pack.x[0], pack.cell.T @ [1, 2, 1])
    assert many.surcharge[many.id % 2 == 0].tolist() == [5.0] * 12
    # 30 is row 2, 10 is row 1; from copy (1, 0, 1) to (2, -1, 2): copy (0, 2, 0) over all faces
    row = many.pairs[:, 0].tolist().index(2 + 2 * (1 + 2 * (0 + 3 * 1)))
    assert many.pairs[row, 1] == 1 + 2 * (0 + 2 * (2 + 3 * 0))
    assert many.shift[row].tolist() == [1, -1, 1]
    steps = many.shift @ many.cell
    branch = [at[b] + step - at[a] for (a, b), step in zip(many.pairs, steps, strict=True)]
    assert np.allclose(branch, pack.x[1] + pack.shift[0] @ pack.cell - pack.x[0])


def test_nearest_images_of_a_sheared_cell() -> None:
    """The nearest image is that of all within five edges, whatever the basis."""
    rng = np.random.default_rng(2)
    cell = np.array([[1.0, 0.0, 0.0], [3.4, 1.1, 0.0], [-2.2, 1.7, 0.9]])
    assert abs(np.linalg.det(reduced(cell)) - 1.0) < 1e-12
    apart = rng.uniform(0.0, 1.0, (200, 3)) @ cell - rng.uniform(0.0, 1.0, (200, 3)) @ cell
    every = np.indices((17, 17, 17)).reshape(3, -1).T - 8
    length = np.linalg.norm(apart[:, None] + (every @ cell)[None], axis=2).min(axis=1)
    found = np.linalg.norm(apart + nearest_shifts(apart, cell) @ cell, axis=1)
    assert np.allclose(found, length, rtol=1e-12)
    pack = row_of_two()
    pack.shift = None
    assert shifts_of(pack).tolist() == [[0, 0, 0]] * 2


def test_joined_packings_keep_what_fits() -> None:
    """A packing joined to one without its cell leaves contacts over faces behind."""
    base = make_packing(np.array([[0.0, 0.0, -0.01]]), np.full((1, 3), 1e-3), ids=np.array([9]))
    both = base.join(row_of_two())
    assert both.pairs.tolist() == [[1, 2]]
    assert both.shift is None
    check_packing(both, "")
    both = row_of_two().join(base)
    assert both.shift.tolist() == [[0, 0, 0], [-1, 0, 0]]
    other = row_of_two().renumbered(10)
    assert row_of_two().join(other).shift[2:].tolist() == [[0, 0, 0], [-1, 0, 0]]
    other.cell = 2.0 * other.cell
    assert len(row_of_two().join(other).pairs) == 3


@pytest.mark.parametrize(
    ("shift", "text"),
    [
        ([[0, 0], [0, 0]], "contacts: shift"),
        ([[0, 0, 0]], "contacts: shift"),
        ([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]], "of float64"),
        ([[0, 0, 0], [0, -4096, 0]], r"\[0, -4096, 0\] edges away"),
    ],
)
def test_bad_shifts(shift: list, text: str) -> None:
    """A shift that is no triple of small integers is refused; so is one without a cell."""
    pack = row_of_two()
    pack.shift = np.array(shift)
    with pytest.raises(FaultError, match=f"E504.*{text}"):
        check_packing(pack, "pack.h5")
    pack = row_of_two()
    pack.cell = None
    with pytest.raises(FaultError, match="no cell"):
        check_packing(pack, "pack.h5")


def test_a_pair_that_does_not_touch_yet_begins_without_a_force(tmp_path: Path) -> None:
    """Its tangential force of the packing is dropped: when it touches later the ledger closes."""
    pair = make_packing(np.array([[0.0, 0.0, 0.0], [2.0001e-3, 0.0, 0.0]]), np.full((2, 3), 1e-3))
    pair.v = np.array([[0.0, 0.0, 0.0], [-0.05, 0.0, 0.0]])
    pair.pairs, pair.tangential = np.array([[1, 2]]), np.array([[0.0, 1e-4, 0.0]])
    write_h5(tmp_path / "apart.h5", pair)
    cell = "size = 0.02, 0.02, 0.02, origin = -5.0e-3, -5.0e-3, -5.0e-3"
    run(tmp_path, "meet", "apart", t_end=1e-4, cell=cell)
    rows = read_history(tmp_path / "meet_energy.csv")
    assert rows["contacts"].max() == 1 or rows["contact_damping"][-1] > 0.0
    assert rows["relative_closure"].max() < 1e-3
    assert abs(rows["tangential_relaxation"][-1]) < 1e-12
