"""WAKE, SLEEP, RELAX and SET kind change the population of a run without loss."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from talus.generate import cloud, uniform_sizes
from talus.packing import write_h5
from talus.port import Message
from talus.programs import find_program
from talus.verification import read_history

sys.path.insert(0, str(Path(__file__).parents[1] / "errors/base/port"))
from port import Asker  # noqa: E402

COUNT, SIDE = 60, 0.012
HEAD = f"""&run       title = 'Population', t_end = 1.0, gravity = 0.0, 0.0, -9.81 /
&material  id = 'grain', density = 2500.0, young = 1.0e8, poisson = 0.25 /
&contact   between = 'grain', 'grain', law = 'hertz_mindlin', friction = 0.5, damping_ratio = 0.3 /
&particles file = 'PACKING.h5', material = 'grain' /
&wall      id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'grain' /
&wall      id = 'x0', point = 0.0, 0.0, 0.0, normal = 1.0, 0.0, 0.0, material = 'grain' /
&wall      id = 'x1', point = {SIDE}, 0.0, 0.0, normal = -1.0, 0.0, 0.0, material = 'grain' /
&wall      id = 'y0', point = 0.0, 0.0, 0.0, normal = 0.0, 1.0, 0.0, material = 'grain' /
&wall      id = 'y1', point = 0.0, {SIDE}, 0.0, normal = 0.0, -1.0, 0.0, material = 'grain' /
"""
PLATE = f"""&cylinder id = 'bar', side = 'outside', centre = {0.5 * SIDE}, {0.5 * SIDE}, 2.0e-3,
  axis = 0.0, 1.0, 0.0, radius = 1.5e-3, length = {2.0 * SIDE}, material = 'grain' /
