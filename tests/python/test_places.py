"""SET places of talus-fem: nodes that are elsewhere at rest are those of another mesh."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from talus.mesh import Mesh, box, write_mesh
from talus.port import Message
from talus.programs import find_program

sys.path.insert(0, str(Path(__file__).parents[1] / "errors/base/port"))
from port import Asker  # noqa: E402

DECK = """&run      title = 'Block', gravity = 0.0, 0.0, -9.81 /
&mesh     file = 'block.h5' /
&material id = 'soil', LAW density = 1500.0, young = 5.0e5, poisson = 0.3 /
&section  group = 'all', material = 'soil', element = 'hex8_bbar' /
&support  group = 'z0', fix = 'z' /
&analysis kind = 'explicit' /
"""


class Block(Asker):
    """talus-fem under way with a mesh."""

    def __init__(self, folder: Path, mesh: Mesh, monkeypatch: pytest.MonkeyPatch,
                 law: str = "") -> None:  # fmt: skip
        """Start it in a folder of its own and greet."""
        folder.mkdir()
        monkeypatch.chdir(folder)
        write_mesh(folder / "block.h5", mesh)
        (folder / "deck.nml").write_text(DECK.replace("LAW", law))
        super().__init__(str(folder / "meeting/side"))
        command = [str(find_program("talus-fem")), "deck.nml", f"--port=hdf5:{folder}/meeting/side"]
        self.process = subprocess.Popen([*command, "--threads=1"], stdout=subprocess.DEVNULL,
                                        stderr=subprocess.DEVNULL)  # fmt: skip
        self.hello()
        nodes = len(mesh.x)
        self.ask("SELECT", set="all", role="prescribe", id=np.arange(1, nodes + 1), fields="u")
        self.ask("READY")

    def forces(self, u: np.ndarray) -> Message:
        """Return the forces of the elements with nodes moved so far."""
        return self.ask("FORCE", scope="all", **{"all.u": u}).fields["all.force"]


def meshes() -> tuple[Mesh, Mesh]:
    """Return a block, and the same with its inner and upper nodes elsewhere."""
    old = box(np.zeros(3), np.array([0.03, 0.02, 0.02]), (3, 2, 2))
    new = box(np.zeros(3), np.array([0.03, 0.02, 0.02]), (3, 2, 2))
    rng = np.random.default_rng(5)
    chosen = new.x[:, 2] > 5e-3
    new.x[chosen] += 2e-3 * rng.uniform(-1.0, 1.0, (chosen.sum(), 3))
    return old, new


def test_moved_nodes_make_another_mesh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Places, masses and forces are those of a block that was made so."""
    old, new = meshes()
    u = 1e-4 * np.random.default_rng(6).standard_normal(old.x.shape)
    made = Block(tmp_path / "made", new, monkeypatch)
    wanted, known = made.forces(u), made.ask("DESCRIBE", what="mesh").fields
    moved = Block(tmp_path / "moved", old, monkeypatch)
    before = moved.forces(u)
    node = np.flatnonzero((old.x != new.x).any(1)) + 1
    assert moved.ask("SET", what="places", node=node, x=new.x[node - 1]).status == 0
    found = moved.ask("DESCRIBE", what="mesh").fields
    assert np.abs(found["x"] - new.x).max() == 0.0
    assert np.abs(found["mass_u"] - known["mass_u"]).max() < 1e-14 * known["mass_u"].max()
    scale = np.abs(wanted).max()
    assert np.abs(moved.forces(u) - wanted).max() < 1e-13 * scale
    assert np.abs(before - wanted).max() > 1e-3 * scale
    for block in (made, moved):
        block.ask("STOP")


def test_places_that_cannot_be(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """P302: a node that does not exist; a law of finite strain, which cannot begin anew."""
    old, _ = meshes()
    block = Block(tmp_path / "one", old, monkeypatch)
    reply = block.ask("SET", what="places", node=np.array([99]), x=np.zeros((1, 3)))
    assert reply.status != 0 and "node ids go from 1 to 36" in str(reply.fields)
    block.ask("STOP")
    law = "law = 'neo_hookean',"
    block = Block(tmp_path / "two", old, monkeypatch, law)
    reply = block.ask("SET", what="places", node=np.array([20]), x=np.zeros((1, 3)))
    assert reply.status != 0 and "cannot set 'places'" in str(reply.fields)
    block.ask("STOP")
