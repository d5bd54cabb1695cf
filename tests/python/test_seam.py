"""The mosaic of a seam: overlaps, the minimum cut, what stays of two tiles and how they rest."""

import itertools
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kept_tiles import take_tile

from talus.cli import main
from talus.faults import FaultError
from talus.images import shifts_of
from talus.packing import read_packing
from talus.seam import MOST_DEPTH, Band, cut_at, depths, mosaic, overlapped, overlaps, squares
from talus.tile_check import tile_facts
from talus.tile_join import assemble, band_of, check_pair, lay_out
from talus.tile_stamp import branches, read_stamp, solid_fraction


def random_band(rng: np.random.Generator, counts: tuple[int, int], pairs: int) -> Band:
    """Return a band of some grains and pairs by chance, the first grain of each side fixed."""
    every = np.array(list(itertools.product(range(counts[0]), range(counts[1]))))
    chosen = every[rng.choice(len(every), pairs, replace=False)]
    weight = tuple(rng.uniform(0.5, 2.0, count) for count in counts)
    fixed = tuple(np.arange(count) == 0 for count in counts)
    return Band(*chosen.T, rng.uniform(0.0, 0.5, pairs), weight, fixed)


def cost(band: Band, stay: tuple[np.ndarray, np.ndarray], price: float) -> float:
    """Volume lost and, at a price, overlapped; without bound where it must not be."""
    lost = sum(float(w[~s].sum()) for w, s in zip(band.weight, stay, strict=True))
    if any((f & ~s).any() for f, s in zip(band.fixed, stay, strict=True)):
        return np.inf
    both = stay[0][band.first] & stay[1][band.second]
    both &= ~(band.fixed[0][band.first] & band.fixed[1][band.second])
    if (both & (band.depth > MOST_DEPTH)).any():
        return np.inf
    return lost + price * float(overlaps(band)[both].sum())


def test_depth_of_ellipsoids() -> None:
    """Spheres: 1 - r/(a + b). Ellipsoids that touch have none, also when all space is stretched."""
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (3, 1))
    a, b = np.array([1.0, 2.0, 0.5]), np.array([1.0, 0.5, 0.7])
    apart = np.array([[1.5, 0.0, 0.0], [0.0, 1.2, 1.6], [0.3, 0.4, 1.2]])
    one, other = (squares(np.tile(r[:, None], 3), upright) for r in (a, b))
    found = depths(apart, one, other)
    assert found == pytest.approx(1.0 - np.linalg.norm(apart, axis=1) / (a + b), abs=1e-12)
    stretch = np.array([[1.3, 0.2, 0.0], [-0.4, 0.8, 0.1], [0.3, 0.0, 2.0]])
    moved = [stretch @ part @ stretch.T for part in (one, other)]
    assert depths(apart @ stretch.T, *moved) == pytest.approx(found, abs=1e-12)
    quat = np.array([[np.cos(0.3), 0.0, 0.0, np.sin(0.3)]])  # by 0.6 about z
    long = squares(np.array([[2.0, 1.0, 1.0]]), quat)
    tip = 2.0 * np.array([[np.cos(0.6), np.sin(0.6), 0.0]])
    ball = squares(np.array([[1.0, 1.0, 1.0]]), upright[:1])
    assert depths(1.5 * tip, long, ball) == pytest.approx([0.0], abs=1e-12)


@pytest.mark.parametrize("price", [0.0, 1.0, 20.0, 1e9])
def test_the_cut_is_the_best_of_all_sets(price: float) -> None:
    """Against every set of small bands: the least volume lost and overlapped."""
    rng = np.random.default_rng(1)
    for _ in range(25):
        band = random_band(rng, (5, 4), 9)
        stay = cut_at(band, price)
        sets = itertools.product((False, True), repeat=9)
        least = min(cost(band, (np.array(s[:5]), np.array(s[5:])), price) for s in sets)
        assert cost(band, stay, price) == pytest.approx(least, rel=1e-9)