"""
REST = """&relaxation damping = 'adaptive', dt_factor = 0.2 /
&equilibrium unbalanced = 1.0e-8, energy_ratio = 1.0e-14, check_every = 200 /
"""
STEP = 2.0e-6
FILES = "&checkpoint keep = 9 /\n&history every_time = 1.0e-4 /\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a bed at rest in a box, around a bar."""
    folder = tmp_path_factory.mktemp("population")
    sizes = uniform_sizes(COUNT, 0.1, np.random.default_rng(4))
    box = np.array([SIDE, SIDE, 0.06])
    heap = cloud(sizes, box, np.full(3, 1.0e-3), seed=4)
    heap.x[:, 2] += 5.0e-3
    write_h5(folder / "cloud.h5", heap)
    soft = "&dynamics dt_factor = 0.3, damping = 2.0 /\n&output every_time = 9.0, packing = "
    for name, start, rest in (("settle", "cloud", soft + "'soft.h5' /\n"),
                              ("rest", "soft", REST + "&output every_time = 9.0, packing = "
                               "'bed.h5' /\n")):  # fmt: skip
        text = HEAD.replace("PACKING", start) + PLATE + rest
        (folder / f"{name}.nml").write_text(text.replace("t_end = 1.0", "t_end = 0.3"))
        command = [str(find_program("talus-dem")), f"{name}.nml", "--threads=1"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout
    return folder


class Grains(Asker):
    """talus-dem under way with a bed, and requests that must succeed."""

    def __init__(self, folder: Path, name: str, restart: str = "", packing: str = "bed") -> None:
        """Start it in a folder of its own and greet."""
        self.folder = folder / name
        self.folder.mkdir(exist_ok=True)
        os.chdir(self.folder)
        if not (self.folder / f"{packing}.h5").exists():
            (self.folder / f"{packing}.h5").write_bytes((folder / f"{packing}.h5").read_bytes())
        deck = HEAD.replace("PACKING", packing) + PLATE + f"&dynamics dt = {STEP} /\n"
        (self.folder / "deck.nml").write_text(deck + FILES)
        super().__init__("meeting/side")
        command = [str(find_program("talus-dem")), "deck.nml", "--port=hdf5:meeting/side"]
        self.process = subprocess.Popen([*command, "--threads=1"], stdout=subprocess.DEVNULL)
        self.ask("HELLO", run_id="test", restart=restart, protocol=2)

    def ask(self, verb: str, t0: float = 0.0, t1: float = 0.0, **fields: object) -> Message:
        """Send a request; the reply is no fault."""
        reply = super().ask(verb, t0, t1, **fields)
        assert reply.status == 0, reply.fields
        return reply

    def grains(self) -> dict[str, np.ndarray]:
        """Return the grains."""
        return self.ask("DESCRIBE", what="grains").fields

    def contacts(self) -> dict[tuple[int, int], np.ndarray]:
        """Return the force of each contact by its ids."""
        reply = self.ask("DESCRIBE", what="contacts").fields
        forces = zip(reply["ids"].tolist(), reply["force"], strict=True)
        return {tuple(ids): force for ids, force in forces}

    def springs(self, of: np.ndarray) -> dict[str, np.ndarray]:
        """Return tangential forces of the contacts of some grains, as WAKE takes them."""
        reply = self.ask("DESCRIBE", what="contacts").fields
        chosen = np.isin(reply["ids"], of).any(1) & (reply["ids"] > 0).all(1)
        force, normal = reply["force"][chosen], reply["normal"][chosen]
        force = force - np.sum(force * normal, 1)[:, None] * normal
        return {"ids": reply["ids"][chosen], "force": force}

    def go(self, steps: int, t0: float) -> float:
        """Take steps; return the kinetic energy."""
        reply = self.ask("ADVANCE", t0, t0 + steps * STEP)
        self.ask("ACCEPT")
        return float(reply.fields["scalars"][0])

    def end(self) -> None:
        """Stop the program."""
        self.ask("STOP")
        assert self.process.wait(60) == 0


@pytest.fixture
def start(folder: Path) -> "list[Grains]":
    """Give a way to start talus-dem; what still runs is killed."""
    here, started = Path.cwd(), []

    def begin(name: str, restart: str = "", packing: str = "bed") -> Grains:
        started.append(Grains(folder, name, restart, packing))
        return started[-1]

    yield begin
    os.chdir(here)
    for grains in started:
        grains.process.kill()
        grains.process.wait()


def some(grains: dict[str, np.ndarray], number: int = 20) -> np.ndarray:
    """Return the ids of grains that are highest up."""
    return np.sort(grains["id"][np.argsort(grains["x"][:, 2])[-number:]])


def differences(one: dict, other: dict) -> float:
    """Return the largest difference of forces over the largest force; contacts are the same."""
    assert set(one) == set(other)
    most = max(np.abs(force).max() for force in one.values())
    return max(np.abs(one[key] - other[key]).max() for key in one) / most


def test_what_sleeps_and_wakes_is_the_same(start: object) -> None:
    """Grains that leave and enter again have the same contacts and forces and go on as before."""
    run = start("same")
    run.ask("READY")
    before, contacts = run.grains(), run.contacts()
    at_walls = {max(ids) for ids in contacts if min(ids) < 0}  # which give no friction back
    ids = np.array([i for i in before["id"] if i not in at_walls])
    assert len(ids) > 8
    springs = run.springs(ids)
    run.ask("SLEEP", id=ids)
    assert len(run.grains()["id"]) == COUNT - len(ids)
    chosen = np.isin(before["id"], ids)
    rest = {name: before[name][chosen] for name in ("x", "quat", "axes")}
    reply = run.ask("WAKE", id=ids, **rest, **springs)
    assert reply.fields["step_limit"][0] > 0.0
    after = run.grains()
    for name in ("id", "x", "quat", "axes", "mass", "inertia", "kind"):
        assert np.abs(before[name] - after[name]).max() <= 1e-15, name  # turns are made units
    assert differences(contacts, run.contacts()) < 1e-6  # normals are searched anew
    run.ask("READY")
    kinetic, end = run.go(500, 0.0), run.grains()
    run.end()
    other = start("other")
    other.ask("READY")
    assert other.go(500, 0.0) == pytest.approx(kinetic, rel=1e-3)
    apart = np.abs(other.grains()["x"] - end["x"]).max()
    assert apart < 1e-4 * np.abs(end["x"] - before["x"]).max()
    other.end()


def test_ready_sets_and_their_forces_come_back(start: object) -> None:
    """Sets of grains are forgotten, and selected anew: prescribed ones stay where they are."""
    run = start("sets")
    ids = some(run.grains())
    run.ask("SELECT", set="ghosts", role="prescribe", id=ids)
    run.ask("READY")
    low = np.setdiff1d(run.grains()["id"], ids)
    run.ask("SET", what="kind", id=ids[:5], kind=np.zeros(5, int))
    kinds = dict(zip(*(run.grains()[name].tolist() for name in ("id", "kind")), strict=True))
    assert all(kinds[i] == 0 for i in ids[:5]) and all(kinds[i] == 3 for i in ids[5:])
    lost = super(Grains, run).ask("ADVANCE", 0.0, STEP, ghosts__x=np.zeros((20, 3)))
    assert lost.status != 0
    run.ask("SELECT", set="ghosts", role="prescribe", id=ids[5:])
    run.ask("SELECT", set="free", role="report", id=[*ids[:5], *low])
    reply = run.ask("READY")
    assert reply.fields["ghosts.force"].shape == (15, 3)
    assert run.go(200, 0.0) >= 0.0
    run.end()


def test_rest_moves_only_what_may_move(start: object) -> None:
    """Woken without friction a patch comes to rest; all else stays, and remembers its friction."""
    run = start("rest")
    run.ask("READY")
    before, contacts = run.grains(), run.contacts()
    ids = some(before)
    run.ask("SLEEP", id=ids)
    chosen = np.isin(before["id"], ids)
    run.ask("WAKE", id=ids, **{name: before[name][chosen] for name in ("x", "quat", "axes")})
    woken = run.contacts()
    reply = run.ask("RELAX", id=ids, steps=4000, tolerance=1e-5).fields
    assert 20 <= reply["substeps"][0] < 4000 and reply["unbalanced"][0] <= 1e-5
    after = run.grains()
    assert np.array_equal(before["x"][~chosen], after["x"][~chosen])
    assert np.array_equal(after["kind"], before["kind"])
    way = np.linalg.norm(after["x"] - before["x"], axis=1)
    assert reply["moved"][0] == pytest.approx(way.max(), rel=1e-12)
    assert 0.0 < way.max() < 1e-2 * before["axes"].max()
    found = run.contacts()
    held = {key for key in contacts if not set(key) & set(ids.tolist())}
    assert any(min(key) < 0 for key in held)  # walls and the bar are among them
    one = {key: contacts[key] for key in held}
    assert differences(one, {key: found[key] for key in held}) < 1e-7
    assert differences(one, {key: woken[key] for key in held}) < 1e-7
    elastic = run.ask("READY").fields["scalars"][1]
    assert run.go(500, 0.0) < 1e-3 * elastic  # a packing has no friction of walls
    run.end()


def test_energies_of_a_change_are_booked(start: object) -> None:
    """The ledger closes over SLEEP, WAKE, SET kind and RELAX."""
    run = start("ledger")
    run.ask("READY")
    grains = run.grains()
    ids = some(grains)
    chosen = np.isin(grains["id"], ids)
    run.go(50, 0.0)
    run.ask("SLEEP", id=ids)
    speed = np.tile([0.0, 0.0, -0.1], (len(ids), 1))
    rest = {name: grains[name][chosen] for name in ("x", "quat", "axes")}
    run.ask("WAKE", id=ids, v=speed, **rest)
    run.ask("RELAX", id=ids, steps=200, tolerance=1e-12)
    run.ask("SET", what="kind", id=ids[:5], kind=np.full(5, 3))
    run.ask("READY")
    run.go(500, 50 * STEP)
    run.end()
    energy = read_history(run.folder / "deck_energy.csv")
    moved = np.abs(energy["entered"][-1]) + np.abs(energy["left"][-1])
    assert moved > 1e-6
    assert np.abs(energy["closure_error"]).max() < 1e-4 * moved


def test_a_restart_has_the_same_bits(start: object) -> None:
    """After grains have woken a run goes on from its checkpoint with the same bits."""
    run = start("bits")
    run.ask("READY")
    grains = run.grains()
    ids = some(grains)
    chosen = np.isin(grains["id"], ids)
    rest = {name: grains[name][chosen] for name in ("x", "quat", "axes")}
    run.ask("SLEEP", id=ids)
    run.ask("WAKE", id=ids + 1000, v=np.full((20, 3), 0.01), **rest)
    run.ask("READY")
    run.go(100, 0.0)
    run.ask("CHECKPOINT", tag="one")
    run.go(300, 100 * STEP)
    whole = run.grains()
    run.end()
    again = start("bits", restart="one")
    again.ask("READY")
    assert len(again.grains()["id"]) == COUNT and max(again.grains()["id"]) > 1000
    again.go(300, 100 * STEP)
    for name, values in again.grains().items():
        assert np.array_equal(values, whole[name]), name
    again.end()
