"""Grains that break while bonds hold them, under a surcharge, and before a probe."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from test_breakage import HEAD, OUTPUT, contents

from talus.programs import find_program
from talus.verification import launcher, read_history, write_packing

RADIUS = 1.0e-3  # [m]
PLATES = """&wall id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'quartz' /
&wall id = 'top', point = 0.0, 0.0, {height}, normal = 0.0, 0.0, -1.0, material = 'quartz',
  velocity = 0.0, 0.0, -{speed} /
"""
BONDS = """&bond young = 1.0e9, tensile_strength = 1.0e12, shear_strength = 1.0e12,
  reach = 1.0e-6, damping_ratio = 0.1 /
&search skin = 5.0e-5 /
"""


def run(folder: Path, text: str, *options: str, threads: int = 1, ranks: int = 1) -> None:
    """Run a deck to its end."""
    (folder / "deck.nml").write_text(text)
    first = launcher(ranks) if ranks > 1 else []
    command = [*first, str(find_program("talus-dem")), "deck.nml", f"--threads={threads}", *options]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def column(folder: Path, count: int) -> str:
    """Write a bonded column of spheres that touch between plates; return the deck."""
    x = np.column_stack([np.zeros((count, 2)), RADIUS * (1.0 + 2.0 * np.arange(count))])
    write_packing(folder / "pack.h5", x, np.full((count, 3), RADIUS))
    head = HEAD.format(t_end=4.0e-4, words="check_every = 10", strength=5.0e6, smallest=1.5e-3)
    head = head.replace("every_time = 1.0e-5", "every_time = 1.0e-7")
    return head + PLATES.format(height=2.0 * RADIUS * count, speed=0.3) + BONDS + OUTPUT


def test_bonds_of_a_broken_grain_break_with_it(tmp_path: Path) -> None:
    """As many bonds are torn as broken grains had; what they stored is lost by breakage."""
    text = column(tmp_path, 5)
    run(tmp_path, text)
    broken = set(read_history(tmp_path / "deck_broken.csv")["id"].astype(int))
    torn = sum(bool({k, k + 1} & broken) for k in range(1, 5))
    health = json.loads((tmp_path / "deck_summary.json").read_text())["health"]
    assert 0 < torn < 4
    assert (health["bonds_made"], health["bonds_torn"], health["bonds_sheared"]) == (4, torn, 0)
    energy = read_history(tmp_path / "deck_energy.csv")
    first = int(np.argmax(energy["breakage"] > 0.0))
    before, after = (energy["elastic_other"][k] for k in (first - 1, first))
    assert energy["breakage"][first] == pytest.approx(before - after, rel=0.05)
    assert energy["relative_closure"][-1] < 1e-3
    end = contents(tmp_path / "end.h5")
    kept = sorted(tmp_path.glob("deck.chk.*.h5"))[-2].rename(tmp_path / "kept.h5")
    run(tmp_path, text, f"--restart={kept.name}", threads=2)
    assert contents(tmp_path / "end.h5") == end
    run(tmp_path, text, ranks=2)
    assert read_history(tmp_path / "deck_broken.csv")["id"].astype(int).min() in broken


def layer(folder: Path) -> str:
    """Write a layer of nine spheres that touch, on a floor between four walls; return the deck."""
    place = RADIUS * (1.0 + 2.0 * np.arange(3))
    x = np.array([[a, b, RADIUS] for a in place for b in place])
    write_packing(folder / "pack.h5", x, np.full((9, 3), RADIUS))
    sides = "".join(
        f"&wall id = '{name}', point = {point}, normal = {normal}, material = 'quartz' /\n"
        for name, point, normal in (
            ("x0", "0.0, 0.0, 0.0", "1.0, 0.0, 0.0"), ("x1", "6.0e-3, 0.0, 0.0", "-1.0, 0.0, 0.0"),
            ("y0", "0.0, 0.0, 0.0", "0.0, 1.0, 0.0"), ("y1", "0.0, 6.0e-3, 0.0", "0.0, -1.0, 0.0"),
            ("floor", "0.0, 0.0, 0.0", "0.0, 0.0, 1.0"))
    )  # fmt: skip
    head = HEAD.format(t_end=4.0e-4, words="check_every = 20", strength=2.0e6, smallest=1.5e-3)
    return head + sides + "&surcharge stress = 1.0e6 /\n&limits overlap = 0.5 /\n" + OUTPUT


def test_a_surcharge_is_shared_anew(tmp_path: Path) -> None:
    """All loads are the stress times the area at any time; fragments carry their shares."""
    text = layer(tmp_path)
    run(tmp_path, text)
    rows = read_history(tmp_path / "deck_surcharge.csv")
    assert len(read_history(tmp_path / "deck_broken.csv")["id"]) >= 2
    assert rows["force"] == pytest.approx(36.0, rel=1e-12)
    assert rows["grains"][0] == 9
    assert rows["grains"][-1] > 9
    assert read_history(tmp_path / "deck_energy.csv")["relative_closure"][-1] < 5e-3
    end = contents(tmp_path / "end.h5")
    kept = sorted(tmp_path.glob("deck.chk.*.h5"))[-2].rename(tmp_path / "kept.h5")
    run(tmp_path, text, f"--restart={kept.name}", threads=2)
    assert contents(tmp_path / "end.h5") == end
    one = read_history(tmp_path / "deck_broken.csv")
    run(tmp_path, text, ranks=2)
    two = read_history(tmp_path / "deck_broken.csv")
    assert (one["id"][:2] == two["id"][:2]).all()
    assert read_history(tmp_path / "deck_surcharge.csv")["force"] == pytest.approx(36.0, rel=1e-12)


def test_a_bed_is_probed_after_breaks(tmp_path: Path) -> None:
    """Moduli of a dense bed that has lost a grain are those that a run from its packing finds."""
    edge = 1.995 * RADIUS * np.sqrt(2.0)
    side = 2.0 * edge
    basis = np.array([[0.0, 0.0, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5], [0.5, 0.5, 0.0]])
    x = np.array([edge * (np.array(c) + b) for c in np.ndindex(2, 2, 2) for b in basis])
    write_packing(tmp_path / "pack.h5", x, np.full((32, 3), RADIUS))
    probe = (f"&cell size = {side}, {side}, {side} /\n"
             "&equilibrium unbalanced = 1.0e-3, energy_ratio = 1.0e-6 /\n"
             "&probe strain = 1.0e-6, unbalanced = 1.0, energy_ratio = 1.0 /\n")  # fmt: skip
    head = HEAD.format(t_end=2.0e-2, words="family = 'none', seed = 3", strength=STRONG,
                       smallest=1.5e-3)  # fmt: skip
    head = head.replace("&dynamics ", "&relaxation damping = 'adaptive',")
    run(tmp_path, head + probe + "&output every_time = 1.0, packing = 'end.h5' /\n")
    assert 1 <= len(read_history(tmp_path / "deck_broken.csv")["id"]) < 10
    first = json.loads((tmp_path / "deck_probe.json").read_text())["probed"]
    (tmp_path / "end.h5").rename(tmp_path / "pack.h5")
    again = "\n".join(line for line in head.splitlines() if "breakage" not in line
                      and "smallest" not in line)  # fmt: skip
    run(tmp_path, again + "\n" + probe)
    second = json.loads((tmp_path / "deck_probe.json").read_text())["probed"]
    for name in ("bulk_Pa", "shear_Pa"):
        assert first[name] > 1.0e6
        assert second[name] == pytest.approx(first[name], rel=1e-3)


STRONG = 3.0e6  # [Pa]
