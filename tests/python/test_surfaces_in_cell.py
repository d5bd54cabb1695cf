"""Surfaces in periodic cells: the same forces wherever the cell is cut, ranks, restart, ledger."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from talus.packing import Packing, make_packing, write_h5
from talus.programs import find_program
from talus.verification import field_steps, launcher, read_history

EDGE = 2.0**-6  # of the cell along x and y [m]; the half is exact
TOP = 0.02
HALF = 0.5 * EDGE
SPEED = 0.3
START = 0.75 * EDGE  # of the tool; it goes over the face at EDGE
MOTION = f"velocity = {SPEED}, 0.0, 0.0, material = 'glass' /"
BODIES = {
    "blade": "&surface id = 'tool', file = 'blade.stl', shift = {x}, 0.0, 0.0, " + MOTION,
    "bar": "&cylinder id = 'tool', side = 'outside', centre = {x}, 0.005, 0.003, "
    "axis = 0.0, 1.0, 0.0, radius = 0.0015, " + MOTION,
    "rod": "&cylinder id = 'tool', side = 'outside', centre = {x}, 0.005, 0.003, "
    "axis = 0.0, 1.0, 0.0, radius = 0.0015, length = 0.009, spin = 0.0, 30.0, 0.0, " + MOTION,
    "cone": "&penetrometer id = 'tool', tip = {x}, 0.012, 0.002, apex_deg = 60.0, "
    "diameter = 0.003, shaft = 0.01, shaft_material = 'glass', " + MOTION,
    "body": "&surface id = 'tool', file = 'blade.stl', shift = {x}, 0.0, 0.0, "
    + MOTION
    + "\n&body surface = 'tool', free = 'x', 'y', 'rz', mass = 5.0e-4, inertia = 5.0e-9 /",
}
DECK = """&run       title = 'Tool in a cell', t_end = {t_end}, gravity = 0.0, 0.0, -9.81 /
&material  id = 'glass', density = 2500.0, young = 1.0e7, poisson = 0.25 /
&contact   between = 'glass', 'glass', law = 'hertz_mindlin', friction = 0.4, damping_ratio = 0.3 /
&particles file = '{source}.h5', material = 'glass' /
&cell      size = {edge!r}, {edge!r}, 0.02, periodic = 'a', 'b' /
&wall      id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'glass' /
{body}
&dynamics  dt = 1.0e-5 /
&output    every_time = {t_end}, fields = 'contacts' /
&history   every_time = 2.0e-4 /
&checkpoint every_wall = 1000.0 /
"""


def write_blade(path: Path) -> None:
    """Write a block 2 x 9 x 5 mm about x = 0, from y = 4 and z = 1 mm on, as text STL."""
    low, high = np.array([-1e-3, 4e-3, 1e-3]), np.array([1e-3, 13e-3, 6e-3])
    lines = ["solid blade"]
    for axis in range(3):
        for side in (0, 1):
            u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
            base = np.where(np.eye(3)[axis] > 0, (low, high)[side], low)
            corner = [
                base + (p * u + q * v) * (high - low) for p, q in ((0, 0), (1, 0), (1, 1), (0, 1))
            ]
            if side == 0:
                corner.reverse()
            for three in ((0, 1, 2), (0, 2, 3)):
                lines += ["facet normal 0 0 0", "outer loop"]
                lines += ["vertex {:.9g} {:.9g} {:.9g}".format(*corner[k]) for k in three]
                lines += ["endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid blade"]) + "\n")


def bed(shift: float) -> Packing:
    """Return two layers of spheres, moved along x and folded into the cell."""
    rng = np.random.default_rng(4)
    count = 5
    pitch = EDGE / count
    places = np.indices((count, count, 2)).reshape(3, -1).T * [pitch, pitch, 2.9e-3]
    places = places + [0.5 * pitch, 0.5 * pitch, 1.4e-3] + rng.uniform(-1e-4, 1e-4, places.shape)
    places[:, 0] += 0.05 * pitch * (places[:, 2] > 2e-3)
    grain = np.ldexp(np.rint(np.ldexp(places, 40)), -40)  # exact under a shift by half an edge
    grain[:, 0] = (grain[:, 0] + shift) % EDGE
    radius = 1.3e-3 * (1.0 + 0.08 * rng.uniform(-1.0, 1.0, len(grain)))
    pack = make_packing(grain, np.repeat(radius[:, None], 3, axis=1))
    # grains that the tool would begin in are left out
    apart = np.abs((places[:, 0] - START + HALF) % EDGE - HALF)
    return pack.take((apart > 3.0e-3) | (places[:, 2] > TOP))


def run(
    folder: Path, name: str, body: str, shift: float, t_end: float = 0.03, ranks: int = 0,
    more: tuple[str, ...] = (),
) -> None:  # fmt: skip
    """Run the tool in the bed, both moved by a shift."""
    write_blade(folder / "blade.stl")
    write_h5(folder / f"{name}_bed.h5", bed(shift))
    text = DECK.format(
        t_end=t_end, source=f"{name}_bed", edge=EDGE, body=BODIES[body].format(x=START + shift)
    )
    (folder / f"{name}.nml").write_text(text)
    words = [*launcher(ranks), str(find_program("talus-dem")), f"{name}.nml", "--threads=1", *more]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def apart(folder: Path, one: str, other: str, rows: int | None = None) -> float:
    """Return the largest difference of forces on the tool over the largest force."""
    tables = [read_history(folder / f"{name}_surfaces.csv") for name in (one, other)]
    force = [np.array([t[f"force_{c}"][:rows] for c in "xyz"]) for t in tables]
    assert force[0].shape == force[1].shape
    return float(np.abs(force[0] - force[1]).max() / np.abs(force[0]).max())


@pytest.mark.parametrize("body", BODIES)
def test_the_cut_does_not_matter(body: str, tmp_path: Path) -> None:
    """A tool dragged over a face has the history of the same tool in the middle of the cell."""
    run(tmp_path, "over", body, 0.0)
    run(tmp_path, "inside", body, -HALF)
    force = read_history(tmp_path / "over_surfaces.csv")["force_x"]
    x = read_history(tmp_path / "over_surfaces.csv")["x"]
    assert x[-1] > EDGE + 1e-3
    assert np.abs(force[x > EDGE]).max() > 1e-3

    print(apart(tmp_path, "over", "inside"))
    assert apart(tmp_path, "over", "inside") < 1e-6


def test_ledger_and_momentum(tmp_path: Path) -> None:
    """Work of the tool is in the ledger; impulses of tool, floor and gravity make the momentum."""
    run(tmp_path, "drag", "blade", 0.0)
    energy = read_history(tmp_path / "drag_energy.csv")
    tool = read_history(tmp_path / "drag_surfaces.csv")
    scale = energy["kinetic"].max() + np.abs(energy["boundary"]).max()
    assert np.abs(energy["boundary"]).max() > 0.1 * scale
    assert np.abs(energy["closure_error"]).max() < 1e-3 * scale
    assert np.abs(tool["work"][-1] - energy["boundary"][-1]) < 1e-9 * scale
    contacts = field_steps(tmp_path / "drag.h5")[-1].contacts
    own = contacts["ids"].min(axis=1) == -2  # the floor is -1
    assert own.any()
    force = contacts["force"][own].sum(axis=0)
    assert np.allclose([tool[f"force_{c}"][-1] for c in "xyz"], -force, rtol=0, atol=1e-12)


def test_moment_about_the_centre(tmp_path: Path) -> None:
    """The moment of the images is that about the tool's own centre."""
    for name, shift in (("over", 0.0), ("inside", -HALF)):
        run(tmp_path, name, "rod", shift)
    tables = [read_history(tmp_path / f"{name}_surfaces.csv") for name in ("over", "inside")]
    moment = [np.array([t[f"moment_{c}"] for c in "xyz"]) for t in tables]
    assert np.abs(moment[0]).max() > 1e-6
    assert np.abs(moment[0] - moment[1]).max() < 1e-6 * np.abs(moment[0]).max()


