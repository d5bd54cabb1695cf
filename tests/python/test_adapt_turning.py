"""Elements of a micropolar solid that are opened before a body: at rest, turning, restarted."""

from pathlib import Path

import numpy as np
import pytest
from opened_column import WIDE, D, fly, write
from test_adapt import check_restarts, run

from talus.packing import read_packing, write_h5
from talus.verification import field_steps, read_history

RATE = 20.0  # [rad/s]
LAW = (
    "law = 'micropolar', density = 1388.0, micro_inertia = 1.0e-7, lambda = 1.0e6, mu = 4.0e7, "
    "kappa = 2.0e7, alpha = 0.0, beta = 0.0, gamma = 10.0"
)
PLASTIC = "cohesion = 1.0e3, friction_deg = 30.0, dilation_deg = 5.0, plastic_length = 1.0e-3"
MICROMORPHIC = (
    "density = 1388.0, micro_inertia = 1.0e-7, lambda = 3.2e7, mu = 4.0e7, eta = 8.0e7, "
    "tau = 1.0e7, kappa = 6.0e7, nu = 4.0e7, sigma = 2.0e7, "
    "taus = 0, 0, 0, 0, 0, 0, 2.0e3, 0, 0, 0, 0"
)
AXIS = np.array([0.5 * WIDE, 0.5 * WIDE, 0.0])


def write_polar(folder: Path, more: str = "") -> None:
    """Write the column with a micropolar solid."""
    write(folder, more)
    deck = folder / "solid.nml"
    text = deck.read_text().replace("density = 1388.0, young = 1.0e8, poisson = 0.0", LAW)
    text = text.replace("material = 'soil' /\n&", "material = 'soil', element = 'hex8/hex8' /\n&")
    deck.write_text(text)


def turn(folder: Path) -> None:
    """Let all turn about the axis of the column."""
    fly(folder)
    packing = read_packing(folder / "packing.h5")
    packing.v = np.cross([0.0, 0.0, RATE], packing.x - AXIS)
    packing.omega = np.tile([0.0, 0.0, RATE], (packing.count, 1))
    write_h5(folder / "packing.h5", packing)
    deck = folder / "solid.nml"
    rows = [row for row in deck.read_text().splitlines() if not row.startswith("&initial")]
    at = f"origin = {AXIS[0]}, {AXIS[1]}, 0.0 /"
    rows += [
        f"&initial group = 'all', component = 'x', value = 0.0, gradient = 0.0, {-RATE}, 0.0, {at}",
        f"&initial group = 'all', component = 'y', value = 0.0, gradient = {RATE}, 0.0, 0.0, {at}",
        f"&initial group = 'all', component = 'rz', value = {RATE} /",
    ]
    deck.write_text("\n".join(rows) + "\n&output every_time = 4.0e-5 /\n")
    deck = folder / "grains.nml"
    rows = [row for row in deck.read_text().splitlines() if not row.startswith("&wall")]
    deck.write_text("\n".join(rows).replace("4.0e-5", "2.0e-5") + "\n")


def test_a_column_at_rest_does_not_notice(tmp_path: Path) -> None:
    """Grains wake and ghosts become free in a micropolar solid; nothing moves or turns."""
    write_polar(tmp_path)
    done = run(tmp_path)
    assert done.returncode == 0, done.stdout
    rows = read_history(tmp_path / "coupled_conversions.csv")
    assert rows["woken"].sum() >= 32 and rows["freed"].sum() >= 32
    audit = read_history(tmp_path / "coupled_audit.csv")
    assert audit["grains_kinetic"].max() < 1e-12 * audit["grains_elastic"][-1]
    assert np.abs(audit["total_energy"] - audit["conversion_energy"]
                  - audit["total_energy"][0]).max() < 1e-9 * audit["total_energy"][-1]  # fmt: skip


def test_all_turns_on(tmp_path: Path) -> None:
    """Grains wake with the rate of the micro-rotation, nodes keep theirs over conversions."""
    write_polar(tmp_path)
    turn(tmp_path)
    done = run(tmp_path)
    assert done.returncode == 0, done.stdout
    assert read_history(tmp_path / "coupled_conversions.csv")["woken"].sum() >= 32
    steps = field_steps(tmp_path / "grains.h5")
    last, time = steps[-1].grains, steps[-1].time
    assert np.abs(last["omega"] - [0.0, 0.0, RATE]).max() < 2e-3 * RATE
    speed = np.cross([0.0, 0.0, RATE], last["x"] - AXIS)
    assert np.abs(last["v"] - speed).max() < 5e-3 * np.abs(speed).max()
    turned = np.abs(last["quat"][:, 3]) / (0.5 * RATE * time)
    assert np.abs(turned - 1.0).max() < 2e-3  # also of those that slept
    solid = field_steps(tmp_path / "solid.h5")[-1].solid
    there = np.abs(solid["phi_rate"][:, 2]) > 0.0
    assert there.mean() > 0.5
    assert np.abs(solid["phi_rate"][there] - [0.0, 0.0, RATE]).max() < 5e-3 * RATE
    assert np.abs(solid["phi"][there] - [0.0, 0.0, RATE * time]).max() < 5e-3 * RATE * time
    assert D > np.abs(solid["u"]).max() > 0.5 * RATE * time * 0.5 * WIDE


def test_a_restart_has_the_same_bits(tmp_path: Path) -> None:
    """From checkpoints before and between conversions, as all turns."""
    write_polar(tmp_path, ", keep_behind = 4.0e-3, hold_behind = 1.0e-3")
    turn(tmp_path)
    check_restarts(tmp_path)


@pytest.mark.parametrize("kind", ["closing", "micromorphic", "stressed"])
def test_refused(kind: str, tmp_path: Path) -> None:
    """Micropolar elements neither close nor begin stressed; micro-deformations are not carried."""
    write_polar(tmp_path, ", close_behind = 4.0e-3" if kind == "closing" else "")
    if kind == "micromorphic":
        deck = tmp_path / "solid.nml"
        text = deck.read_text().replace("&material", "&micromorphic").replace(LAW, MICROMORPHIC)
        deck.write_text(text)
    if kind == "stressed":
        deck = tmp_path / "solid.nml"
        text = deck.read_text().replace("'micropolar'", "'micropolar_drucker_prager'")
        text = text.replace(LAW.split(",")[-1], f"{LAW.split(',')[-1]}, {PLASTIC}")
        row = "value = -1.0e4, -1.0e4, -2.0e4, 0.0, 0.0, 0.0 /"
        deck.write_text(text + f"&initial_stress group = 'all', {row}\n")
    done = run(tmp_path)
    assert done.returncode == 1
    assert "D460" in done.stdout + done.stderr, (done.stdout + done.stderr)[-1500:]
