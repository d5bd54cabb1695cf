"""Solvers of another make at the port: libtalus_port in C, talus.port in Python."""

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from port_decks import GRAINS, SOLID

from talus.cli import main
from talus.faults import FaultError
from talus.mesh import box, write_mesh
from talus.port import Message
from talus.port import place as own_place
from talus.port_names import PROTOCOL, VERBS
from talus.port_shm import SharedEnd, checksum, find_library, is_whole
from talus.port_test import Options
from talus.port_test import test_solver as find_faults
from talus.programs import find_program
from talus.verification import read_history, write_packing

ROOT = Path(__file__).parents[2]
FLAGS = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
PROBE = """#include <talus_port.h>
static void answer(struct talus_port *port, void *state)
{
    (void)state;
    switch (talus_port_verb(port)) {
    case TALUS_VERB_HELLO: talus_port_put_hello(port, "probe", "1", "none"); break;
    case TALUS_VERB_SELECT: talus_port_select(port, 8); break;
    case TALUS_VERB_DESCRIBE:
        talus_port_text(port, TALUS_FIELD_WHAT);
        talus_port_put_reals(port, TALUS_FIELD_X, 3, -1, NULL);
        break;
    case TALUS_VERB_CHECKPOINT: talus_port_put_file(port, "nowhere.chk"); break;
    default: break;
    }
}
int main(int argc, char **argv)
{
    return talus_port_serve(talus_port_open(talus_port_spec(argc, argv)), "report,checkpoint",
                            answer, NULL);
}
"""
RADIUS, SPEED, CONTACT, SPRING = 5.0e-3, 1.0, 1.0e5, 4.0e5
MASS = 2650.0 * 4 / 3 * np.pi * RADIUS**3


def build(source: Path, binary: Path, kind: str = "so") -> str:
    """Compile a partner against the shared or the static library, without warnings."""
    folder = Path(find_library()).parent
    include = [f"-I{ROOT / 'libport'}", f"-I{ROOT / 'common/port'}"]
    link = [f"-L{folder}", f"-Wl,-rpath,{folder}", "-ltalus_port"]
    if kind == "a":
        link = [str(folder / "libtalus_port.a"), "-lpthread", "-lrt"]
    command = ["gcc", *FLAGS, *include, str(source), "-o", str(binary), *link]
    subprocess.run(command, check=True)
    return str(binary)


SIDE, PROOF = 576, 336  # offset of the solver's side in a segment, of its proof there (bytes)


class Asker:
    """Asks a solver in shared memory."""

    def __init__(self, command: list[str], folder: Path) -> None:
        """Make the segment and start the solver."""
        spec = f"shm:/talus-{os.getpid()}-test-{folder.name}"
        self.end, self.sequence = SharedEnd.offer(spec, "test"), 0
        self.process = subprocess.Popen([*command, f"--port={spec}"], cwd=folder)

    def ask(self, verb: str, **fields: object) -> Message:
        """Send a request and return the reply, which is whole."""
        self.sequence += 1
        request = Message(VERBS[verb], self.sequence, 0, 0.0, 1.0)
        request.put({name.replace("__", "."): value for name, value in fields.items()})
        self.end.push(request.words(checksum))
        words = self.end.pull(20.0)
        assert words is not None and is_whole(words)
        reply = Message.of_words(words)
        assert (reply.sequence, reply.verb) == (self.sequence, VERBS[verb])
        return reply

    def code(self, verb: str, **fields: object) -> str:
        """Return the code of the fault that a request gives."""
        return self.ask(verb, **fields).text("error.code")

    def hello(self) -> Message:
        """Greet."""
        return self.ask("HELLO", run_id="test", restart="", protocol=PROTOCOL)


def test_a_stranger_on_the_segment() -> None:
    """Who joins without the run id is refused with P027, and so is the port of another run."""
    name = f"talus-{os.getpid()}-stranger"
    asker = SharedEnd.offer(f"shm:/{name}", "this-run")
    with Path(f"/dev/shm/{name}").open("r+b") as segment:
        solver = SharedEnd(f"shm:/{name}")
        segment.seek(SIDE + PROOF)
        segment.write(b"a guess.")
    with pytest.raises(FaultError, match="P027: who has joined"):
        asker.pull(1.0)
    solver.close()
    asker.close()