def test_ranks_and_restart(tmp_path: Path) -> None:
    """Two ranks give what one gives; a run that is stopped goes on to the same bits."""
    run(tmp_path, "one", "blade", 0.0)
    run(tmp_path, "two", "blade", 0.0, ranks=2)
    assert apart(tmp_path, "one", "two") < 1e-6
    first, last = tmp_path / "first", tmp_path / "last"
    first.mkdir()
    last.mkdir()
    run(first, "one", "blade", 0.0, t_end=0.02)
    run(last, "one", "blade", 0.0, more=(f"--restart={first / 'one.chk.h5'}",))
    whole, rest = (read_history(f / "one_surfaces.csv") for f in (tmp_path, last))
    late = whole["time"] >= rest["time"][0]
    assert rest["time"][0] > 0.0
    for key, values in rest.items():
        assert np.array_equal(values, whole[key][late]), key


CROSS = """&run       title = 'Sphere on a plate', t_end = 1.0e-5 /
&material  id = 'glass', density = 2500.0, young = 1.0e9, poisson = 0.25 /
&contact   between = 'glass', 'glass', law = 'hertz_mindlin', friction = 0.4, damping_ratio = 0.0 /
&particles file = '{name}_one.h5', material = 'glass' /
&cell      size = 0.0078125, 0.015625, 0.03125, {more} /
&surface   id = 'plate', material = 'glass', rectangle = {corners} /
&dynamics  dt = 1.0e-6 /
&history   every_time = 1.0e-6 /
&output    every_time = 1.0e-5 /
"""


