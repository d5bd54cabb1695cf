"""Packings of other codes: what is written reads back, ELLIP3D's particle files come out right."""

from pathlib import Path

import numpy as np
import pytest

from talus import exchange, generate
from talus.cli import main
from talus.faults import FaultError
from talus.packing import DRIVEN, FIXED, FREE, make_packing, read_h5, write_h5

TITLES = (
    "ID type a b c position_x position_y position_z axle_a_x axle_a_y axle_a_z axle_b_x axle_b_y "
    "axle_b_z axle_c_x axle_c_y axle_c_z velocity_x velocity_y velocity_z omga_x omga_y omga_z "
    "force_x force_y force_z moment_x moment_y moment_z"
)


def rotation(quat: np.ndarray) -> np.ndarray:
    """Rotation matrix, body to space, of (w, x, y, z)."""
    w, x, y, z = quat
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def spheres(n: int = 40):  # noqa: ANN201
    """Spheres of three kinds with velocities and ids that are not in order."""
    rng = np.random.default_rng(5)
    axes = np.repeat(rng.uniform(0.8e-3, 1.2e-3, (n, 1)), 3, axis=1)
    return make_packing(
        rng.normal(size=(n, 3)), axes, None, np.arange(n) % 3, rng.permutation(n) + 7,
        v=rng.normal(size=(n, 3)), omega=rng.normal(size=(n, 3)),
    )  # fmt: skip


@pytest.mark.parametrize("code", ["lammps", "liggghts"])
def test_data_file_round_trip(code: str, tmp_path: Path) -> None:
    """packing.h5 -> data file -> packing.h5 keeps every number to the bit."""
    packing, data, back = spheres(), tmp_path / "bed.data", tmp_path / "back.h5"
    write_h5(tmp_path / "bed.h5", packing)
    assert main(["convert", str(tmp_path / "bed.h5"), "--to", code, "-o", str(data)]) == 0
    assert main(["convert", str(data), "--from", "lammps", "-o", str(back)]) == 0
    again = read_h5(back)
    for name in ("id", "kind", "x", "axes", "v", "omega"):
        assert np.array_equal(getattr(again, name), getattr(packing, name)), name


def test_data_file_as_peers_write_it(tmp_path: Path) -> None:
    """Image flags, a comment behind the section's name and other orders of rows are read."""
    data = tmp_path / "written.data"
    data.write_text(
        "LAMMPS data file via write_data\n\n2 atoms\n2 atom types\n\n0 1 xlo xhi\n0 1 ylo yhi\n"
        "0 1 zlo zhi\n\nAtoms # sphere\n\n9 2 0.002 2650 0.5 0.25 0.125 0 0 0\n"
        "4 1 0.004 2650 0.75 0.25 0.5 0 0 -1\n\nVelocities\n\n4 1 2 3 4 5 6\n9 0 0 0 0 0 0\n"
    )
    packing = exchange.read_lammps(data)
    assert packing.id.tolist() == [9, 4]
    assert packing.kind.tolist() == [FIXED, FREE]
    assert packing.axes[:, 0].tolist() == [1e-3, 2e-3]
    assert packing.v[1].tolist() == [1, 2, 3]
    assert packing.omega[1].tolist() == [4, 5, 6]


def test_ellipsoids_become_spheres_only_by_option(tmp_path: Path) -> None:
    """Ellipsoids are refused (E505); by option they become spheres of stated size."""
    packing = make_packing(np.zeros((1, 3)), np.array([generate.GRAIN_AXES]))
    with pytest.raises(FaultError, match="E505"):
        exchange.write_lammps(tmp_path / "bed.data", packing, 2650.0)
    assert not (tmp_path / "bed.data").exists()
    assert exchange.sphere_radii(packing, "bounding")[0] == 2.5e-3
    radius = exchange.sphere_radii(packing, "volume")[0]
    assert radius**3 == pytest.approx(np.prod(generate.GRAIN_AXES))


