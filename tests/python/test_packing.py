"""Packings: counts and places of the benchmark's containers, editing, the two file forms."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from talus import generate, measure
from talus.cli import main
from talus.faults import FaultError
from talus.packing import (
    DRIVEN,
    FIXED,
    FREE,
    make_packing,
    read_h5,
    read_text,
    write_h5,
    write_packing_file,
    write_text,
)


@pytest.mark.parametrize(
    ("name", "fixed", "free"),
    [("small", 800, 1960), ("medium", 1020, 3240), ("large", 1248, 4840), ("wide", 2645, 19360)],
)
def test_counts(name: str, fixed: int, free: int) -> None:
    """The chapter's numbers of grains come out exactly."""
    packing = generate.penetration(name, seed=1)
    assert (packing.kind == FIXED).sum() == fixed
    assert (packing.kind == FREE).sum() == free
    assert packing.count == fixed + free
    assert len(np.unique(packing.id)) == packing.count
    assert len(packing.groups["container"]) == fixed
    assert len(packing.groups["free"]) == free


@pytest.mark.parametrize(
    ("name", "half"), [("small", 0.020), ("medium", 0.025), ("large", 0.030), ("wide", 0.0575)]
)
def test_walls(name: str, half: float) -> None:
    """Walls stand at +-25 (g+1)/10 mm, columns 5 mm apart, 23 rows from z = -25 mm, no corners."""
    packing = generate.penetration(name, seed=1)
    fixed = packing.x[packing.kind == FIXED]
    assert np.abs(fixed[:, :2]).max() == pytest.approx(half, abs=1e-12)
    west = fixed[np.isclose(fixed[:, 0], -half)]
    g = generate.GRID[name]
    assert len(west) == 23 * (g + 1)
    assert np.allclose(np.unique(west[:, 1].round(9)), (np.arange(g + 1) - 0.5 * g) * 5e-3)
    assert np.allclose(np.unique(west[:, 2].round(9)), -25e-3 + 5e-3 * np.arange(23))
    corners = np.isclose(np.abs(fixed[:, 0]), half) & np.isclose(np.abs(fixed[:, 1]), half)
    assert not corners.any()
    # the inner width of the chapter: between the surfaces of opposite walls
    assert 2 * (half - generate.WALL_RADIUS) == pytest.approx(5e-3 * (g + 1) - 4.95e-3)


def test_seed_decides() -> None:
    """The same seed gives the same bits, another seed other orientations."""
    one, again, other = (generate.penetration("small", seed) for seed in (3, 3, 4))
    assert np.array_equal(one.quat, again.quat)
    assert not np.allclose(one.quat, other.quat)


def test_ghosts_of_the_coupled_run(tmp_path: Path) -> None:
    """Without container grains above 61 mm 640 are left; the tool comes on top, group tool."""
    start, cut = tmp_path / "start.h5", tmp_path / "cut.h5"
    assert main(["pack", "penetration", "--container", "small", "-o", str(start)]) == 0
    edit = ["pack", "edit", str(start), "--drop-container-above", "0.061", "--tool", "-o", str(cut)]
    assert main(edit) == 0
    packing = read_h5(cut)
    assert (packing.kind == FIXED).sum() == len(packing.groups["container"]) == 640
    assert (packing.kind == FREE).sum() == 1960
    tool = packing.kind == DRIVEN
    assert packing.id[tool].tolist() == packing.groups["tool"].tolist()
    assert packing.axes[tool].tolist() == [list(generate.TOOL_AXES)]
    free_top = packing.x[packing.kind == FREE, 2].max()
    assert packing.x[tool][0, 2] > free_top