def press(folder: Path, name: str, grain: list[float], plate: list[float], more: str = "") -> tuple:
    """Run a sphere of 1 mm above the middle of a plate 4 x 4 mm; return force and moment on it."""
    pack = make_packing(np.array([grain]), np.full((1, 3), 1e-3))
    pack.v[:] = [0.01, 0.02, -0.1]
    write_h5(folder / f"{name}_one.h5", pack)
    corners = np.array([[-2e-3, -2e-3, 0.0], [2e-3, -2e-3, 0.0], [2e-3, 2e-3, 0.0]]) + plate
    words = ", ".join(f"{v:.17g}" for v in corners.ravel())
    (folder / f"{name}.nml").write_text(CROSS.format(name=name, corners=words, more=more))
    program = [str(find_program("talus-dem")), f"{name}.nml", "--threads=1"]
    done = subprocess.run(program, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = read_history(folder / f"{name}_surfaces.csv")
    return tuple(np.array([rows[f"{kind}_{c}"] for c in "xyz"]) for kind in ("force", "moment"))


@pytest.mark.parametrize("faces", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -1, 1)])
def test_sphere_pressed_over_faces(faces: tuple[int, ...], tmp_path: Path) -> None:
    """A sphere at one side of faces, edges, corners meets the plate at the other, to round-off."""
    edges = np.array([2.0**-7, 2.0**-6, 2.0**-5])
    over = np.array([2.0**-12, 2.0**-13, 1e-3 - 2.0**-17])
    plate = np.array([2.0**-9, 2.0**-8, 2.0**-8])
    force, moment = press(tmp_path, "inside", list(plate + over), list(plate))
    assert -force[2].min() > 0.1  # pressed down
    # the plate lies beyond the faces: its image is where it was
    far = plate + np.array(faces) * edges
    other = press(tmp_path, "over", list(plate + over), list(far))
    assert np.abs(other[0] - force).max() < 1e-10 * np.abs(force).max()
    assert np.abs(other[1] - moment).max() < 1e-10 * np.abs(moment).max()
    assert np.array_equal(other[0][:, 0], force[:, 0])  # the places are exact
    # several cells away it is the same
    other = press(tmp_path, "away", list(plate + over), list(plate + 5 * np.array(faces) * edges))
    assert np.abs(other[0] - force).max() < 1e-10 * np.abs(force).max()
    if faces[2]:
        return
    # without the periodic face it is not there
    other = press(tmp_path, "open", list(plate + over), list(far), "periodic = 'c'")
    assert not other[0].any()
