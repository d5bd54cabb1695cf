"""Elements that are opened before a body: exact at rest, the same bits after a restart, bounded."""

import subprocess
from pathlib import Path

import numpy as np
import pytest
from opened_column import D, fly, spheres, write

from talus.mesh import read_mesh, write_mesh
from talus.packing import read_packing, write_h5
from talus.programs import find_program
from talus.verification import field_steps, read_history, start_on_ranks


def run(folder: Path, *words: str) -> subprocess.CompletedProcess:
    """Run talus-couple."""
    command = [str(find_program("talus-couple")), "coupled.nml", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


def use_contacts(folder: Path, contacts: str) -> None:
    """Evaluate contacts of ghosts in every step or once an exchange; 'free': also a free rim."""
    deck = folder / "coupled.nml"
    when = "exchange" if contacts == "free" else contacts
    text = deck.read_text().replace("&overlap ", f"&overlap ghost_contacts = '{when}', ")
    if contacts == "free":
        text = text.replace("&overlap ", "&overlap rim_nodes = 'free', ")
    deck.write_text(text)


@pytest.mark.parametrize("contacts", ["step", "exchange", "free"])
def test_a_column_at_rest_does_not_notice(contacts: str, tmp_path: Path) -> None:
    """Grains wake and ghosts become free; nothing moves, and all have the contacts of the bed."""
    write(tmp_path)
    use_contacts(tmp_path, contacts)
    done = run(tmp_path)
    assert done.returncode == 0, done.stdout
    rows = read_history(tmp_path / "coupled_conversions.csv")
    assert len(rows["time"]) > 4 and rows["woken"].sum() >= 32 and rows["freed"].sum() >= 32
    assert rows["awake"][-1] == rows["awake"][0] + rows["woken"].sum()
    audit = read_history(tmp_path / "coupled_audit.csv")
    assert audit["grains_kinetic"].max() < 1e-12 * audit["grains_elastic"][-1]
    ledger = read_history(tmp_path / "grains_energy.csv")
    assert np.abs(ledger["relative_closure"]).max() < 1e-9
    assert np.abs(audit["total_energy"] - audit["conversion_energy"]
                  - audit["total_energy"][0]).max() < 1e-9 * audit["total_energy"][-1]  # fmt: skip
    last = field_steps(tmp_path / "grains.h5")[-1].grains
    row, copy = (last["id"] - 1) % 8, (last["id"] - 1) // 8
    x = spheres(range(2))[row] + copy[:, None] * np.array([0.0, 0.0, 2.0 * D])
    assert np.abs(last["x"] - x).max() < 1e-9 * D


def check_restarts(folder: Path) -> None:
    """Run a written column; from each of its first three checkpoints it has the same bits."""
    assert run(folder).returncode == 0
    names = ("coupled_audit.csv", "grains_energy.csv", "solid_energy.csv")
    whole = {name: (folder / name).read_bytes() for name in names if (folder / name).exists()}
    manifests = sorted(folder.glob("coupled.[0-9]*.manifest"))
    assert len(manifests) >= 3
    for manifest in manifests[:3]:
        done = run(folder, f"--restart={manifest.name}")
        assert done.returncode == 0, done.stdout
        for name, content in whole.items():
            assert (folder / name).read_bytes() == content, (manifest.name, name)


@pytest.mark.parametrize("contacts", ["step", "exchange", "free"])
def test_a_restart_has_the_same_bits(contacts: str, tmp_path: Path) -> None:
    """From every checkpoint, before and between conversions."""
    write(tmp_path, ", keep_behind = 4.0e-3, hold_behind = 1.0e-3")
    use_contacts(tmp_path, contacts)
    check_restarts(tmp_path)
    assert read_history(tmp_path / "coupled_conversions.csv")["left"].sum() > 0


@pytest.mark.parametrize("how", ["threads", "ranks", "files"])
def test_it_has_the_same_bits(how: str, tmp_path: Path) -> None:
    """With two threads of the grains, on two ranks, by files."""
    write(tmp_path, ", keep_behind = 4.0e-3, hold_behind = 1.0e-3")
    assert run(tmp_path).returncode == 0
    one = (tmp_path / "coupled_audit.csv").read_bytes()
    deck = tmp_path / "coupled.nml"
    if how == "threads":
        deck.write_text(deck.read_text().replace("grains.nml', threads = 1",
                                                 "grains.nml', threads = 2"))  # fmt: skip
    elif how == "files":
        deck.write_text(deck.read_text() + "&port transport = 'hdf5' /\n")
    else:
        start_on_ranks(deck, "grains", 2, find_program("talus-dem"))
    done = run(tmp_path)
    assert done.returncode == 0, done.stdout
    assert (tmp_path / "coupled_audit.csv").read_bytes() == one


def squeeze(folder: Path) -> None:
    """Let the column be pressed together along its length, without supports."""
    fly(folder)
    packing = read_packing(folder / "packing.h5")
    packing.v[:, 2] = -50.0 * (packing.x[:, 2] - 16.0 * D)
    write_h5(folder / "packing.h5", packing)
    deck = folder / "solid.nml"
    deck.write_text("".join(line for line in deck.read_text().splitlines(keepends=True)
                            if not line.startswith("&initial")))  # fmt: skip


def test_elements_that_are_strained_are_opened(tmp_path: Path) -> None:
    """Those of ghosts beyond open_strain, wherever the body is; the same bits after a restart."""
    opened = {}
    for name, more in (("plain", ""), ("strained", ", open_strain = 2.0e-3")):
        folder = tmp_path / name
        folder.mkdir()
        write(folder, more)
        squeeze(folder)
        done = run(folder)
        assert done.returncode == 0, done.stderr
        rows = read_history(folder / "coupled_conversions.csv")
        opened[name] = dict(zip(rows["time"], rows["opened"], strict=True))
        front = dict(zip(rows["time"], rows["front_strain"], strict=True))
    over = [time for time, strain in front.items() if strain > 2.0e-3]
    assert over and opened["strained"][over[0]] > opened["plain"][over[0]]
    before = [time for time in front if time < over[0]]
    assert all(opened["strained"][time] == opened["plain"][time] for time in before)
    whole = (folder / "coupled_audit.csv").read_bytes()
    done = run(folder, f"--restart={sorted(folder.glob('coupled.[0-9]*.manifest'))[0].name}")
    assert done.returncode == 0, done.stderr
    assert (folder / "coupled_audit.csv").read_bytes() == whole


def test_the_front_does_not_reach_the_end_of_the_bed(tmp_path: Path) -> None:
    """N460: elements at a held face cannot be opened by their strain."""
    write(tmp_path, ", open_strain = 2.0e-3")
    squeeze(tmp_path)
    deck = tmp_path / "solid.nml"
    deck.write_text(deck.read_text() + "&support group = 'z0', fix = 'x', 'y', 'z' /\n")
    done = run(tmp_path)
    assert done.returncode == 2, done.stdout
    assert "error N460: element 1, which the deck of the solid holds, is strained" in done.stderr


def test_a_fault_of_the_input_within_a_run_ends_with_2(tmp_path: Path) -> None:
    """I425 where a thin element of few grains is opened: the last checkpoint is good."""
    write(tmp_path)
    mesh = read_mesh(tmp_path / "bar.h5")
    mesh.x[np.isclose(mesh.x[:, 2], 22.0 * D), 2] = 21.0 * D
    write_mesh(tmp_path / "bar.h5", mesh)
    done = run(tmp_path)
    assert done.returncode == 2, done.stdout
    assert "error I425" in done.stderr
    assert len(list(tmp_path.glob("coupled.*manifest"))) >= 1


@pytest.mark.parametrize("factor", [1.0, 1.2])
def test_grains_and_continuum_weigh_the_same(factor: float, tmp_path: Path) -> None:
    """W432 where they do not by a tenth; gap_mass at each conversion."""
    write(tmp_path)
    fly(tmp_path)
    deck = tmp_path / "solid.nml"
    words = deck.read_text().split("density = ")
    density, rest = words[1].split(",", 1)
    deck.write_text(f"{words[0]}density = {float(density) * factor!r},{rest}")
    done = run(tmp_path)
    assert done.returncode == 0, done.stderr
    assert ("warning: W432: ghosts have 0.83" in done.stdout + done.stderr) == (factor > 1.0)
    rows = read_history(tmp_path / "coupled_conversions.csv")
    assert np.abs(rows["gap_mass"] - (1.0 / factor - 1.0)).max() < 1e-6


def test_no_more_grains_wake_than_allowed(tmp_path: Path) -> None:
    """N463, after the last checkpoint."""
    write(tmp_path, ", most_grains = 70")
    done = run(tmp_path)
    assert done.returncode == 2
    assert "error N463" in done.stderr and "more than most_grains = 70" in done.stderr


@pytest.mark.parametrize("steps", [0, 400])
def test_new_free_grains_come_to_rest(steps: int, tmp_path: Path) -> None:
    """With rest_steps they do; where they are at rest no step is taken."""
    write(tmp_path, f", rest_steps = {steps}" if steps else "")
    assert run(tmp_path).returncode == 0
    rows = read_history(tmp_path / "coupled_conversions.csv")
    assert rows["rest_steps"].max() == 0 and rows["unbalanced"].max() < 1e-9


def test_elements_without_weight_may_have_modes_of_their_own(tmp_path: Path) -> None:
    """Incompatible modes are condensed also where opened elements have no stiffness."""
    write(tmp_path)
    deck = tmp_path / "solid.nml"
    soil = "material = 'soil'"
    text = deck.read_text().replace(f"{soil} /", f"{soil}, element = 'hex8_incompatible' /")
    deck.write_text(text)
    done = run(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    audit = read_history(tmp_path / "coupled_audit.csv")
    assert audit["grains_kinetic"].max() < 1e-12 * audit["grains_elastic"][-1]


def test_a_body_beside_the_bed_opens_nothing(tmp_path: Path) -> None:
    """I421: no grain is awake, the bed has none to couple."""
    write(tmp_path)
    deck = tmp_path / "coupled.nml"
    deck.write_text(deck.read_text().replace("centre = 1.0e-3, 1.0e-3,", "centre = 1.0e-3, 0.1,"))
    done = run(tmp_path)
    assert done.returncode == 1
    assert "error I421: 0 free grains" in done.stderr


@pytest.mark.parametrize("contacts", ["step", "exchange", "free"])
def test_a_bed_that_flies_keeps_its_momentum(contacts: str, tmp_path: Path) -> None:
    """Conversions bring no momentum or kinetic energy where the solid has the mass of grains."""
    write(tmp_path)
    use_contacts(tmp_path, contacts)
    mass = fly(tmp_path)
    done = run(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = read_history(tmp_path / "coupled_conversions.csv")
    assert rows["freed"].sum() >= 32
    assert rows["momentum"].max() < 1e-11 * 128 * mass
    assert np.abs(rows["kinetic"]).max() < 1e-11 * 64 * mass
    audit = read_history(tmp_path / "coupled_audit.csv")
    assert audit["momentum_z"][0] == pytest.approx(128 * mass, rel=1e-9)  # at 1 m/s
    assert np.ptp(audit["momentum_z"]) < 1e-9 * 128 * mass
