"""`talus new`: every template passes the check of its program, and small ones run to their end."""

import json
import os
import shlex
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from talus import cli, templates
from talus.fields import GHOST, FieldFile
from talus.packing import read_packing
from talus.programs import find_program, program_of
from talus.verification import read_history

#: smaller than --small, where the default of the kind would take more than two seconds
TINY = {
    "hopper": ["grains=25", "open_for=0.1", "width=0.04"],
    "penetration": ["grains=60", "width=0.02", "depth=3e-3"],
}


def made(kind: str, folder: Path, *words: str) -> templates.Template:
    """Return the template after `talus new` wrote its small form."""
    assert cli.main(["new", kind, "--small", "-o", str(folder), *words]) == 0
    return templates.load(kind)


def solve(folder: Path, line: str) -> dict:
    """Run a deck of a template and return its summary."""
    deck, *options = line.split()
    program = find_program(program_of(folder / deck))
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    done = subprocess.run([program, deck, *options], cwd=folder, env=environment,
                          capture_output=True, text=True, timeout=60)  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr
    return json.loads((folder / f"{Path(deck).stem}_summary.json").read_text())


def between(folder: Path) -> None:
    """Work the commands of `talus` that run.sh has before its last program."""
    lines = (folder / "run.sh").read_text().splitlines()
    last = max(k for k, line in enumerate(lines) if line.startswith('"$bin"'))
    for line in lines[:last]:
        if line.startswith('"${TALUS:-talus}"'):
            words = shlex.split(line)[1:]
            names = [str(folder / w) if w.endswith(".h5") else w for w in words]
            assert cli.main(names) == 0