def test_the_port_of_another_run(tmp_path: Path) -> None:
    """A rendezvous file that names another run than the segment is refused with P027."""
    name = f"talus-{os.getpid()}-other"
    for run_id, joins in (("another-run", False), ("this-run", True)):
        asker = SharedEnd.offer(f"shm:/{name}", "this-run")
        (tmp_path / "meet").write_text(f"shm:/{name}\nhost\nplace\n{run_id}\n")
        if joins:
            SharedEnd(f"attach:{tmp_path / 'meet'}").close()
        else:
            with pytest.raises(FaultError, match="P027: .*not of the run another-run"):
                SharedEnd(f"attach:{tmp_path / 'meet'}")
            Path(f"/dev/shm/{name}").unlink()
        asker.close()


@pytest.mark.parametrize("transport", ["shm", "hdf5"])
@pytest.mark.parametrize("side", ["grains", "solid"])
def test_a_rendezvous_of_a_former_run(side: str, transport: str, tmp_path: Path) -> None:
    """Our solvers leave with P027 where the file names another run, and the port stays as it is."""
    program = {"grains": "talus-dem", "solid": "talus-fem"}[side]
    (tmp_path / "deck.nml").write_text(GRAINS if side == "grains" else SOLID.format(kind="static"))
    x = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [4.0, 0.0, 0.0]])
    write_packing(tmp_path / "pack.h5", 1.0e-3 * x, np.full((3, 3), 1.0e-3))
    write_mesh(tmp_path / "cube.h5", box(np.zeros(3), np.ones(3), (1, 1, 1)))
    name, asker = f"talus-{os.getpid()}-former-{side}", None
    if transport == "shm":
        asker = SharedEnd.offer(f"shm:/{name}", "this-run")
        spec, port = f"shm:/{name}", Path(f"/dev/shm/{name}")
    else:
        spec, port = f"hdf5:{tmp_path}/{side}", tmp_path / f"{side}.port"
        port.write_text(f"talus-port 1\nthis-run\n{own_place()}\n{os.getpid()}\nfalse\n")
    (tmp_path / "meet").write_text(f"{spec}\nhost\n{own_place()}\nformer-run\n")
    run = subprocess.run(
        [str(find_program(program)), "deck.nml", f"--port=attach:{tmp_path / 'meet'}"],
        cwd=tmp_path, capture_output=True, text=True, timeout=60.0,
    )  # fmt: skip
    there = port.exists()
    if asker is not None:
        asker.close()
    assert run.returncode == 4, run.stderr
    assert run.stderr.count("error P027") == run.stderr.count("error ") == 1
    assert "former-run" in run.stderr
    assert there
    assert not list(tmp_path.glob("*.joined"))
    assert not list(tmp_path.glob("deck_*"))


def build_in_fortran(source: Path, binary: Path) -> str:
    """Compile a partner with the module of libtalus_port, without warnings."""
    folder = Path(find_library()).parent
    modules = [ROOT / "common/base/talus_kinds.f90", ROOT / "common/port/talus_verbs.f90",
               ROOT / "common/port/talus_port_names.f90", ROOT / "common/port/talus_scalars.f90",
               ROOT / "libport/talus_port_partner.f90"]  # fmt: skip
    command = ["gfortran", "-std=f2018", "-Wall", "-Wno-maybe-uninitialized", "-Werror",
               *map(str, modules), str(source), "-o", str(binary), f"-L{folder}",
               f"-Wl,-rpath,{folder}", "-ltalus_port"]  # fmt: skip
    subprocess.run(command, check=True, cwd=binary.parent)
    return str(binary)


@pytest.mark.parametrize("kind", ["so", "a", "f90"])
def test_spring_bed(kind: str, tmp_path: Path) -> None:
    """A grain rebounds from the partner in C and Fortran as contact and spring in series demand."""
    case = ROOT / "verification/couple/port_partner"
    source = ROOT / "examples/12-own-solver/spring_bed"
    if kind == "f90":
        build_in_fortran(source.with_suffix(".f90"), tmp_path / "spring_bed")
    else:
        build(source.with_suffix(".c"), tmp_path / "spring_bed", kind)
    start = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2 * RADIUS + 2.0e-5]])
    write_packing(
        tmp_path / "pack.h5", start, np.full((2, 3), RADIUS), kind=np.array([1, 0]),
        v=np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -SPEED]]), groups={"ghost": np.array([1])},
    )  # fmt: skip
    (tmp_path / "stiffness.txt").write_text(f"{SPRING}\n")
    (tmp_path / "grains.nml").write_text((case / "grains.nml").read_text())
    deck = (case / "coupled.nml").read_text().replace("@command@", str(tmp_path / "spring_bed"))
    for old, new in (("plate.toml", "stiffness.txt"), ("@exchange@", "8e-6"),
                     ("'hdf5'", "'shared_memory'")):  # fmt: skip
        deck = deck.replace(old, new)
    (tmp_path / "coupled.nml").write_text(deck)
    subprocess.run([find_program("talus-couple"), "coupled.nml"], cwd=tmp_path, check=True)
    audit = read_history(tmp_path / "coupled_audit.csv")
    series = CONTACT * SPRING / (CONTACT + SPRING)
    omega = np.sqrt(series / MASS)
    loss = 0.5 * np.pi * omega * 8e-6 * series / SPRING  # the lag of an exchange (port_partner)
    left = audit["grains_kinetic"][-1] / (0.5 * MASS * SPEED**2)
    assert abs(left - (1.0 - loss)) < (omega * 8e-6) ** 2 * series / SPRING
    force = -audit["force_on_solid_z"].min() / (SPEED * np.sqrt(MASS * series))
    assert abs(force - 1.0) < 0.5 * loss


