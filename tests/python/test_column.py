"""Columns: a stack is the repeated tile, replays give the stress of a bed, it rests, it repeats."""

import json
from pathlib import Path

import numpy as np
import pytest
from kept_tiles import take_tile

from talus.checksum import edited
from talus.cli import main
from talus.column import Bed, Column, Replays, border_stresses, check_column, make_column
from talus.column_measure import Profile, bearing, slice_stress, weight_stress
from talus.column_stack import blended, cut, folded, like_tile, moved_by, stack
from talus.column_stamp import read_column_stamp
from talus.faults import FaultError
from talus.images import shifts_of
from talus.packing import FIXED, Packing, make_packing, read_h5
from talus.tile_stamp import Forces, branches, read_stamp

HEIGHT, SURCHARGE = 0.045, 100.0


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a tile and its column."""
    folder = tmp_path_factory.mktemp("column")
    take_tile("column", folder / "tile.h5")
    words = ["--height", str(HEIGHT), "--surcharge", str(SURCHARGE)]
    name = str(folder / "column.h5")
    assert main(["pack", "column", str(folder / "tile.h5"), *words, "-o", name]) == 0
    return folder


def contact_set(packing: Packing) -> dict[tuple, np.ndarray]:
    """Return forces of contacts by ids and shift, the lower id first."""
    found = {}
    rows = zip(packing.pairs, shifts_of(packing), packing.tangential, strict=True)
    for pair, shift, force in rows:
        sign = 1 if pair[0] < pair[1] else -1
        found[(*sorted(pair.tolist()), *(sign * shift).tolist())] = sign * force
    return found


def test_stack_is_the_repeated_tile(made: Path) -> None:
    """Layers without replay are the tile repeated along z, but for the contacts over the ends."""
    tile = read_h5(made / "tile.h5")
    layer = like_tile(tile, tile)
    whole, repeated = stack([layer] * 3), tile.repeated((1, 1, 3))
    assert np.array_equal(whole.id, repeated.id)
    assert np.allclose(whole.x, repeated.x, atol=1e-15)
    one, other = contact_set(whole), contact_set(repeated)
    inside = {key: force for key, force in other.items() if key[4] == 0}
    assert one.keys() == inside.keys()
    assert len(other) > len(inside)
    assert max(np.abs(one[key] - inside[key]).max() for key in one) < 1e-18


def test_folding_keeps_branches(made: Path) -> None:
    """Grains moved by whole edges, and folded back, keep their branch vectors."""
    tile = read_h5(made / "tile.h5")
    edges = np.random.default_rng(1).integers(-2, 3, (tile.count, 3))
    moved = moved_by(tile, edges)
    assert np.allclose(branches(moved), branches(tile), atol=1e-15)
    assert np.abs(like_tile(moved, tile).x - tile.x).max() < 1e-15
    back = folded(moved, (0, 1, 2))
    assert np.abs(back.x - folded(tile, (0, 1, 2)).x).max() < 1e-15
    assert np.array_equal(shifts_of(back), shifts_of(folded(tile, (0, 1, 2))))


def test_cut(made: Path) -> None:
    """The floor is fixed below z = 0, nothing lies above the surface, numbers stay."""
    tile = read_h5(made / "tile.h5")
    whole = stack([like_tile(tile, tile)] * 3)
    bed = cut(whole, 0.004, 0.04)
    assert ((bed.x[:, 2] < 0.0) == (bed.kind == FIXED)).all()
    assert bed.x[:, 2].max() < 0.04
    assert np.array_equal(bed.groups["floor"], np.sort(bed.id[bed.kind == FIXED]))
    place = whole.x[np.searchsorted(whole.id, bed.id)] - bed.x
    assert np.allclose(place[:, 2], 0.004)
    held = np.isin(bed.pairs, bed.groups["floor"]).all(axis=1)
    assert not held.any()


def test_column_bears_its_weight(made: Path) -> None:
    """The vertical stress is density x depth + surcharge, the lateral one that of the replays."""
    column, stamp = read_h5(made / "column.h5"), read_column_stamp(made / "column.h5")
    tile = read_stamp(made / "tile.h5")
    middle = 0.5 * (stamp.z[1:] + stamp.z[:-1])
    weight = tile.density * 9.81 * tile.solid_fraction
    exact = SURCHARGE + weight * (HEIGHT - middle)
    vertical = stamp.stress[:, 2, 2]
    assert np.abs(vertical / exact - 1.0).mean() < 0.02
    assert np.abs(vertical / weight_stress(column, stamp.z, tile.density * 9.81, SURCHARGE)
                  - 1.0).max() < 1e-3  # fmt: skip
    assert stamp.way < 1e-2
    assert stamp.rows == tile_count(made)
    area = column.cell[0, 0] * column.cell[1, 1]
    assert ((column.id - 1) // stamp.rows).max() == stamp.layers - 1
    assert column.surcharge.sum() == pytest.approx(SURCHARGE * area, rel=1e-9)
    assert not column.v.any()


def tile_count(made: Path) -> int:
    """Grains of the tile."""
    return read_h5(made / "tile.h5").count


def test_column_repeats(made: Path, capsys: pytest.CaptureFixture) -> None:
    """Side by side: each contact as often, the same coordination; along z it is refused."""
    column, name = read_h5(made / "column.h5"), str(made / "column.h5")
    words = ["pack", "edit", name, "-o", str(made / "bed.h5"), "--repeat"]
    assert main([*words, "3", "2", "1"]) == 0
    bed = read_h5(made / "bed.h5")
    assert len(bed.pairs) == 6 * len(column.pairs)
    assert bed.count == 6 * column.count
    lengths = [np.sort(np.linalg.norm(branches(p), axis=1)) for p in (column, bed)]
    assert np.abs(np.repeat(lengths[0], 6) - lengths[1]).max() < 1e-15
    assert bed.surcharge.sum() == pytest.approx(6.0 * column.surcharge.sum())
    capsys.readouterr()
    assert main([*words, "1", "1", "2"]) == 1
    assert "E538" in capsys.readouterr().err


def test_check_column(made: Path, capsys: pytest.CaptureFixture) -> None:
    """The check tells stresses and unrest of a column; a changed one is refused."""
    assert main(["pack", "check-tile", str(made / "column.h5"), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["unbalanced over mean contact force"] < 2e-5
    assert np.abs(np.array(facts["over the weight above + surcharge"]) - 1.0).max() < 1e-3
    (made / "changed.h5").write_bytes((made / "column.h5").read_bytes())
    with edited(made / "changed.h5") as file:
        file["contacts/tangential"][0, 0] += 1e-9
    with pytest.raises(FaultError, match="E516.*hash"):
        read_column_stamp(made / "changed.h5")
    with pytest.raises(FaultError, match="E516.*no column"):
        read_column_stamp(made / "tile.h5")


def test_borders(made: Path) -> None:
    """Borders bear the weight above them and the surcharge, the surface something at least."""
    tile, stamp = read_h5(made / "tile.h5"), read_stamp(made / "tile.h5")
    weight = stamp.density * 9.81 * stamp.solid_fraction
    edge = tile.cell[2, 2]
    found = border_stresses(tile, stamp, Bed(2.25 * edge, 500.0), 0.25 * edge, 3)
    assert found == pytest.approx(500.0 + weight * edge * np.array([2.5, 1.5, 0.5, 0.0]))
    found = border_stresses(tile, stamp, Bed(1.76 * edge, 0.0), 0.25 * edge, 3)
    assert found[-2:] == pytest.approx(weight * edge * np.array([0.01, 0.005]))
    found = border_stresses(tile, stamp, Bed(2.5 * edge, 0.0), 0.25 * edge, 3)
    assert found[-2:] == pytest.approx(weight * edge * np.array([0.75, 0.1]))


def test_blended(made: Path) -> None:
    """Between a tile and one strained along z, heights and forces go over linearly."""
    tile = like_tile(read_h5(made / "tile.h5"), read_h5(made / "tile.h5"))
    high = tile.take(np.arange(tile.count))
    high.x, high.cell = tile.x * [1.0, 1.0, 1.02], tile.cell * [[1.0], [1.0], [1.02]]
    high.corner = tile.corner * [1.0, 1.0, 1.02]
    high.tangential = 3.0 * tile.tangential
    layer = blended(tile, tile, high)
    edge = tile.cell[2, 2]
    part = (tile.x[:, 2] - tile.corner[2]) / edge
    assert layer.cell[2, 2] == pytest.approx(1.01 * edge)
    assert layer.x[:, 2] == pytest.approx(edge * (part + 0.01 * part**2), abs=1e-12)
    assert np.allclose(layer.x[:, :2], (tile.x - tile.corner)[:, :2], atol=1e-15)
    one, other = contact_set(tile), contact_set(layer)
    assert one.keys() == other.keys()
    size = {key: np.linalg.norm(one[key]) for key in one}
    factor = [np.linalg.norm(other[key]) / size[key] for key in one if size[key] > 1e-12]
    assert min(factor) >= 1.0 - 1e-9
    assert max(factor) <= 3.0 + 1e-9
    assert np.mean(factor) == pytest.approx(2.0, abs=0.1)
    half = blended(tile, tile, high, 0.5)
    up = np.maximum(part - 0.5, 0.0)
    wanted = part + 0.02 * (np.minimum(part, 0.5) ** 2 + up)
    assert half.x[:, 2] == pytest.approx(edge * wanted, abs=1e-12)
    assert half.cell[2, 2] == pytest.approx(1.015 * edge)
    other = contact_set(half)
    high_up = [np.linalg.norm(other[key]) / size[key] for key in one if size[key] > 1e-12]
    assert max(high_up) == pytest.approx(3.0)
    assert np.allclose(blended(tile, tile, tile).x, tile.x - tile.corner, atol=1e-15)


def test_refused(made: Path, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """A slanted tile, too many layers, no tile, and wrong words."""
    tile, stamp = read_h5(made / "tile.h5"), read_stamp(made / "tile.h5")
    slanted = tile.take(np.arange(tile.count))
    slanted.cell = tile.cell + [[0.0, 0.0, 0.0], [1e-3, 0.0, 0.0], [0.0, 0.0, 0.0]]
    with pytest.raises(FaultError, match="E536.*no box"):
        make_column(slanted, stamp, Bed(0.04), tmp_path, print)
    with pytest.raises(FaultError, match="E536.*layers"):
        make_column(tile, stamp, Bed(40.0), tmp_path, print)
    words = ["pack", "column", str(made / "column.h5"), "--height", "0.1"]
    assert main([*words, "-o", str(tmp_path / "new.h5")]) == 1
    assert "E516" in capsys.readouterr().err
    assert main([*words, "-o", str(tmp_path / "new.txt")]) == 1
    assert main([*words, "--surcharge", "-1", "-o", str(tmp_path / "new.h5")]) == 1
    assert "E500" in capsys.readouterr().err


def test_bad_columns_are_told(made: Path) -> None:
    """A column that moved far or is not in balance is E537."""
    column, stamp = read_h5(made / "column.h5"), read_column_stamp(made / "column.h5")
    tile, bed = read_stamp(made / "tile.h5"), Bed(HEIGHT, SURCHARGE)
    profile = Profile(stamp.z, stamp.stress, np.ones(len(stamp.z) - 1))
    good = Column(column, profile, 3, 0.004, stamp.replayed, np.full(9, 1e-3))
    check_column(good, tile, bed)
    far = Column(column, profile, 3, 0.004, stamp.replayed, np.full(9, 0.02))
    with pytest.raises(FaultError, match="E537.*moved 0.02 mean"):
        check_column(far, tile, bed)
    with pytest.raises(FaultError, match="E537.*off the weight"):
        check_column(good, tile, Bed(HEIGHT, 2.0 * SURCHARGE))


def test_finished_stages_stay(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same column is made again without a run."""
    tile, stamp = read_h5(made / "tile.h5"), read_stamp(made / "tile.h5")

    def none(*_: object, **__: object) -> None:
        raise AssertionError("talus-dem was started")

    monkeypatch.setattr("talus.tile.subprocess.run", none)
    bed = Bed(HEIGHT, SURCHARGE)
    again = make_column(tile, stamp, bed, made / "column_stages", lambda _: None)
    assert np.array_equal(again.packing.x, read_h5(made / "column.h5").x)
    assert Replays(made, stamp, bed).rate(100.0) > 0.0


def test_slices_of_a_chain() -> None:
    """A chain of unequal branches: the stress of a slice is the mean force over the area."""
    pack = make_packing(np.array([[0.5, 0.5, z] for z in (0.0, 1.0, 3.0)]), np.full((3, 3), 0.4))
    pack.cell = np.diag([1.0, 2.0, 4.0])
    pack.pairs = np.array([[1, 2], [3, 2]])
    pack.tangential = np.zeros((2, 3))
    force = np.array([[0.0, 0.0, 6.0], [0.0, 0.0, -4.0]])
    branch = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -2.0]])
    forces = Forces(force, np.sign(branch), branch, np.zeros(2))
    stress = slice_stress(pack, forces, np.array([0.0, 0.5, 1.5, 3.5]))
    assert stress[:, 2, 2] == pytest.approx([3.0, 2.5, 1.5])
    assert not bearing(pack).any()
