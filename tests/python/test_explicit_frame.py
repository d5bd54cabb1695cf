"""The frame of an explicit partner (talus.port_explicit): held loads, impulses, facets."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from own_solvers import enter, faults_of

from talus.mesh import box
from talus.port import Message
from talus.port_explicit import Explicit
from talus.port_names import SCALARS, VERBS
from talus.programs import find_program
from talus.verification import read_history, write_packing

SPAN = 0.35
PARTNER = """
import sys
import numpy as np
from talus.mesh import box
from talus.port_explicit import Explicit
from talus.port_frame import start

class Plate(Explicit):
    program, analysis = "plate", "explicit"

    def __init__(self):
        mesh = box(np.array([-1.0, -1.0, -0.1]), np.array([1.0, 1.0, 0.0]), (1, 1, 1))
        super().__init__(mesh.x, mesh.hex8, mesh.facets)
        self.mass[:], self.step_limit = 0.5, 1.0

    def internal_force(self, u):
        return 0.0 * u

sys.exit(start(Plate))
"""
COUPLED = """&run t_end = 2.0e-3 /
&program side = 'grains', deck = 'grains.nml' /
&program side = 'solid', deck = 'none.toml', launch = 'command', command = '{command}' /
&clock exchange = 1.0e-5, scheme = '{scheme}', tolerance = 1.0e-8 /
&facets ghosts = 'ghosts', facets = 'z1', interface = 'none' /
"""
GRAINS = """&run gravity = 0.0, 0.0, 0.0 /
&material id = 'm', density = 2000.0, young = 1.0e7, poisson = 0.2 /
&contact between = 'm', 'm', law = 'hertz_mindlin', friction = 0.0 /
&particles file = 'pack.h5', material = 'm' /
&dynamics dt = 1.0e-6 /
"""


class Chain(Explicit):
    """Eight nodes on springs to the ground, of which the first is held along x."""

    def __init__(self) -> None:
        """One cube."""
        mesh = box(np.zeros(3), np.ones(3), (1, 1, 1))
        super().__init__(mesh.x, mesh.hex8, mesh.facets)
        self.mass[:], self.step_limit = 2.0, 0.2
        self.held[0, 0] = True
        self.stiff = 0.0

    def internal_force(self, u: np.ndarray) -> np.ndarray:
        """Springs of the ground."""
        return self.stiff * u


def ask(solid: Explicit, verb: str, t0: float = 0.0, t1: float = 0.0, **values: object) -> dict:
    """Return the reply to a request; double underscores are dots."""
    request = Message(VERBS[verb], 1, t0=t0, t1=t1)
    request.put({name.replace("__", "."): value for name, value in values.items()})
    return solid.answer(request)


def begun() -> Chain:
    """Return a chain that has answered READY, with a load set of two nodes."""
    solid = Chain()
    ask(solid, "HELLO", run_id="r", restart="", protocol=2)
    ask(solid, "SELECT", set="l", role="load", id=np.array([1, 8]))
    ask(solid, "READY")
    return solid


def momentum(reply: dict) -> np.ndarray:
    """Return the momentum of a reply."""
    at = SCALARS["momentum"]
    return np.asarray(reply["scalars"])[at : at + 3]


def test_held_loads_give_their_impulse() -> None:
    """Wherever an interval begins and whatever was there before; the held node takes none."""
    solid, due = begun(), np.zeros(3)
    for k in range(1, 4):
        force = np.full((2, 3), float(k))
        reply = ask(solid, "ADVANCE", (k - 1) * SPAN, k * SPAN, l__force=force)
        due += SPAN * k * np.array([1.0, 2.0, 2.0])
        assert momentum(reply) == pytest.approx(due, rel=1e-14)
        ask(solid, "ACCEPT")


def test_impulses_work() -> None:
    """In ADVANCE, alone in KICK_DRIFT, and back by REJECT: kinetic energy is the work of loads."""
    solid, push = begun(), np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    due = np.array([4.0, 7.0, 9.0])
    for _ in range(2):
        first = ask(solid, "ADVANCE", 0.0, SPAN, l__impulse=push)
        assert momentum(first) == pytest.approx(due, rel=1e-14)
        ask(solid, "REJECT")
    ask(solid, "ADVANCE", 0.0, SPAN, l__impulse=push)
    second = ask(solid, "KICK_DRIFT", SPAN, SPAN, kick=0.0, drift=0.0, l__impulse=push)
    assert momentum(second) == pytest.approx(2 * due, rel=1e-14)
    for reply in (first, second):
        kinetic, work = (reply["scalars"][SCALARS[n]] for n in ("kinetic", "boundary"))
        assert kinetic == pytest.approx(work, rel=1e-14) and work > 0.0


def test_kick_drift_is_a_step() -> None:
    """Half a kick, a drift, half a kick: an oscillator keeps its energy to second order."""
    solid, dt = begun(), 0.01
    solid.stiff = 8.0  # 2 rad/s
    solid.u[4, 2] = solid.accepted[4, 2] = 1.0e-3
    for k in range(100):
        ask(solid, "KICK_DRIFT", k * dt, k * dt, kick=0.5 * dt, drift=dt, brief=1)
        ask(solid, "KICK_DRIFT", k * dt, k * dt, kick=0.5 * dt, drift=0.0)
    assert solid.u[4, 2] == pytest.approx(1.0e-3 * np.cos(2.0), abs=1e-7)


def test_port_finds_no_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every verb, legal and illegal."""
    enter(tmp_path, monkeypatch)
    Path("plate.py").write_text(PARTNER)
    found = faults_of([sys.executable, "plate.py", "none.toml"], facets="z1")
    assert not found, found


@pytest.mark.parametrize("scheme", ["symmetric", "iterated"])
def test_facets(scheme: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A sphere hits a free plate: momentum to round-off, energy as the exchange."""
    enter(tmp_path, monkeypatch)
    Path("plate.py").write_text(PARTNER)
    Path("none.toml").write_text("")
    Path("grains.nml").write_text(GRAINS)
    Path("coupled.nml").write_text(
        COUPLED.format(command=f"{sys.executable} plate.py", scheme=scheme)
    )
    both = np.array([[0.2, 0.1, 0.0], [0.2, 0.1, 0.2001]])
    v = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    write_packing(Path("pack.h5"), both, np.full((2, 3), 0.1), kind=np.array([1, 0]), v=v,
                  groups={"ghosts": [1]})  # fmt: skip
    command = [find_program("talus-couple"), "coupled.nml"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    audit = read_history(Path("coupled_audit.csv"))
    mass = 2000.0 * 4 / 3 * np.pi * 0.1**3
    assert np.abs(audit["momentum_z"] + mass).max() < 1e-12 * mass
    assert np.abs(audit["force_on_solid_z"]).max() > 100.0
    energy = audit["grains_kinetic"] + audit["grains_elastic"] + audit["solid_kinetic"]
    assert np.abs(energy / (0.5 * mass) - 1.0).max() < 1e-4
