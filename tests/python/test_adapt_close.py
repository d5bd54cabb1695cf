"""Elements that close behind a body: exact at rest and in flight, the same bits after a restart."""

from pathlib import Path

import numpy as np
import pytest
from opened_column import OVERLAP, WIDE, D, fly, spheres, write
from test_adapt import run, use_contacts

from talus.mesh import box, write_mesh
from talus.packing import read_packing, write_h5
from talus.programs import find_program
from talus.verification import field_steps, read_history, start_on_ranks

CLOSING = ", close_behind = 2.0e-3"


def write_long(folder: Path, more: str = CLOSING) -> None:
    """Write the column and a way on which elements open and close many times."""
    write(folder, more, 20)
    deck = folder / "coupled.nml"
    deck.write_text(deck.read_text().replace("t_end = 1.2e-4", "t_end = 2.0e-4"))


LAWS = {
    "drucker_prager": "young = 1.0e8, cohesion = 0.0, friction_deg = 30.0, dilation_deg = 5.0",
    "cam_clay": "critical_slope = 1.2, compression_index = 0.1, swelling_index = 0.004, "
                "specific_volume = 1.9, poisson = 0.0, overconsolidation = 1.5",
    "sanisand": "poisson = 0.05, void_ratio = 0.8, stiffness_number = 125.0, "
                "critical_slope = 1.25, extension_ratio = 0.712, critical_void_ratio = 0.934, "
                "critical_line_slope = 0.019, critical_line_exponent = 0.7, yield_opening = 0.01, "
                "plastic_hardening = 7.05, hardening_void = 0.968, bounding_rate = 1.1, "
                "dilatancy = 0.704, dilatancy_rate = 3.5, fabric_limit = 4.0, fabric_rate = 600.0",
    "breakage": "young = 1.0e8, critical_slope = 1.2, breakage_energy = 1.0e5, "
                "breakage_angle_deg = 70.0, grading_index = 0.8, residual_pressure = 1.0e3",
}  # fmt: skip


def yields(folder: Path, law: str) -> None:
    """Give the solid of a written column a law with a state, and the stress of the spheres."""
    deck = folder / "solid.nml"
    constants = LAWS[law] + ("" if "poisson" in LAWS[law] else ", poisson = 0.0")
    text = deck.read_text().replace("young = 1.0e8, poisson = 0.0", f"law = '{law}', {constants}")
    value = "-1.0e4, -1.0e4, -2.0e4, 0.0, 0.0, 0.0"
    deck.write_text(text + f"&initial_stress group = 'all', value = {value} /\n")


def write_moving(folder: Path, law: str = "") -> None:
    """Write the same with grains that move a little, and a law with a state if one is named."""
    write_long(folder)
    if law:
        yields(folder, law)
    packing = read_packing(folder / "packing.h5")
    packing.v = 1e-3 * np.sin(1e3 * packing.x)
    write_h5(folder / "packing.h5", packing)


def push(folder: Path) -> None:
    """Press a written column from above, at its start by 0.4 m/s."""
    deck = folder / "solid.nml"
    text = deck.read_text()
    deck.write_text(text.replace("&analysis", "&initial group = 'all', component = 'z', value = "
                                 f"0.0, gradient = 0.0, 0.0, -25.0, origin = 0.0, 0.0, {16.0 * D} "
                                 "/\n&analysis"))  # fmt: skip


def test_elements_that_yield_are_opened(tmp_path: Path) -> None:
    """Those of ghosts beyond open_ratio, and no earlier; the same bits after a restart."""
    opened = {}
    for name, more in (("plain", ""), ("yielding", ", open_ratio = 1.1")):
        folder = tmp_path / name
        folder.mkdir()
        write(folder, more)
        yields(folder, "drucker_prager")
        push(folder)
        done = run(folder)
        assert done.returncode == 0, done.stderr
        rows = read_history(folder / "coupled_conversions.csv")
        opened[name] = rows["opened"]
    assert opened["yielding"][0] == opened["plain"][0]  # q/p is 0.75 at the start
    assert opened["yielding"][-1] > opened["plain"][-1]
    whole = (folder / "coupled_audit.csv").read_bytes()
    done = run(folder, f"--restart={sorted(folder.glob('coupled.[0-9]*.manifest'))[0].name}")
    assert done.returncode == 0, done.stderr
    assert (folder / "coupled_audit.csv").read_bytes() == whole