def test_the_volume_is_kept() -> None:
    """The price is such that the volume wanted stays, to a grain; less of it overlaps than at 0."""
    band = random_band(np.random.default_rng(2), (200, 200), 200)
    total = sum(w.sum() for w in band.weight)
    stay = mosaic(band, 0.85 * total)
    kept = sum(float(w[s].sum()) for w, s in zip(band.weight, stay, strict=True))
    assert kept / total == pytest.approx(0.85, abs=2.0 / 400)
    assert overlapped(band, stay) < 0.5 * overlapped(band, cut_at(band, 0.0))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with two tiles."""
    folder = tmp_path_factory.mktemp("seam")
    for seed in ("1", "2"):
        take_tile(f"seam_{seed}", folder / f"tile_{seed}.h5")
    return folder


@pytest.mark.parametrize("axis", [0, 1])
def test_a_tile_beside_itself_is_the_repeated_one(axis: int, made: Path) -> None:
    """Both halves of a band of one tile fit: nothing is lost, no contact is missing."""
    tile = read_packing(made / "tile_1.h5")
    sides = lay_out((tile, tile), axis, 2e-3)
    edge = tile.cell[axis, axis]
    stay = sides.x[0][:, axis], sides.x[1][:, axis] - edge
    joined = assemble(sides, tuple((s >= 0.0) & (s < edge) for s in stay))
    times = np.ones(3, int)
    times[axis] = 2
    whole = tile.repeated(tuple(times))
    assert joined.count == whole.count
    inside = (np.diff((whole.pairs > tile.count).astype(int), axis=1) == 0)[:, 0]
    inside &= shifts_of(whole)[:, axis] == 0  # those between both halves begin anew
    assert len(joined.pairs) == inside.sum() < len(whole.pairs)
    assert solid_fraction(joined) == pytest.approx(solid_fraction(whole), rel=1e-12)
    size = [np.sort(np.linalg.norm(part, axis=1))
            for part in (joined.tangential, whole.tangential[inside])]  # fmt: skip
    assert np.allclose(*size, rtol=1e-12)
    long = [np.sort(np.linalg.norm(part, axis=1))
            for part in (branches(joined), branches(whole)[inside])]  # fmt: skip
    assert np.allclose(*long)


def test_join(made: Path, capsys: pytest.CaptureFixture) -> None:
    """The joined tile rests, bears the stress and keeps density and contacts; it is a tile."""
    names = [str(made / f"tile_{seed}.h5") for seed in (1, 2)]
    capsys.readouterr()
    assert main(["pack", "join", *names, "-o", str(made / "joined.h5"), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    joined, stamp = read_packing(made / "joined.h5"), read_stamp(made / "joined.h5")
    tiles = [read_packing(Path(name)) for name in names]
    mean = np.mean([solid_fraction(tile) for tile in tiles])
    assert solid_fraction(joined) == pytest.approx(mean, rel=0.01)
    assert joined.cell.diagonal() == pytest.approx([0.05, 0.0125, 0.0125], rel=2e-3)
    assert facts["energy lost / elastic"] < 0.6  # half of so few grains are beside a seam
    assert facts["coordination number / mean of both"] > 0.9
    assert np.diag(stamp.stress) == pytest.approx(np.full(3, 100e3), rel=0.01)
    assert tile_facts(joined, stamp)["unbalanced over mean contact force"] < 1e-6


def test_what_stays_keeps_the_volume(made: Path) -> None:
    """Of two different tiles the mosaic keeps the volume to a grain."""
    tiles = tuple(read_packing(made / f"tile_{seed}.h5") for seed in (1, 2))
    sides = lay_out(tiles, 0, 7.35e-3)
    band = band_of(sides, 7.35e-3)
    volume = sum(solid_fraction(tile) * np.linalg.det(tile.cell) for tile in tiles)
    joined = assemble(sides, mosaic(band, volume))
    assert solid_fraction(joined) * np.linalg.det(joined.cell) == pytest.approx(volume, rel=2e-3)
    assert band.depth.min() > 0.0 and (band.depth > MOST_DEPTH).any()


def test_tiles_that_do_not_meet(made: Path) -> None:
    """Other faces, slanted cells (E686), materials and stresses (E687), shapes (E688)."""
    tile, stamp = read_packing(made / "tile_1.h5"), read_stamp(made / "tile_1.h5")
    check_pair((tile, tile), (stamp, stamp), 0)
    wider, slanted = (replace(tile, cell=tile.cell.copy()) for _ in range(2))
    wider.cell[1, 1] *= 1.0001
    check_pair((tile, wider), (stamp, stamp), 1)
    slanted.cell[2, 0] = 1e-4
    for other in (wider, slanted):
        with pytest.raises(FaultError, match="E686"):
            check_pair((tile, other), (stamp, stamp), 0)
    stress = stamp.stress * np.array([1.0, 1.03, 1.0])
    for change in ({"friction": 0.4}, {"young": 3e9}, {"density": 2600.0}, {"stress": stress}):
        with pytest.raises(FaultError, match="E687"):
            check_pair((tile, tile), (stamp, replace(stamp, **change)), 0)
    with pytest.raises(FaultError, match="E688"):
        check_pair((tile, replace(tile, skew=tile.skew + 0.1)), (stamp, stamp), 0)


def test_a_tile_that_is_too_short(made: Path, capsys: pytest.CaptureFixture) -> None:
    """E686: two bands leave no grains of a tile's own."""
    words = ["pack", "join", str(made / "tile_1.h5"), str(made / "tile_1.h5")]
    assert main([*words, "--axis", "y", "-o", str(made / "no.h5")]) == 1
    assert "E686" in capsys.readouterr().err
    assert main([*words, "--band", "7", "-o", str(made / "no.h5")]) == 1
    assert "two bands take" in capsys.readouterr().err