def ellip3d_text(packing: object, kinds: list[int], head: str, turned: int | None = None) -> str:
    """Return a particle file with the packing; axis c of one particle is turned over."""
    rows = []
    for k in range(len(packing.id)):
        frame = rotation(packing.quat[k])
        if turned == k:
            frame[:, 2] *= -1.0
        angles = np.arccos(frame.T.ravel())
        numbers = [
            *packing.axes[k], *packing.x[k], *angles, *packing.v[k], *packing.omega[k], *np.ones(6),
        ]  # fmt: skip
        rows.append(f"{packing.id[k]} {kinds[k]} " + " ".join(f"{x:.12e}" for x in numbers))
    return "\n".join([head, TITLES, *rows, "", "2 sieves that follow", ""])


@pytest.mark.parametrize("head", ["6", "6 1\n0.0 0.0 0.0 0.5 0.5 0.5"])
def test_ellip3d(head: str, tmp_path: Path) -> None:
    """Both heads are read; angles of the axes give the orientation, also of left-handed axes."""
    rng = np.random.default_rng(2)
    wanted = make_packing(
        rng.normal(size=(6, 3)), np.tile(generate.GRAIN_AXES, (6, 1)),
        generate.random_quaternions(rng, 6), ids=np.arange(6) + 3, v=rng.normal(size=(6, 3)),
        omega=rng.normal(size=(6, 3)),
    )  # fmt: skip
    source, target = tmp_path / "particle_end", tmp_path / "bed.h5"
    source.write_text(ellip3d_text(wanted, [0, 1, 5, 3, 4, 10], head, turned=2))
    assert main(["convert", str(source), "--from", "ellip3d", "-o", str(target)]) == 0
    packing = read_h5(target)
    assert packing.id.tolist() == wanted.id.tolist()
    assert packing.kind.tolist() == [FREE, FIXED, FREE, DRIVEN, DRIVEN, DRIVEN]
    assert {name: ids.tolist() for name, ids in packing.groups.items()} == {
        "type_5": [5], "type_3": [6], "type_4": [7], "type_10": [8],
    }  # fmt: skip
    for name in ("x", "axes", "v", "omega"):
        # the file has 13 digits
        assert np.allclose(getattr(packing, name), getattr(wanted, name), rtol=1e-11, atol=0.0)
    for k in range(6):
        # one bit of an angle near 0 is 1e-8 of its cosine's root; 1e-6 is a hundred such
        mine, theirs = rotation(packing.quat[k]), rotation(wanted.quat[k])
        shape = np.diag(np.square(generate.GRAIN_AXES))
        assert np.allclose(mine @ shape @ mine.T, theirs @ shape @ theirs.T, atol=1e-6 * 6.25e-6)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("6\nID", "six\nID", "no number of particles"),
        ("ID type a b c", "nothing", "no row of titles"),
        ("ID type a b c", "ID type a_plus a_minus b_plus b_minus c_plus c_minus", "poly-ellips"),
        ("3 0 ", "3 2 ", "has the type 2"),
        ("3 0 ", "3 0 1.0 ", "row 1 has 30 words"),
        ("3 0 ", "3 x ", "a row is no grain"),
        ("6\nID", "60\nID", "rows instead of 60"),
    ],
)
def test_ellip3d_faults(old: str, new: str, said: str, tmp_path: Path) -> None:
    """What is wrong in a particle file is said (E506)."""
    rng = np.random.default_rng(2)
    packing = make_packing(np.zeros((6, 3)), np.tile(generate.GRAIN_AXES, (6, 1)),
                           generate.random_quaternions(rng, 6), ids=np.arange(6) + 3)  # fmt: skip
    source = tmp_path / "particles"
    text = ellip3d_text(packing, [0] * 6, "6").replace(old, new, 1)
    if said.startswith("rows"):
        text = text.split("\n\n")[0] + "\n"
    source.write_text(text)
    with pytest.raises(FaultError, match="E506") as fault:
        exchange.read_ellip3d(source)
    assert said in str(fault.value)


def test_quaternions_of_all_branches() -> None:
    """Matrices turn into the quaternions they came from, whichever component is largest."""
    rng = np.random.default_rng(9)
    quat = np.concatenate([generate.random_quaternions(rng, 200), np.eye(4)])
    quat = np.where(quat[:, :1] < 0.0, -quat, quat)
    made = exchange.quaternions(np.array([rotation(q) for q in quat]))
    # the sign of q is free where w is zero to rounding
    same = np.minimum(np.abs(made - quat).max(axis=1), np.abs(made + quat).max(axis=1))
    assert same.max() < 1e-13