def test_spring_bed_in_fortran_keeps_to_the_page(tmp_path: Path) -> None:
    """All verbs, legal and illegal."""
    bed = build_in_fortran(ROOT / "examples/12-own-solver/spring_bed.f90", tmp_path / "bed")
    (tmp_path / "stiffness.txt").write_text(f"{SPRING}\n")
    found, asked, side = find_faults([bed, str(tmp_path / "stiffness.txt")], Options(facets="top"))
    assert not found, found
    assert asked > 40 and side == "solid"


def test_library_refuses_what_the_page_refuses(tmp_path: Path) -> None:
    """Order, capabilities, fields, ids, files: each fault has its code, and the solver goes on."""
    (tmp_path / "probe.c").write_text(PROBE)
    asker = Asker([build(tmp_path / "probe.c", tmp_path / "probe")], tmp_path)
    try:
        assert asker.code("READY") == "P021"
        assert asker.code("HELLO", run_id="test", restart="", protocol=99) == "P005"
        hello = asker.hello()
        assert hello.text("program") == "probe" and hello.text("capabilities").startswith("report")
        assert hello.fields["gravity"].shape == (3,)
        assert asker.code("ACCEPT") == "P021"
        assert asker.code("SELECT", set="a", role="report", id=[1, 9]) == "P425"
        assert asker.code("SELECT", set="a", role="report", id=[1.0]) == "P011"
        assert asker.code("SELECT", set="a", role="report", id=np.ones((2, 2), int)) == "P010"
        assert asker.code("SELECT", set="a", role="report") == "P009"
        assert asker.code("SELECT", set="a", role="report", id=[1], more=1.0) == "P012"
        assert asker.code("SELECT", set="a", role="load", id=[1]) == "P427"
        assert asker.code("SELECT", set="a", role="report", id=[1, 8]) == ""
        assert asker.code("DESCRIBE", what="mesh") == "P426"
        assert asker.code("CHECKPOINT", tag="one") == "P428"
        assert asker.code("READY") == ""
        assert asker.code("SOLVE", trial=1) == "P427"
        assert asker.ask("STOP", early=1).status == 0
        assert asker.process.wait(20) == 3
    finally:
        asker.process.kill()
        asker.process.wait()


def test_library_leaves_with_its_partner(tmp_path: Path) -> None:
    """A solver leaves with exit code 4 when talus-couple is gone, or a message is damaged."""
    (tmp_path / "probe.c").write_text(PROBE)
    binary = build(tmp_path / "probe.c", tmp_path / "probe")
    asker = Asker([binary], tmp_path)
    asker.hello()
    asker.end.close()
    assert asker.process.wait(20) == 4
    asker = Asker([binary], tmp_path)
    words = Message(VERBS["HELLO"], 1).words(checksum)
    words[4] += 1
    asker.end.push(words)
    assert asker.process.wait(20) == 4
    with pytest.raises(FaultError) as fault:
        asker.end.pull(20.0)
    assert fault.value.code == "E572"
    asker = Asker([binary], tmp_path)
    asker.hello()
    assert asker.ask("ABORT").status == 0
    assert asker.process.wait(20) == 4


def test_fields_are_views(tmp_path: Path) -> None:
    """Fields of a message that arrived share its memory; damaged ones are refused (E570)."""
    message = Message(VERBS["SET"], 3, 0, 0.0, 1.0)
    message.put({"x": np.arange(6.0).reshape(2, 3), "id": [1, 2, 3], "what": "springs", "e": ""})
    words = message.words(checksum)
    again = Message.of_words(words)
    assert np.shares_memory(again.fields["x"], words) and again.fields["x"].shape == (2, 3)
    assert np.shares_memory(again.fields["id"], words) and again.text("what") == "springs"
    assert again.fields["e"] == b"" and again.t1 == 1.0
    for place, value in ((0, 1), (9, 7), (8, 3), (8, 9), (22, 9), (25, 10**6)):
        wrong = words.copy()
        wrong[place] = value
        with pytest.raises(FaultError, match="E570"):
            Message.of_words(wrong)