def test_elements_that_flow_are_opened(tmp_path: Path) -> None:
    """Those of ghosts beyond open_plastic, fewer the more of it is allowed; same bits anew."""
    opened = {}
    for name, limit in (("plain", 0.0), ("little", 1.0e-3), ("much", 1.0)):
        folder = tmp_path / name
        folder.mkdir()
        write(folder, f", open_plastic = {limit}")
        yields(folder, "drucker_prager")
        push(folder)
        done = run(folder)
        assert done.returncode == 0, done.stderr
        opened[name] = read_history(folder / "coupled_conversions.csv")["opened"]
    assert opened["little"][0] == opened["plain"][0]  # nothing has flowed at the start
    assert opened["little"][-1] > opened["plain"][-1]
    assert np.array_equal(opened["much"], opened["plain"])
    folder = tmp_path / "little"
    whole = (folder / "coupled_audit.csv").read_bytes()
    done = run(folder, f"--restart={sorted(folder.glob('coupled.[0-9]*.manifest'))[0].name}")
    assert done.returncode == 0, done.stderr
    assert (folder / "coupled_audit.csv").read_bytes() == whole


@pytest.mark.parametrize("key", ["open_ratio", "open_plastic"])
def test_a_solid_without_a_state_has_none(key: str, tmp_path: Path) -> None:
    """D460: neither the stress of the bed nor a plastic strain."""
    write(tmp_path, f", {key} = 1.0")
    done = run(tmp_path)
    assert done.returncode == 1
    assert f"error D460: {key} is given" in done.stdout + done.stderr


