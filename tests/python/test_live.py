"""A run of talus-dem under way in Python: bits, bodies, forces, faults, the manual's example."""

import json
import os
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from talus.faults import FaultError
from talus.live import AS_IT_IS, Body, GrainsRun, Plate
from talus.measure import rotations
from talus.packing import make_packing, write_h5
from talus.port_grains import turned
from talus.programs import find_program
from talus.verification import field_steps

ROOT = Path(__file__).parents[2]
RADIUS, YOUNG, POISSON = 1.0e-3, 1.0e8, 0.25
MODULUS = 0.5 * YOUNG / (1.0 - POISSON**2)
DT = 2.0e-6
DECK = """&run       title = 'Grains', t_end = {t_end}, gravity = 0.0, 0.0, {gravity} /
&material  id = 'quartz', density = 2650.0, young = 1.0e8, poisson = 0.25 /
&material  id = 'steel', density = 7800.0, young = 1.0e8, poisson = 0.25 /
&contact   between = 'quartz', 'quartz', law = 'hertz_mindlin', friction = 0.3, damping_ratio = .1 /
&contact   between = 'quartz', 'steel', law = 'hertz_mindlin', friction = 0.3, damping_ratio = .0 /
&particles file = 'packing.h5', material = 'quartz', driven_material = 'quartz' /
&dynamics  {step} /
&output    every_time = 1.0e-3 /
&history   every_time = 1.0e-3 /
"""
FLOOR = "&wall id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'steel' /\n"
SQUARE = np.array([[-0.01, -0.01, 0.0], [0.01, -0.01, 0.0], [0.01, 0.01, 0.0], [-0.01, 0.01, 0.0]])
UP = [[0, 1, 2], [0, 2, 3]]


def write_run(
    folder: Path, x: np.ndarray, gravity: float = 0.0, more: str = "", step: str = f"dt = {DT}",
    groups: dict[str, np.ndarray] | None = None,
) -> Path:  # fmt: skip
    """Write spheres and a deck; return its path."""
    write_h5(folder / "packing.h5", make_packing(x, np.full((len(x), 3), RADIUS), groups=groups))
    deck = folder / "grains.nml"
    deck.write_text(DECK.format(gravity=gravity, step=step, t_end=5.0e-3) + more)
    return deck


def cloud() -> np.ndarray:
    """Return a few spheres above a floor, some of which meet."""
    rng = np.random.default_rng(2)
    grid = np.stack(np.meshgrid(range(3), range(3), range(3), indexing="ij"), -1).reshape(-1, 3)
    return grid * 2.1e-3 + [0.0, 0.0, 1.05e-3] + rng.uniform(-4e-5, 4e-5, size=(27, 3))


def test_pieces_have_the_bits_of_one_run(tmp_path: Path) -> None:
    """Grains in uneven pieces are those of the deck alone; output and summary are written."""
    (tmp_path / "one").mkdir()
    (tmp_path / "live").mkdir()
    deck = write_run(tmp_path / "one", cloud(), -50.0, FLOOR)
    command = [find_program("talus-dem"), deck, "--threads=1"]
    subprocess.run(command, check=True, capture_output=True, cwd=tmp_path / "one")
    alone = field_steps(tmp_path / "one/grains.h5")[-1].grains
    with GrainsRun(write_run(tmp_path / "live", cloud(), -50.0, FLOOR)) as run:
        run.advance_to(1.0e-3)
        run.advance_steps(7)
        run.advance(3.0e-3 - 7 * DT)
        run.advance_to(5.0e-3)
        assert run.time == 5.0e-3
        force, moment = run.forces()
    order = np.argsort(run.ids)
    for name, value in (("x", run.x), ("v", run.v), ("quat", run.quat), ("omega", run.omega)):
        np.testing.assert_array_equal(value[order], alone[name], err_msg=name)
    assert np.abs(force).max() > 0.0
    np.testing.assert_allclose(force[order], alone["force"], rtol=0, atol=1e-12)
    np.testing.assert_allclose(moment[order], alone["moment"], rtol=0, atol=1e-15)
    assert run.scalars["kinetic"] > 0.0
    written = [step.time for step in field_steps(tmp_path / "live/grains.h5")]
    assert written == pytest.approx([0.0, 1.0e-3, 4.0e-3, 5.0e-3])  # at the ends of advances
    assert json.loads((tmp_path / "live/grains_summary.json").read_text())["exit_code"] == 0