@pytest.mark.parametrize("kind", templates.kinds())
def test_check(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The decks are in order, no word in braces is left, and the README names every key."""
    template = made(kind, tmp_path / kind)
    capsys.readouterr()
    for deck in template.decks:
        assert cli.main(["check", str(tmp_path / kind / deck)]) == 0, capsys.readouterr().out
        if deck != template.decks[-1] and "packing = '" in (tmp_path / kind / deck).read_text():
            solve(tmp_path / kind, deck)  # the next deck reads what this one writes at its end
            between(tmp_path / kind)
    text = "".join(p.read_text() for p in (tmp_path / kind).iterdir() if p.suffix != ".h5")
    assert not templates.WORD.search(text.replace("${", ""))
    said = (tmp_path / kind / "README.md").read_text()
    assert "## Change first" in said and all(f"| `{name}` |" in said for name in template.keys)
    subprocess.run(["sh", "-n", tmp_path / kind / "run.sh"], check=True)


@pytest.mark.parametrize("kind", list(TINY))
def test_run(kind: str, tmp_path: Path) -> None:
    """A small one ends well; grains flow out of the hopper, the cone meets resistance."""
    template = made(kind, tmp_path / kind, "--set", *TINY[kind])
    for line in template.table["decks"]:
        assert solve(tmp_path / kind, line)["exit_code"] == 0
    if kind == "hopper":
        gone = read_history(tmp_path / kind / "hopper_sinks.csv")["grains"]
        assert gone[0] == 0 and gone[-1] > 5
    else:
        history = read_history(tmp_path / kind / "push_surfaces.csv")
        force = next(v for k, v in history.items() if k.startswith("force_z"))
        assert np.max(np.abs(force)) > 1e-3


def test_wheel(tmp_path: Path) -> None:
    """The bed carries a wheel that comes down and rolls: impulse, way and spin are those given."""
    made("wheel", tmp_path, "--set", "grains=100", "way=6e-3")
    for line in templates.load("wheel").table["decks"]:
        assert solve(tmp_path, line)["exit_code"] == 0
    mass, speed, radius, slip = 0.008, 0.2, 0.012, 0.2
    parts = read_history(tmp_path / "drive_surfaces.csv")
    side, ends = parts["part"] == 1, parts["part"] == 2
    time, lift = parts["time"][side], parts["force_z"][side] + parts["force_z"][ends]
    body = read_history(tmp_path / "drive_bodies.csv")
    impulse = np.sum(0.5 * np.diff(time) * (lift[1:] + lift[:-1]))
    gained = mass * (9.81 * time[-1] + body["velocity_z"][-1])
    assert impulse == pytest.approx(gained, rel=0.02)  # forces are sampled 400 times
    assert np.ptp(parts["x"][side]) == pytest.approx(6e-3 + 0.5 * 0.02 * speed, rel=1e-3)
    turning = speed / (radius * (1 - slip))
    assert body["spin_y"][-1] == pytest.approx(turning, rel=1e-5)  # six digits
    assert parts["z"][side][-1] < parts["z"][side][0]


def test_press(tmp_path: Path) -> None:
    """The block stands above the bed, goes down smoothly, and its head bears the bed's force."""
    words = ["--set", "grains=60", "radius=2.4e-3"]
    made("press", tmp_path, *words)
    settle, _, coupled = templates.load("press").table["decks"]
    assert solve(tmp_path, settle)["exit_code"] == 0
    between(tmp_path)
    level = read_packing(tmp_path / "level.h5")
    top = (level.x[:, 2] + level.axes[:, 2]).max()
    assert 0 < level.count < 60  # some grains reached above
    facts = solve(tmp_path, coupled)
    assert facts["health"]["verdict"] == "green"
    with FieldFile(tmp_path / "solid.h5") as solid:
        height = solid.mesh[0][:, 2]
        head = height > height.min() + 9.9e-3
        assert np.allclose(solid.read(-1).solid["u"][head, 2], -1.0e-3, rtol=1e-9)
    assert top < height.min()
    lift = read_history(tmp_path / "grains_surfaces.csv")["force_z"]
    held = read_history(tmp_path / "solid_reactions.csv")["z1 z"]
    weight = 1100 * 9.81 * 0.01 * 0.02**2 / 4
    assert lift[0] == 0.0 and lift[-1] > 0.01
    drag = 40.0 * weight / 9.81 * 1.0e-3 / (0.9 * 0.04)  # rayleigh_mass, at the steady speed
    # means of the last quarter: what still swings is 1 % of the weight
    part = slice(-len(lift) // 4, None)
    expected = weight - drag - np.mean(lift[part])
    assert np.mean(held[part]) == pytest.approx(expected, abs=0.02 * weight)


def test_what_follows() -> None:
    """Keys left out follow the others; at the defaults of these they have their own defaults."""
    one = templates.load("triaxial")
    plain = templates.complete(one, templates.settings(one, [], small=False))
    assert all(np.isclose(plain[name], key["default"]) for name, key in one.keys.items())
    given = ["radius=1e-3", "stress=8e4", "flat=1.5", "rate=3"]
    other = templates.complete(one, templates.settings(one, given, small=False))
    # half the size at four times the stress: all that grains do is four times as fast
    assert np.isclose(other["compressed"], (0.12 + np.log(1.5) / 8.0) / 4.0)
    assert (other["rate"], other["young"]) == (3.0, 14500 * 8.0e4)


def test_wave(tmp_path: Path) -> None:
    """The wall of the overlap moves all of the column at its speed; the stress is Z v."""
    made("overlap", tmp_path)
    assert solve(tmp_path, "coupled.nml")["exit_code"] == 0
    speed, young, bulk, side = 5.0e-3, 1.0e7, 2500.0 * np.pi / 6, 3 * 9.998e-3
    with FieldFile(tmp_path / "grains.h5") as grains, FieldFile(tmp_path / "solid.h5") as solid:
        own, nodes = grains.read(-1).grains, solid.read(-1).solid
        free, upper = own["kind"] != GHOST, solid.mesh[0][:, 2] > -0.15
        # the overlap sends a ripple of 2 % back (example 03)
        assert np.isclose(own["v"][free, 2].mean(), -speed, rtol=0.02)
        assert np.isclose(nodes["v"][upper, 2].mean(), -speed, rtol=0.02)
    force = read_history(tmp_path / "grains_walls.csv")["force_z"]
    step = side**2 * np.sqrt(young * bulk) * speed
    pressed = side**2 * 2.0e-4 * young
    assert np.isclose(force[0], pressed, rtol=2e-3)
    assert np.isclose(force[-1] - force[0], step, rtol=0.02)


def test_foreign(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The check of a coupled deck leaves the input of a solver of one's own alone, not the rest."""
    made("solver", tmp_path)
    assert cli.main(["check", str(tmp_path / "coupled.nml")]) == 0
    deck = tmp_path / "grains.nml"
    deck.write_text(deck.read_text().replace("young", "youngg", 1))
    capsys.readouterr()
    assert cli.main(["check", str(tmp_path / "coupled.nml")]) == 1
    assert "D011: talus-dem: unknown key 'youngg'" in capsys.readouterr().out


def test_geometry(tmp_path: Path) -> None:
    """Keys reach packings and decks; the hopper's plates have the given inclination."""
    words = ["--set", "grains=33", "angle=45", "opening=0.02"]
    made("hopper", tmp_path / "h", *words)
    assert read_packing(tmp_path / "h" / "start.h5").count == 33
    line = next(
        text for text in (tmp_path / "h" / "hopper.nml").read_text().splitlines()
        if "rectangle = 0.01," in text
    )  # fmt: skip
    corners = np.array([float(v) for v in line.split("=")[1].strip(" /").split(",")]).reshape(3, 3)
    up = corners[2] - corners[1]
    assert np.isclose(np.degrees(np.arctan2(up[2], up[0])), 45.0, atol=1e-4)


def test_questions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a terminal the few questions are asked once more after a wrong answer."""
    answers = iter(["many", "25", "", "", ""])
    monkeypatch.setattr("builtins.input", lambda text: next(answers))
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    made("drum", tmp_path / "d", "--set", "turns=0.2")
    assert read_packing(tmp_path / "d" / "start.h5").count == 25


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        ("hopper --set grain=10", "E630", "did you mean 'grains'"),
        ("hopper --set grains", "E630", "key=value"),
        ("hopper --set grains=many", "E631", "is no whole number"),
        ("hopper --set angle=95", "E631", "it must be at most 89 deg"),
        ("drum --set froude=nan", "E631", "out of its range"),
        ("drum -o full", "E632", "not empty"),
        ("hoper", "E500", "did you mean 'hopper'"),
    ],
)
def test_faults(
    words: str, code: str, text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Each fault has its code and leaves nothing behind."""
    monkeypatch.chdir(tmp_path)
    Path("full").mkdir()
    shutil.copy(__file__, "full/deck.nml")
    assert cli.main(["new", *words.split()]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"error {code}") and text in said
    assert [p.name for p in tmp_path.iterdir()] == ["full"]