@pytest.mark.parametrize("contacts", ["step", "exchange"])
def test_a_column_at_rest_does_not_notice(contacts: str, tmp_path: Path) -> None:
    """As many grains fall asleep behind the body as wake before it; nothing moves."""
    write_long(tmp_path)
    use_contacts(tmp_path, contacts)
    done = run(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = read_history(tmp_path / "coupled_conversions.csv")
    assert rows["closed"].sum() >= 8 and rows["left"].sum() >= 56 and rows["awake"].max() <= 72
    audit = read_history(tmp_path / "coupled_audit.csv")
    assert audit["grains_kinetic"].max() < 1e-18 * audit["grains_elastic"][-1]
    assert np.abs(audit["total_energy"] - audit["conversion_energy"]
                  - audit["total_energy"][0]).max() < 1e-9 * audit["total_energy"][-1]  # fmt: skip
    last = field_steps(tmp_path / "grains.h5")[-1].grains
    row, copy = (last["id"] - 1) % 8, (last["id"] - 1) // 8
    x = spheres(range(2))[row] + copy[:, None] * np.array([0.0, 0.0, 2.0 * D])
    assert np.abs(last["x"] - x).max() < 1e-9 * D
    assert last["x"][:, 2].min() > 10.0 * D


@pytest.mark.parametrize("law", ["", "drucker_prager", "cam_clay"])
def test_a_restart_has_the_same_bits(law: str, tmp_path: Path) -> None:
    """From every checkpoint, before and between elements that close; on two threads, too."""
    write_moving(tmp_path, law)
    assert run(tmp_path).returncode == 0
    names = ("coupled_audit.csv", "grains_energy.csv", "coupled_conversions.csv")
    whole = {name: (tmp_path / name).read_bytes() for name in names}
    rows = read_history(tmp_path / "coupled_conversions.csv")
    assert rows["closed"].sum() >= 6
    assert rows["reborn"].sum() == (rows["closed"].sum() if law else 0)
    words = [f"--restart={name.name}" for name in sorted(tmp_path.glob("coupled.[0-9]*.manifest"))]
    assert len(words) >= 6
    for word in [*words, "threads"]:
        if word == "threads":
            deck = tmp_path / "coupled.nml"
            deck.write_text(deck.read_text().replace("threads = 1", "threads = 2"))
        done = run(tmp_path, *([] if word == "threads" else [word]))
        assert done.returncode == 0, done.stdout
        for name, content in whole.items():
            assert (tmp_path / name).read_bytes() == content, (word, name)


@pytest.mark.parametrize("contacts", ["step", "exchange"])
def test_a_bed_that_flies_keeps_its_momentum(contacts: str, tmp_path: Path) -> None:
    """Elements that close have the grains' momentum and kinetic energy where densities agree."""
    write_long(tmp_path)
    use_contacts(tmp_path, contacts)
    mass = fly(tmp_path)
    done = run(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = read_history(tmp_path / "coupled_conversions.csv")
    assert rows["closed"].sum() >= 8
    assert rows["momentum"].max() < 1e-11 * 160 * mass
    assert np.abs(rows["kinetic"]).max() < 1e-11 * 80 * mass
    audit = read_history(tmp_path / "coupled_audit.csv")
    assert np.ptp(audit["momentum_z"]) < 1e-9 * 160 * mass


def test_a_bed_that_moves_stays_open(tmp_path: Path) -> None:
    """Elements whose grains move past the strain do not close: nothing falls asleep."""
    write_long(tmp_path, CLOSING + ", quiet_moved = 1.0e-9")
    packing = read_packing(tmp_path / "packing.h5")
    packing.v = 1e-3 * np.random.default_rng(1).standard_normal((len(packing.x), 3))
    write_h5(tmp_path / "packing.h5", packing)
    done = run(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = read_history(tmp_path / "coupled_conversions.csv")
    assert rows["closed"].sum() == 0 and rows["left"].sum() == 0
    assert rows["past_strain"].max() > 1e-9


def test_nodes_left_to_the_continuum_go_on_as_they_were(tmp_path: Path) -> None:
    """A wave runs through: no acceleration of nodes that grains have left jumps at a closing."""
    write_long(tmp_path)
    packing = read_packing(tmp_path / "packing.h5")
    packing.v = np.zeros_like(packing.x)
    packing.v[:, 2] = 0.1 * np.sin(2.0 * np.pi * packing.x[:, 2] / (8.0 * D))
    write_h5(tmp_path / "packing.h5", packing)
    deck = tmp_path / "solid.nml"
    deck.write_text(deck.read_text() + "&output every_time = 1.0e-6 /\n")
    done = run(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = read_history(tmp_path / "coupled_conversions.csv")
    steps = list(field_steps(tmp_path / "solid.h5"))
    time = np.array([step.time for step in steps])
    kick = np.diff([step.solid["v"][:, 2] for step in steps], axis=0)
    closings = rows["time"][rows["left"] > 0]
    assert len(closings) >= 8
    for layer, when in enumerate(closings[:8]):  # each leaves one layer of four nodes
        at = np.abs(time - when).argmin()
        nodes = slice(4 * layer, 4 * layer + 4)
        jump = np.abs(kick[at, nodes] - kick[at - 1, nodes]).max()
        assert jump < kick[at - 1].std(), (layer, when)


def test_an_element_is_not_born_of_a_hollow(tmp_path: Path) -> None:
    """N464: grains fill so little of an element that its nodes would lie almost in a plane."""
    write_long(tmp_path)
    size = np.array([WIDE, 6.0 * WIDE, 40.0 * D])
    write_mesh(tmp_path / "bar.h5", box(np.zeros(3), size, (1, 1, 20)))
    for deck in tmp_path.glob("*.nml"):
        deck.write_text(deck.read_text().replace("gravity = 0.0, 0.0, 0.0",
                                                 "gravity = 0.0, -9.81, 0.0")
                        .replace("half = 1.0e-3, 1.0e-3", "half = 1.0e-3, 0.03")
                        .replace("young = 1.0e8", "young = 1.0e6"))  # fmt: skip
    done = run(tmp_path)
    assert done.returncode == 2, done.stdout[-2000:] + done.stderr
    assert "error N464: element" in done.stderr and "of its volume" in done.stderr


def love_weber() -> float:
    """Return the stress of the column along its length, four chains of Hertz contacts [Pa]."""
    modulus, overlap = 0.5 * 1.0e9 / (1.0 - 0.25**2), D * OVERLAP
    radius = 0.25 * D * (1.0 + OVERLAP)
    return -4.0 * (4.0 / 3.0 * modulus * np.sqrt(radius) * overlap**1.5) / WIDE**2


@pytest.mark.parametrize("rim", ["step", "free"])
@pytest.mark.parametrize("law", LAWS)
def test_elements_with_a_state_are_born_at_rest(law: str, rim: str, tmp_path: Path) -> None:
    """Nothing moves, whatever the law takes back of the spheres' stress along one axis alone."""
    write_long(tmp_path)
    use_contacts(tmp_path, rim)
    yields(tmp_path, law)
    done = run(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = read_history(tmp_path / "coupled_conversions.csv")
    assert rows["reborn"].sum() >= 8 and rows["left"].sum() >= 56 and rows["awake"].max() <= 72
    assert rows["gap_yield"].max() > 0.5
    audit = read_history(tmp_path / "coupled_audit.csv")
    assert audit["grains_kinetic"].max() < 1e-18 * audit["grains_elastic"][-1]
    assert np.abs(audit["total_energy"] - audit["conversion_energy"]
                  - audit["total_energy"][0]).max() < 1e-9 * audit["total_energy"][-1]  # fmt: skip


def test_a_solid_with_a_stress_opens_at_rest(tmp_path: Path) -> None:
    """Its stress before the start does not act on grains that wake: they have it, too."""
    write_long(tmp_path, "")
    yields(tmp_path, "drucker_prager")
    done = run(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert read_history(tmp_path / "coupled_conversions.csv")["woken"].sum() >= 64
    audit = read_history(tmp_path / "coupled_audit.csv")
    assert audit["grains_kinetic"].max() < 1e-18 * audit["grains_elastic"][-1]


def test_elements_are_born_with_the_stress_of_their_grains(tmp_path: Path) -> None:
    """Of chains along z, where the law bears it; elements that never opened keep the deck's."""
    write_long(tmp_path)
    yields(tmp_path, "drucker_prager")
    deck = tmp_path / "solid.nml"
    deck.write_text(deck.read_text().replace("cohesion = 0.0", "cohesion = 1.0e9")
                    + "&output every_time = 2.0e-4 /\n")  # fmt: skip
    done = run(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = read_history(tmp_path / "coupled_conversions.csv")
    assert rows["gap_yield"].max() < 1e-9
    assert np.all(rows["gap_yield_mean"] <= rows["gap_yield"])
    stress = field_steps(tmp_path / "solid.h5")[-1].solid["stress"]
    born = np.abs(stress[:, 2] / love_weber() - 1.0) < 1e-6
    assert born.sum() == rows["reborn"].sum()
    assert np.abs(stress[born][:, [0, 1, 3, 4, 5]]).max() < 1e-6 * abs(love_weber())
    assert np.abs(stress[-2:, 2] / -2.0e4 - 1.0).max() < 1e-6


@pytest.mark.parametrize("side", ["grains", "solid"])
def test_two_ranks_close_as_one(side: str, tmp_path: Path) -> None:
    """The same bits on two ranks of the grains; on two of the solid sums have another order."""
    write_moving(tmp_path, "drucker_prager")
    assert run(tmp_path).returncode == 0
    names = ("coupled_audit.csv", "coupled_conversions.csv")
    one = {name: (tmp_path / name).read_bytes() for name in names}
    rows = read_history(tmp_path / "coupled_conversions.csv")
    audit = read_history(tmp_path / "coupled_audit.csv")
    program = "talus-dem" if side == "grains" else "talus-fem"
    start_on_ranks(tmp_path / "coupled.nml", side, 2, find_program(program))
    done = run(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    if side == "grains":
        assert {name: (tmp_path / name).read_bytes() for name in names} == one
        return
    again = read_history(tmp_path / "coupled_conversions.csv")
    assert np.array_equal(again["reborn"], rows["reborn"]) and rows["reborn"].sum() >= 6
    assert np.abs(again["gap_yield"] - rows["gap_yield"]).max() < 1e-9
    total = read_history(tmp_path / "coupled_audit.csv")["total_energy"]
    assert np.abs(total - audit["total_energy"]).max() < 1e-9 * audit["total_energy"].max()


def test_laws_of_finite_strain_stay_open(tmp_path: Path) -> None:
    """D460 at the start: no element of theirs begins within a run with a stress."""
    write_long(tmp_path)
    deck = tmp_path / "solid.nml"
    deck.write_text(deck.read_text().replace("density = 1388.0,", "density = 1388.0, law = "
                                             "'neo_hookean',"))  # fmt: skip
    done = run(tmp_path)
    assert done.returncode == 1, done.stdout
    assert "error D460: elements cannot close" in done.stderr