def test_plate_bears_hertz_and_turns(tmp_path: Path) -> None:
    """A plate pressed on a sphere that a second holds: force of Hertz, moment, both ways."""
    deck = write_run(tmp_path, np.array([[2.0e-3, 0.0, RADIUS + 1.0e-6]]))
    with GrainsRun(deck, plates={"plate": Plate(SQUARE, UP, "steel")}) as run:
        run.set_velocity("plate", (0.0, 0.0, 0.3))
        run.advance_steps(10)
        body = run.body("plate")
        depth = RADIUS - (run.x[0, 2] - body.centre[2])
        exact = 4.0 / 3.0 * MODULUS * np.sqrt(RADIUS) * depth**1.5
        assert depth > 2.0e-6
        np.testing.assert_allclose(body.force, [0.0, 0.0, -exact], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(body.moment, [0.0, exact * 2.0e-3, 0.0], rtol=1e-6, atol=1e-12)
        np.testing.assert_allclose(run.forces()[0][0], -body.force, rtol=1e-9, atol=1e-15)
        run.set_velocity("plate", (0.0, 0.0, 0.0), (0.0, 0.0, 30.0))
        run.advance(1.0e-3)
        turn = [np.cos(0.03), np.sin(0.03)]
        np.testing.assert_allclose(body.x[1, :2], SQUARE[1, 0] * np.array(
            [turn[0] + turn[1], turn[1] - turn[0]]), atol=1e-12)  # fmt: skip


def test_held_group_goes_where_it_is_told(tmp_path: Path) -> None:
    """Grains of a group move and turn as one; what they hit gets their impulse."""
    x = np.array([[0.0, 0.0, 0.0], [0.0, 4.0e-3, 0.0], [2.02e-3, 0.0, 0.0]])
    groups = {"tool": np.array([1, 2])}
    with GrainsRun(write_run(tmp_path, x, groups=groups), held={"tool": "tool"}) as run:
        assert run.ids.tolist() == [1, 2, 3]
        run.set_velocity("tool", (0.05, 0.0, 0.0), (0.0, 0.0, 5.0))
        run.advance_to(2.0e-3)
        centre = np.array([1.0e-4, 2.0e-3, 0.0])
        arm = 2.0e-3 * np.array([np.sin(0.01), -np.cos(0.01), 0.0])
        np.testing.assert_allclose(run.x[:2], [centre + arm, centre - arm], atol=1e-15)
        np.testing.assert_allclose(run.body("tool").x, run.x[:2], atol=1e-15)
        np.testing.assert_allclose(run.quat[0], turned(AS_IT_IS, np.array([[0, 0, 0.01]]))[0],
                                   atol=1e-12)  # fmt: skip
        assert run.v[2, 0] > 0.05
        assert run.scalars["momentum"][0] == pytest.approx(run.mass[2] * run.v[2, 0], rel=1e-12)


def test_checkpoint_goes_on_with_the_same_bits(tmp_path: Path) -> None:
    """A run that goes on from a checkpoint ends as the one that wrote it."""
    deck = write_run(tmp_path, cloud(), -50.0, FLOOR)
    with GrainsRun(deck) as run:
        run.advance_to(2.0e-3)
        path = run.checkpoint("half")
        run.advance_to(3.0e-3)
    with GrainsRun(deck, restart=path) as again:
        assert again.time == pytest.approx(2.0e-3, abs=1e-15)
        again.advance_to(3.0e-3)
    np.testing.assert_array_equal(run.x, again.x)
    np.testing.assert_array_equal(run.omega, again.omega)


def test_turns_of_a_body() -> None:
    """Places and orientations turn alike, one turn after another; a quarter turn is one."""
    x = np.array([[1.0, 2.0, -0.5], [-1.0, -2.0, 0.5]])
    body = Body(x, np.tile(AS_IT_IS, (2, 1)), np.zeros(3), spin=np.array([-0.1, 0.7, 0.2]))
    body.move(1.0)
    body.spin = np.array([0.3, -0.2, 0.5])
    body.move(1.0)
    np.testing.assert_allclose(body.x, np.einsum("nij,nj->ni", rotations(body.quat), x), atol=1e-15)
    body = Body(x, None, np.zeros(3), spin=np.array([0.0, 0.0, 0.5 * np.pi]))
    body.move(1.0)
    np.testing.assert_allclose(body.x[0], [-2.0, 1.0, -0.5], atol=1e-15)


def test_faults(tmp_path: Path) -> None:
    """Faults of Python have their codes, those of talus-dem their own."""
    deck = write_run(tmp_path, cloud(), -50.0, FLOOR)
    (tmp_path / "solid.nml").write_text("&mesh file = 'a.h5' /\n&section group = 'a' /\n")
    cases = {
        "E660": lambda: GrainsRun(tmp_path / "solid.nml"),
        "E664": lambda: GrainsRun(deck, held={"tool": [1, 99]}),
        "D240": lambda: GrainsRun(deck, held={"tool": "no such group"}),
        "P258": lambda: GrainsRun(deck, plates={"a": Plate(SQUARE, UP, "no such material")}),
    }
    with GrainsRun(deck) as run:
        run.advance_to(1.0e-3)
        cases["E661"] = lambda: run.advance_to(1.0e-3)
        cases["E663"] = lambda: run.set_velocity("plate", (0, 0, 1))
        for code, act in cases.items():
            with pytest.raises(FaultError) as fault:
                act()
            assert fault.value.code == code
        run.solver.process.kill()
        with pytest.raises(FaultError) as fault:
            run.advance(1.0e-4)
        assert fault.value.code == "E665" and "signal 9" in str(fault.value)
        run.running = False
    deck = write_run(tmp_path, cloud(), -50.0, FLOOR, step="dt_factor = 0.2")
    with GrainsRun(deck) as run, pytest.raises(FaultError) as fault:
        run.advance_steps(3)
    assert fault.value.code == "E662"


def test_example_of_the_manual(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """The control of the page holds 2 N on a bed."""
    page = (ROOT / "manual/python-run.md").read_text()
    code = re.search(r"```python\n(.*?)```", page, flags=re.S)[1]
    assert len([line for line in code.splitlines() if line.strip()]) <= 20
    grid = np.stack(np.meshgrid(range(5), range(5), range(5), indexing="ij"), -1).reshape(-1, 3)
    x = grid * 2.1e-3 + 1.05e-3 + np.random.default_rng(1).uniform(-4e-5, 4e-5, size=(125, 3))
    walls = FLOOR
    for side, name in enumerate(("west", "south")):
        for at, sense in ((0.0, 1.0), (0.0106, -1.0)):
            point, normal = [0.0] * 3, [0.0] * 3
            point[side], normal[side] = at, sense
            walls += (
                f"&wall id = '{name}{at:g}', point = {point[0]}, {point[1]}, {point[2]}, "
                f"normal = {normal[0]}, {normal[1]}, {normal[2]}, material = 'steel' /\n"
            )
    write_run(tmp_path, x, -9.81, walls, step="dt = 5.0e-6").rename(tmp_path / "press.nml")
    before = Path.cwd()
    os.chdir(tmp_path)
    space: dict[str, object] = {}
    try:
        exec(compile(code, "python-run.md", "exec"), space)
    finally:
        os.chdir(before)
    loads = np.array([row[2] for row in space["rows"]])
    assert loads[-50:].mean() == pytest.approx(2.0, rel=0.05)
    assert "contacts, fastest" in capsys.readouterr().out