def test_no_port(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A partner without a port, or without the library, says so."""
    here = ROOT / "examples/12-own-solver"
    done = subprocess.run([sys.executable, str(here / "elastic_block.py"),
                           str(ROOT / "verification/couple/own_solver/block.toml")],
                          capture_output=True, text=True)  # fmt: skip
    assert done.returncode and "E573" in done.stderr
    with pytest.raises(FaultError, match="E572"):
        SharedEnd("tcp:4711")
    monkeypatch.setenv("TALUS_BIN", str(tmp_path))
    monkeypatch.setattr("talus.port_shm.NAME", "libtalus_port_absent.so")
    monkeypatch.setattr("ctypes.util.find_library", lambda name: None)
    with pytest.raises(FaultError, match="E571"):
        find_library()


BLOCK = [sys.executable, str(ROOT / "examples/12-own-solver/elastic_block.py"),
         str(ROOT / "verification/couple/own_solver/block.toml")]  # fmt: skip
FAULTY = f"""import sys, time, tomllib
sys.path.insert(0, {str(ROOT / "examples/12-own-solver")!r})
import numpy as np
from elastic_block import Block
from talus import port
from talus.faults import FaultError
from talus.port import Message, place, port_of

class Faulty(Block):
    longest = 0.0

    def ready(self, request):
        if sys.argv[2] == "late":
            time.sleep(60.0)
        return super().ready(request)

    def state(self, iterations):
        reply = super().state(iterations)
        if sys.argv[2] == "shape":
            reply["t_load.u"] = np.zeros((7, 3))
        if sys.argv[2] == "nan":
            reply["t_load.v"] = np.full((4, 3), np.nan)
        if sys.argv[2] == "missing":
            del reply["iterations"]
        if sys.argv[2] == "kind":
            reply["iterations"] = 1.0
        if sys.argv[2] == "unknown":
            reply["t_load.w"] = np.zeros((4, 3))
        return reply

    def reject(self, request):
        return {{}} if sys.argv[2] == "reject" else super().reject(request)

    def balance(self, load):
        super().balance(load)
        if sys.argv[2] == "reject":
            self.trials = getattr(self, "trials", 0) + 1
            self.u += 1e-9 * self.trials
        return 1

    def check_order(self, request):
        if sys.argv[2] != "order":
            super().check_order(request)

    def refuse(self, code, message, hint="x"):
        raise FaultError("" if sys.argv[2] == "code" else code, message, hint, "x", 4)

class Forger(Message):
    def words(self, checksum):
        words = super().words(checksum)
        words[10] += 1
        return words

if sys.argv[2] == "checksum":
    port.Message = Forger
block = Faulty(**tomllib.load(open(sys.argv[1], "rb")))
code = block.run(port_of(sys.argv))
sys.exit(7 if sys.argv[2] == "exit" else code)
"""


def found_by_test(command: list[str], **choices: object) -> list[tuple[str, str]]:
    """Return what `talus port-test` finds."""
    return find_faults(command, Options(**choices))[0]


@pytest.mark.parametrize("transport", ["shared_memory", "hdf5"])
def test_conformance_of_talus(transport: str, tmp_path: Path,
                              monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    """talus-fem and talus-dem do what the page says."""
    monkeypatch.chdir(tmp_path)
    x = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.999e-3], [0.01, 0.0, 0.0]])
    write_packing(tmp_path / "pack.h5", x, np.full((3, 3), 1e-3), groups={"all": np.arange(1, 4)})
    (tmp_path / "grains.nml").write_text(GRAINS)
    write_mesh(tmp_path / "cube.h5", box(np.zeros(3), np.full(3, 0.01), (1, 1, 1)))
    grains = [str(find_program("talus-dem")), "grains.nml"]
    assert found_by_test(grains, transport=transport, material="quartz", group="all") == []
    kinds = ("static", "explicit") if transport == "shared_memory" else ("static",)
    for kind in kinds:
        (tmp_path / "solid.nml").write_text(SOLID.format(kind=kind))
        solid = [str(find_program("talus-fem")), "solid.nml"]
        assert found_by_test(solid, transport=transport, facets="z1", group="all") == []


def test_conformance_of_examples(tmp_path: Path) -> None:
    """The block in numpy and the plate in C do what the page says."""
    binary = build(ROOT / "examples/12-own-solver/spring_bed.c", tmp_path / "spring_bed")
    (tmp_path / "stiffness.txt").write_text("4e5\n")
    assert found_by_test([binary, str(tmp_path / "stiffness.txt")], facets="top") == []
    assert found_by_test(BLOCK, transport="hdf5", facets="z1") == []


@pytest.mark.parametrize(("fault", "section", "text"), [
    ("shape", "Verbs", "the field 't_load.u' has 7 rows, 4 are due"),
    ("nan", "Verbs", "the field 't_load.v' holds 12 numbers that are not finite"),
    ("late", "Death and hang", "no reply and no sign of life for 2 s"),
    ("checksum", "Death and hang", "the checksum of the reply is not that of its content"),
    ("missing", "Verbs", "the field 'iterations' is missing"),
    ("kind", "Verbs", "the field 'iterations' holds reals, integer is due"),
    ("unknown", "Verbs", "the field 't_load.w' is not known"),
    ("reject", "Capabilities", "after REJECT the same step gives another scalars, t_load.u"),
    ("order", "Verbs", "READY before HELLO was not refused"),
    ("code", "A message", "error.code is '', not a letter and three digits"),
    ("exit", "What a partner does", "after STOP the exit code is 7, 0 is due"),
])  # fmt: skip
def test_faulty_solver_is_found(fault: str, section: str, text: str, tmp_path: Path,
                                monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    """Each fault of a solver is found, with the section of the page that says so."""
    monkeypatch.setattr("talus.port_test.ENDS", ())
    (tmp_path / "faulty.py").write_text(FAULTY)
    small = (ROOT / "verification/couple/own_solver/block.toml").read_text()
    (tmp_path / "block.toml").write_text(small.replace("[4, 4, 3]", "[1, 1, 1]"))
    command = [sys.executable, str(tmp_path / "faulty.py"), str(tmp_path / "block.toml"), fault]
    found = found_by_test(command, time_limit=2.0)
    assert any(section == page and text in line for page, line in found), found


def test_command_tells_what_it_found(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """`talus port-test` ends with E574 for a faulty solver, E575 for none."""
    (tmp_path / "mute.py").write_text("import sys\nsys.exit(5)\n")
    assert main(["port-test", "--", sys.executable, str(tmp_path / "mute.py")]) == 1
    said = capsys.readouterr()
    assert "the solver ended with exit code 5 and did not answer" in said.out
    assert "error E574: 1 faults" in said.err
    assert main(["port-test", "--", str(tmp_path / "absent")]) != 0
    assert "error E575" in capsys.readouterr().err


@pytest.mark.parametrize("transport", ["shared_memory", "hdf5"])
def test_port_is_of_its_user_alone(transport: str, tmp_path: Path) -> None:
    """Segments and files have the mode 0600, folders 0700; names differ from run to run."""
    case = ROOT / "verification/couple/port_partner"
    x = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.011]])
    write_packing(tmp_path / "pack.h5", x, np.full((2, 3), RADIUS), kind=np.array([1, 0]),
                  groups={"ghost": np.array([1])})  # fmt: skip
    (tmp_path / "grains.nml").write_text((case / "grains.nml").read_text())
    (tmp_path / "plate.toml").write_text("")
    deck = (case / "coupled.nml").read_text().replace("@exchange@", "8e-6")
    deck = deck.replace("'command', command = '@command@'", "'attach'")
    (tmp_path / "coupled.nml").write_text(deck.replace("'hdf5'", f"'{transport}'"))
    names = []
    for _ in range(2):
        with (tmp_path / "out.txt").open("w") as out:
            run = subprocess.Popen([find_program("talus-couple"), "coupled.nml"], cwd=tmp_path,
                                   stdout=out)  # fmt: skip
        try:
            offers: list[Path] = []
            for _ in range(200):
                offers = list(tmp_path.glob("*.solid.port"))
                if offers:
                    break
                time.sleep(0.05)
            spec = offers[0].read_text().splitlines()[0]
            names.append(spec.partition("talus-")[2].partition("-")[2])
            if transport == "hdf5":
                folder = (tmp_path / spec.removeprefix("hdf5:")).parent
                assert folder.stat().st_mode & 0o777 == 0o700
                files = [f for f in folder.iterdir() if ".h5" not in f.name]
            else:
                files = [Path("/dev/shm") / spec.removeprefix("shm:/")]
            modes = {f.name: oct(f.stat().st_mode & 0o777) for f in files}
            assert files and set(modes.values()) == {"0o600"}, modes
        finally:
            run.kill()
            run.wait(60)
            for left in [*offers, *Path("/dev/shm").glob(f"talus-{run.pid}-*")]:
                left.unlink(missing_ok=True)
    assert names[0] != names[1]