def test_keep_box(tmp_path: Path) -> None:
    """Grains whose centre lies in the box stay, with their groups; the rest go."""
    start, cut = tmp_path / "start.h5", tmp_path / "cut.h5"
    assert main(["pack", "penetration", "--container", "small", "-o", str(start)]) == 0
    limits = ["-0.01", "-0.02", "-0.03", "0.012", "0.02", "0.05"]
    assert main(["pack", "edit", str(start), "--keep-box", *limits, "-o", str(cut)]) == 0
    whole, part = read_h5(start), read_h5(cut)
    lower, upper = np.reshape([float(v) for v in limits], (2, 3))
    inside = np.all((whole.x >= lower) & (whole.x <= upper), axis=1)
    assert part.id.tolist() == whole.id[inside].tolist()
    assert np.isin(part.groups["container"], part.id).all()
    assert len(part.groups["container"]) == (part.kind == FIXED).sum() > 0


def test_level(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """Free grains that reach above a height go, fixed ones stay; a tilted axis counts."""
    turned = np.array([np.cos(np.pi / 4), np.sin(np.pi / 4), 0.0, 0.0])  # b upright
    x = np.array([[0.0, 0.0, 1.0], [5.0, 0.0, 1.0], [9.0, 0.0, 1.0]])
    bed = make_packing(x, np.tile([1.0, 3.0, 0.5], (3, 1)))
    bed.quat[1] = turned
    bed.kind[2], bed.x[2, 2] = FIXED, 8.0
    start, cut = tmp_path / "start.h5", tmp_path / "cut.h5"
    write_h5(start, bed)
    assert measure.tops(bed) == pytest.approx([1.5, 4.0, 8.5])
    assert main(["pack", "edit", str(start), "--level", "3.9", "-o", str(cut)]) == 0
    assert read_h5(cut).id.tolist() == [1, 3]


@pytest.mark.parametrize("periodic", [[], ["--periodic"]])
def test_room(periodic: list, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """A cloud without room is told a box that has it."""
    words = ["pack", "cloud", "--count", "300", "--axes", "1.4e-3", "1e-3", "7e-4",
             "--spread", "0.3", "-o", str(tmp_path / "cloud.h5"), *periodic]  # fmt: skip
    assert main([*words, "--box", "0.014", "0.014", "0.018"]) == 1
    said = capsys.readouterr().err
    box = re.search(r"--box (\S+ \S+ \S+) has room", said)[1].split()
    assert main([*words, "--box", *box]) == 0


def test_base_of_fixed_grains(tmp_path: Path) -> None:
    """A layer is moved, fixed and joined to another packing, numbered on, with its groups."""
    layer, base, both = (tmp_path / f"{name}.h5" for name in ("layer", "base", "both"))
    one = generate.lattice("sc", (3, 2, 1), 2e-3, np.full(3, 1e-3))
    one.groups["row"] = np.array([1, 2])
    write_h5(layer, one)
    shift = ["--shift", "0.001", "0.001", "-0.001"]
    assert main(["pack", "edit", str(layer), "--fix", *shift, "-o", str(base)]) == 0
    assert main(["pack", "edit", str(layer), "--join", str(base), "-o", str(both)]) == 0
    packing = read_h5(both)
    assert packing.id.tolist() == list(range(1, 13))
    assert packing.kind.tolist() == [FREE] * 6 + [FIXED] * 6
    assert packing.x[6:] == pytest.approx(one.x + [1e-3, 1e-3, -1e-3], abs=1e-15)
    assert sorted(packing.groups["row"].tolist()) == [1, 2, 7, 8]


def test_round_trip_is_exact(tmp_path: Path) -> None:
    """h5 -> text -> h5 keeps ids, kinds, axes, places, orientations and groups to the bit."""
    packing = generate.penetration("small", seed=7, layers=3)
    rng = np.random.default_rng(1)
    packing.x += rng.normal(size=packing.x.shape) * 1e-3
    write_h5(tmp_path / "a.h5", packing)
    write_text(tmp_path / "a.txt", read_h5(tmp_path / "a.h5"), "a comment")
    write_h5(tmp_path / "b.h5", read_text(tmp_path / "a.txt"))
    one, two = read_h5(tmp_path / "a.h5"), read_h5(tmp_path / "b.h5")
    for name in ("id", "kind", "axes", "x", "quat"):
        assert np.array_equal(getattr(one, name), getattr(two, name)), name
    assert one.groups.keys() == two.groups.keys()
    assert all(np.array_equal(one.groups[g], two.groups[g]) for g in one.groups)
    assert not list(tmp_path.glob("*.tmp"))


def test_faults_of_packings(tmp_path: Path) -> None:
    """Foreign files, broken rows and doubled ids are named with code and place."""
    bad = tmp_path / "bad.txt"
    bad.write_text("# comment\n1 0 1 1 1\n")
    with pytest.raises(FaultError, match="5 words instead of 13") as fault:
        read_text(bad)
    assert fault.value.code == "E502"
    assert f"{bad}:2" in str(fault.value)
    foreign = tmp_path / "foreign.h5"
    foreign.write_bytes(b"no hdf5")
    with pytest.raises(FaultError, match="E502"):
        read_h5(foreign)
    one = make_packing(np.zeros((1, 3)), np.ones((1, 3)))
    with pytest.raises(FaultError, match="E503"):
        one.join(one)


def test_periodic_cell(tmp_path: Path) -> None:
    """Grains of a periodic cloud keep apart over the faces; files keep the cell."""
    box, axes = np.array([12e-3, 14e-3, 16e-3]), np.array([1.2e-3, 1.0e-3, 0.8e-3])
    cloud = generate.cloud(np.ones(60), box, axes, seed=4, periodic=True)
    apart = cloud.x[:, None] - cloud.x[None]
    apart -= box * np.round(apart / box)
    length = np.linalg.norm(apart, axis=2) + np.eye(60)
    assert length.min() >= 2.4e-3
    assert (cloud.x.min(axis=0) < 1.2e-3).all()  # grains reach through the faces
    write_h5(tmp_path / "cloud.h5", cloud)
    again = read_h5(tmp_path / "cloud.h5")
    assert np.array_equal(again.cell, np.diag(box))
    assert np.array_equal(again.take(again.id < 9).cell, np.diag(box))
    assert generate.lattice("fcc", (2, 2, 2), 1e-3, axes).cell is None
    cell = generate.lattice("hcp", (2, 2, 2), 1e-3, axes, periodic=True).cell
    assert np.allclose(np.diag(cell), [2e-3, 2e-3 * np.sqrt(3.0), 2e-3 * np.sqrt(8.0 / 3.0)])
    with pytest.raises(FaultError, match="too wide for the box"):
        generate.cloud(np.ones(2), np.full(3, 4e-3), axes, seed=4, periodic=True)


def test_repeated_cell(tmp_path: Path) -> None:
    """A cell laid side by side is the same pile: the same distances across all its faces."""
    one = make_packing(
        np.array([[0.1, 0.2, 0.3], [0.9, 0.8, 0.6]]), np.full((2, 3), 0.05),
    )  # fmt: skip
    one.cell = np.array([[1.0, 0.0, 0.0], [0.2, 1.0, 0.0], [0.0, 0.0, 2.0]])
    one.groups = {"second": one.id[1:]}
    write_h5(tmp_path / "one.h5", one)
    line = ["pack", "edit", str(tmp_path / "one.h5"), "--repeat", "2", "1", "3", "-o"]
    assert main([*line, str(tmp_path / "many.h5")]) == 0
    many = read_h5(tmp_path / "many.h5")
    assert many.count == 12
    assert np.array_equal(many.id, np.arange(1, 13))
    assert np.array_equal(many.cell, one.cell * np.array([[2.0], [1.0], [3.0]]))
    assert np.array_equal(many.groups["second"], np.arange(2, 13, 2))
    inside = np.linalg.solve(one.cell.T, (many.x - one.x[(many.id - 1) % 2]).T).T
    places = np.rint(inside).astype(int)
    assert np.abs(inside - places).max() < 1e-14
    assert len(np.unique(places[::2], axis=0)) == 6
    assert places.max(axis=0).tolist() == [1, 0, 2]
    assert main([*line, str(tmp_path / "moved.h5"), "--shift", "0.5", "0", "-3"]) == 0
    moved = read_h5(tmp_path / "moved.h5")
    assert np.array_equal(moved.corner, [0.5, 0.0, -3.0])  # the cell goes with its grains
    assert np.allclose(moved.x - moved.corner, many.x)
    one.cell = None
    with pytest.raises(FaultError, match="E515"):
        one.repeated((2, 1, 1))
    write_h5(tmp_path / "bare.h5", one)
    line[2] = str(tmp_path / "bare.h5")
    assert main([*line, str(tmp_path / "none.h5")]) == 1


def test_lattice_and_cloud() -> None:
    """A lattice has its cells' sites; the bounding spheres of a cloud keep apart and inside."""
    axes = np.array([1.0, 0.8, 0.6]) * 1e-3
    assert generate.lattice("fcc", (2, 3, 4), 5e-3, axes).count == 4 * 24
    box = np.array([0.02, 0.02, 0.02])
    sizes = generate.uniform_sizes(60, 0.2, np.random.default_rng(3))
    cloud = generate.cloud(sizes, box, axes, seed=2)
    radius = cloud.axes.max(axis=1)
    apart = np.linalg.norm(cloud.x[:, None] - cloud.x[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    assert (apart >= radius[:, None] + radius[None] - 1e-15).all()
    assert (cloud.x - radius[:, None] >= -1e-15).all()
    assert (cloud.x + radius[:, None] <= box + 1e-15).all()
    layer = cloud.x[:, 2] // (2.0 * radius.max())
    assert (np.diff(layer) >= 0.0).all()
    with pytest.raises(FaultError, match="E512"):
        generate.cloud(np.ones(500), np.full(3, 5e-3), axes, seed=2, tries=5)


def test_hexagonal_lattice() -> None:
    """Every inner grain of hcp has twelve neighbours one pitch away."""
    x = generate.lattice("hcp", (5, 4, 4), 2.0, np.ones(3)).x
    apart = np.linalg.norm(x[:, None] - x[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    assert apart.min() == pytest.approx(2.0)
    inner = ((x > x.min(axis=0) + 2.1) & (x < x.max(axis=0) - 2.1)).all(axis=1)
    assert inner.sum() > 10
    assert (np.isclose(apart, 2.0).sum(axis=1)[inner] == 12).all()


def test_gradation_by_mass(tmp_path: Path) -> None:
    """Shares of the mass that pass the sieves are those asked for."""
    openings, passing = np.array([2e-3, 3e-3, 5e-3]), np.array([0.0, 0.4, 1.0])
    sizes = generate.sieved_sizes(5000, openings, passing)
    mass = sizes**3 / (sizes**3).sum()
    assert sizes.min() >= 2e-3
    assert sizes.max() <= 5e-3
    # 2e-3: of 5000 middles of equal shares the largest grains are a few
    assert mass[sizes < 3e-3].sum() == pytest.approx(0.4, abs=2e-3)
    half = np.sqrt(3e-3 * 5e-3)  # half of what lies between two sieves, in the logarithm
    assert mass[sizes < half].sum() == pytest.approx(0.7, abs=2e-3)
    for bad in ([0.1, 1.0, 1.0], [0.0, 1.0, 0.9], [0.0, 0.4, 0.9]):
        with pytest.raises(FaultError, match="E514"):
            generate.sieved_sizes(10, openings, np.array(bad))
    words = "pack cloud --count 50 --box .03 .03 .03 --axes 5 4 3 --gradation 2e-3:0 4e-3:1 -o"
    assert main([*words.split(), str(tmp_path / "cloud.h5")]) == 0
    cloud = read_h5(tmp_path / "cloud.h5")
    middle = 2.0 * np.median(cloud.axes, axis=1)
    assert ((middle > 2e-3) & (middle < 4e-3)).all()
    assert np.allclose(cloud.axes / cloud.axes[:, :1], [1.0, 0.8, 0.6])


def test_gradation_of_a_file(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """A sieve curve of a file is followed, and said so; classes without a grain are a fault."""
    (tmp_path / "s.txt").write_text("# opening passing\n1e-3, 0\n2e-3 .3  # fine\n4e-3 1\n")
    words = ["pack", "cloud", "--box", ".05", ".05", ".05", "--axes", "1", "1", "1", "--json"]
    words += ["-o", str(tmp_path / "c.h5"), "--sieves"]
    assert main([*words, str(tmp_path / "s.txt"), "--count", "600"]) == 0
    told = json.loads(capsys.readouterr().out)["sieve curve, largest error of the mass"]
    cloud = read_h5(tmp_path / "c.h5")
    made = generate.passing_of(cloud, np.array([1e-3, 2e-3, 4e-3]))
    assert made == pytest.approx([0.0, 0.3, 1.0], abs=0.01)
    assert told == pytest.approx(abs(made[1] - 0.3), abs=1e-12)
    mass = cloud.axes[:, 0] ** 3
    assert made[1] == pytest.approx(mass[cloud.axes[:, 0] <= 1e-3].sum() / mass.sum())
    for text, few, part in (
        ("1e-3 0\n2e-3 .3\n4e-3 .2\n8e-3 1\n", 600, "no sieve curve"),
        ("1e-3 0\n4e-3 .9\n", 600, "no sieve curve"), ("1e-3 0 3\n", 600, "no sieve"),
        ("", 600, "holds no sieves"), ("1e-3 0\n2e-3 .9\n9e-3 1\n", 40, "no grain lies between"),
    ):  # fmt: skip
        (tmp_path / "b.txt").write_text(text)
        assert main([*words, str(tmp_path / "b.txt"), "--count", str(few)]) == 1
        said = capsys.readouterr().err
        assert "E514" in said and part in said


def test_groups_that_share_grains(tmp_path: Path) -> None:
    """The text form keeps groups that share grains, and grains without group."""
    groups = {"all": [1, 2], "one": [2]}
    packing = make_packing(np.zeros((3, 3)), np.ones((3, 3)), groups=groups)
    write_text(tmp_path / "a.txt", packing)
    again = read_text(tmp_path / "a.txt").groups
    assert {name: ids.tolist() for name, ids in again.items()} == groups


def test_contacts_follow_their_grains(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """Contacts stay with both of their grains, under new ids too; bad ones are faults."""
    packing = make_packing(np.arange(12.0).reshape(4, 3), np.ones((4, 3)), ids=[4, 9, 2, 7])
    packing.pairs = np.array([[4, 9], [2, 9], [2, 7]])
    packing.tangential = np.arange(9.0).reshape(3, 3)
    path = tmp_path / "pack.h5"
    write_h5(path, packing)
    back = read_h5(path)
    assert (back.pairs == packing.pairs).all()
    assert (back.tangential == packing.tangential).all()
    part = back.take(back.id != 4)
    assert part.pairs.tolist() == [[2, 9], [2, 7]]
    assert part.tangential.tolist() == [[3.0, 4.0, 5.0], [6.0, 7.0, 8.0]]
    fresh = back.renumbered(10)  # 2, 4, 7, 9 become 11 to 14
    assert fresh.pairs.tolist() == [[12, 14], [11, 14], [11, 13]]
    both = back.join(fresh)
    assert both.pairs.tolist() == [*packing.pairs.tolist(), *fresh.pairs.tolist()]
    assert main(["pack", "h52text", str(path), "-o", str(tmp_path / "pack.txt")]) == 0
    assert "no contacts" in capsys.readouterr().out
    packing.pairs[0, 0] = 5
    with pytest.raises(FaultError, match="grain 5"):
        write_packing_file(path, packing)
    packing.pairs[0, 0], packing.tangential[0, 0] = 4, np.nan
    with pytest.raises(FaultError, match="no finite number"):
        write_packing_file(path, packing)
    packing.tangential = packing.tangential[:2]
    with pytest.raises(FaultError, match="contacts"):
        write_packing_file(path, packing)
