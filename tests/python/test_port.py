"""What talus-dem and talus-fem reply is what port.toml says; the C header and Python agree."""

import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from port_decks import GRAINS, SOLID

from talus import mesh as meshes
from talus import port_messages, port_names
from talus.faults import FaultError
from talus.port import Message, read_message, write_message
from talus.programs import find_program
from talus.verification import write_packing

sys.path.insert(0, str(Path(__file__).parents[1] / "errors/base/port"))
from port import Asker  # noqa: E402

ROOT = Path(__file__).parents[2]
KINDS = {"f": "real", "i": "integer"}
POLAR = """&run gravity = 0.0, 0.0, 0.0 /
&mesh file = 'cube.h5' /
&material id = 'soil', law = 'micropolar', density = 1500.0, micro_inertia = 1.0e-6,
          kappa = 2.0e6, alpha = 0.0, beta = 1.0, gamma = 2.0, lambda = 5.0e6, mu = 3.0e6 /
&section group = 'all', material = 'soil', element = 'hex8/hex8' /
&support group = 'z0', fix = 'x', 'y', 'z' /
&analysis kind = 'static' /
"""


class Solver(Asker):
    """A solver under way that takes requests, every reply of which is compared with port.toml."""

    def __init__(self, program: str, side: str, folder: Path) -> None:
        """Start the program on deck.nml."""
        super().__init__("meeting/side")
        self.side, self.roles = side, {}
        command = [str(find_program(program)), "deck.nml", "--port=hdf5:meeting/side"]
        with (folder / "out.txt").open("w") as out:
            self.process = subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT)

    def ask(self, verb: str, t0: float = 0.0, t1: float = 0.0, **fields: object) -> Message:
        """Send a request; the reply has all fields that must be there and no unknown one."""
        if verb == "SELECT":
            self.roles[fields["set"]] = f"{self.side} {fields['role']}"
        reply = super().ask(verb, t0, t1, **fields)
        assert reply.status == 0, reply.fields
        table = list(port_messages.REPLIES[verb])
        if verb == "DESCRIBE":
            table += port_messages.REPLIES[f"DESCRIBE {fields['what']}"]
        known = {name: rest for name, *rest in table if rest[2] in ("both", self.side)}
        for name, role in self.roles.items():
            for member, *rest in port_messages.SET_REPLIES[role]:
                known[f"{name}.{member}"] = [*rest[:3], False]
        for name, (kind, shape, _, _) in known.items():
            if name not in reply.fields:
                continue
            value = reply.fields[name]
            assert kind == ("text" if isinstance(value, bytes) else KINDS[value.dtype.kind]), name
            size = shape.strip("()").split(", ")
            if len(size) == 2 and size[0].isdigit():
                assert value.shape[1] == int(size[0]), name
            if len(size) == 1 and size[0].isdigit():
                assert len(value) == int(size[0]), name
        assert not set(reply.fields) - set(known), verb
        missing = {name for name, rest in known.items() if rest[3]} - set(reply.fields)
        assert not missing, (verb, missing)
        return reply

    def end(self) -> None:
        """Stop the program."""
        self.ask("STOP")
        assert self.process.wait(60) == 0


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Go to a folder of its own and come back."""
    here = Path.cwd()
    os.chdir(tmp_path)
    yield tmp_path
    os.chdir(here)


def members(reply: Message, name: str) -> set[str]:
    """Return the fields of a set in a reply."""
    return {key.split(".")[1] for key in reply.fields if key.startswith(f"{name}.")}


def required(role: str) -> set[str]:
    """Return the fields that port.toml wants of a set in replies."""
    return {name for name, _, _, _, needed in port_messages.SET_REPLIES[role] if needed}


def test_grains_reply_what_is_documented(folder: Path) -> None:
    """Every verb of grains."""
    x = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.999e-3], [0.01, 0.0, 0.0]])
    write_packing(folder / "pack.h5", x, np.full((3, 3), 1e-3), groups={"all": np.arange(1, 4)})
    (folder / "deck.nml").write_text(GRAINS)
    solver = Solver("talus-dem", "grains", folder)
    try:
        hello = solver.hello()
        words = hello.text("capabilities").split(",")
        assert set(words) <= set(port_names.CAPABILITIES)
        assert len(words) == len(set(words))
        for what in ("grains", "contacts", "groups"):
            solver.ask("DESCRIBE", what=what)
        solver.ask("DESCRIBE", what="group", group="all")
        solver.ask("SELECT", set="ghosts", role="prescribe", id=[1])
        solver.ask("SELECT", set="free", role="report", id=[2, 3])
        solver.ask("SELECT", set="pushed", role="load", id=[3])
        solver.ask("SET", what="mass_factor", set="pushed", value=[1.0])
        reply = solver.ask("READY")
        assert members(reply, "ghosts") == required("grains prescribe")
        reply = solver.ask("ADVANCE", 0.0, 1.0e-6, ghosts__x=x[:1], pushed__force=np.zeros((1, 3)))
        assert members(reply, "free") == required("grains report") - {"force", "moment"}
        solver.ask("ACCEPT")
        reply = solver.ask("FORCE", 1.0e-6, 1.0e-6, scope="all", ghosts__v=np.zeros((1, 3)))
        assert members(reply, "free") == {"force", "moment"}
        solver.ask("KICK_DRIFT", 1.0e-6, 2.0e-6, kick=1.0e-6, drift=1.0e-6)
        solver.ask("ACCEPT")
        solver.ask("CHECKPOINT", tag="one")
        solver.ask("WRITE", tag="one")
        solver.end()
    finally:
        solver.process.kill()
        solver.process.wait()


@pytest.mark.parametrize("kind", ["static", "explicit", "micropolar"])
def test_solid_replies_what_is_documented(kind: str, folder: Path) -> None:
    """Every verb of the solid."""
    cube = meshes.box(np.zeros(3), np.full(3, 0.01), (1, 1, 1))
    meshes.write_mesh(folder / "cube.h5", cube)
    polar = kind == "micropolar"
    (folder / "deck.nml").write_text(POLAR if polar else SOLID.format(kind=kind))
    solver = Solver("talus-fem", "solid", folder)
    try:
        words = solver.hello().text("capabilities").split(",")
        assert set(words) <= set(port_names.CAPABILITIES)
        for what in ("mesh", "quadrature", "moduli", "groups"):
            solver.ask("DESCRIBE", what=what)
        solver.ask("DESCRIBE", what="facets", group="z1")
        solver.ask("DESCRIBE", what="group", group="all")
        fields = "u,phi" if polar else "u"
        solver.ask("SELECT", set="top", role="prescribe", id=[5, 6, 7, 8], fields=fields)
        solver.ask("SELECT", set="base", role="report", id=[1, 2], fields=fields)
        reply = solver.ask("READY")
        every = {name for name, *_ in port_messages.SET_REPLIES["solid report"]}
        rest = every - {"force", "moment"}
        if not polar:
            rest = {name for name in rest if not name.startswith("phi")}
        assert members(reply, "base") == rest
        verb, t1 = ("ADVANCE", 1.0e-7) if kind == "explicit" else ("SOLVE", 1.0)
        reply = solver.ask(verb, 0.0, t1, top__u=np.full((4, 3), 1.0e-9))
        assert {"reaction", *rest} <= members(reply, "top")
        solver.ask("ACCEPT")
        reply = solver.ask("FORCE", t1, t1, scope="interface")
        assert members(reply, "base") == ({"force", "moment"} if polar else {"force"})
        solver.ask("FORCE", t1, t1, scope="loads", set="top")
        if kind == "explicit":
            solver.ask("KICK_DRIFT", t1, t1 + 1.0e-7, kick=1.0e-7, drift=1.0e-7)
        solver.ask("REJECT")
        solver.ask("CHECKPOINT", tag="one")
        solver.end()
    finally:
        solver.process.kill()
        solver.process.wait()


def test_c_header_has_the_same_numbers(tmp_path: Path) -> None:
    """A C11 program without warnings prints what Python has."""
    lines = []
    for table, prefix in (("VERBS", "VERB"), ("KINDS", "KIND"), ("STATUS", "STATUS"),
                          ("CELLS", "CELL"), ("FLAGS", "FLAG"), ("SCALARS", "SCALAR"),
                          ("HEADER", "HEADER")):  # fmt: skip
        for name, number in getattr(port_names, table).items():
            lines.append((f'"%d", (int)TALUS_{prefix}_{name.upper()}', str(number)))
    for name, value in vars(port_names.Field).items():
        if name.isupper():
            lines.append((f'"%s", TALUS_FIELD_{name}', value))
    for word in port_names.CAPABILITIES:
        lines.append((f'"%s", TALUS_CAN_{word.upper()}', word))
    body = "\n".join(f"  printf({text}); putchar(10);" for text, _ in lines)
    binary = str(tmp_path / "names")
    source = tmp_path / "names.c"
    source.write_text(f'#include <stdio.h>\n#include "talus_port_names.h"\n'
                      f"int main(void) {{\n{body}\n  return 0;\n}}\n")  # fmt: skip
    flags = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
    command = ["gcc", *flags, f"-I{ROOT / 'common/port'}", str(source), "-o", binary]
    subprocess.run(command, check=True)
    done = subprocess.run([binary], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [value for _, value in lines]


def test_damaged_message(tmp_path: Path) -> None:
    """A message whose content was changed after it was written is refused (E534)."""
    stem = str(tmp_path / "side")
    message = Message(verb=3, sequence=7, step=5, t0=0.5, t1=1.0)
    message.put({"a": np.arange(6.0).reshape(3, 2), "b": 4, "c": "text"})
    write_message(stem, message, "reply")
    again = read_message(stem, 7, "reply", lambda: False)
    assert again and again.text("c") == "text" and again.t1 == 1.0
    for name, value in (("a", 2.0), ("b", 5)):
        write_message(stem, message, "reply")
        with h5py.File(f"{stem}.00000007.reply.h5", "r+") as file:
            values = file["fields"][name][()]
            values.reshape(-1)[-1] = value
            file["fields"][name][...] = values
        with pytest.raises(FaultError) as fault:
            read_message(stem, 7, "reply", lambda: False)
        assert (fault.value.code, fault.value.exit_code) == ("E534", 4)
    write_message(stem, message, "reply", words=17)
    with pytest.raises(FaultError, match="E534"):
        read_message(stem, 7, "reply", lambda: False)
