"""Moduli of the shipped deposit by probes, beside the affine sum and Walton's formula."""

import json
import shutil
from pathlib import Path

import numpy as np

import talus
from talus.packing import FREE, read_packing, write_h5
from talus.verification import Case, read_history

EXAMPLE = Path(talus.__file__).resolve().parents[2] / "examples/01-penetration"
YOUNG, POISSON, DENSITY, GRAVITY = 29.0e9, 0.25, 2650.0, 9.81


def run(case: Case) -> None:
    """Probe the deposit; judge and draw its moduli."""
    pack = read_packing(EXAMPLE / "deposit_small.txt")
    write_h5(case.folder / "deposit.h5", pack)
    shutil.copy(EXAMPLE / "probe.nml", case.folder / "probe.nml")
    case.run("talus-dem", "probe.nml", "--threads=1")
    found = json.loads((case.folder / "probe_probe.json").read_text())
    probed, affine = found["probed"], found["affine"]
    walton = formula(case, pack, found)
    case.metric("affine K / Walton", affine["bulk_Pa"] / walton, 0.9, 0.05, "0.88 to 0.91 known")
    case.below("K / affine K", probed["bulk_Pa"] / affine["bulk_Pa"], 1.0)
    ratio = probed["shear_Pa"] / affine["shear_Pa"]
    case.metric("G / affine G", ratio, 0.55, 0.15, "0.4 to 0.7 known")
    case.below("skew part of the stiffness", probed["asymmetry"], 5e-3, "strain over overlap")
    case.below("one side less the other", found["sides_differ"], 5e-2, "strain over overlap")
    weight = GRAVITY * DENSITY * solid_volume(pack) / found["volume_m3"]
    height = 0.0585 + 0.0225
    share = -found["stress_Pa"][2] / (0.5 * weight * height)
    case.below("stress_zz / half the weight above", share, 1.0, "the walls carry a part")
    energy = read_history(case.folder / "probe_energy.csv")
    case.below("ledger", float(energy["relative_closure"].max()), 1e-4)
    draw(case, probed, affine, walton)


def solid_volume(pack: object) -> float:
    """Volume of the free grains [m3]."""
    return float(4.0 / 3.0 * np.pi * pack.axes[pack.kind == FREE].prod(axis=1).sum())


def formula(case: Case, pack: object, found: dict) -> float:
    """Walton's bulk modulus with the pack's own coordination, solid fraction and pressure [Pa]."""
    rows = read_history(case.folder / "probe_measure_all.csv")
    density = float(rows["coordination"][-1]) * solid_volume(pack) / found["volume_m3"]
    modulus = 0.5 * YOUNG / (1.0 - POISSON**2)
    return float(np.cbrt((density * modulus) ** 2 * found["pressure_Pa"] / (18.0 * np.pi**2)))


def draw(case: Case, probed: dict, affine: dict, walton: float) -> None:
    """Draw the diagonals of both matrices and the isotropic fits."""
    fig, ax = case.figure()
    names = ["xx", "yy", "zz", "yz", "zx", "xy"]
    place = np.arange(len(names) + 2)
    for k, (label, one) in enumerate((("probed", probed), ("affine sum", affine))):
        values = [one["stiffness_Pa"][n][i] for i, n in enumerate(names)]
        values += [one["bulk_Pa"], one["shear_Pa"]]
        ax.bar(place + 0.4 * k - 0.2, 1e-6 * np.array(values), width=0.4, label=label)
    ax.plot([5.6, 6.4], [1e-6 * walton] * 2, color="black", label="Walton")
    ax.set_xticks(place, [f"$C_{{{n},{n}}}$" for n in names] + ["$K$", "$G$"])
    ax.set(ylabel="modulus [MPa]")
    ax.legend(fontsize=8)
    case.save(fig)
