"""Peak and critical friction angle of a dense pack of ellipsoids, with the decks of the example."""

import json
import re
from pathlib import Path

import numpy as np

import talus
from talus.generate import cloud
from talus.packing import write_h5
from talus.specimens import Specimen, mean_over, peak_angle, read_specimen
from talus.verification import Case, read_history

EXAMPLE = Path(talus.__file__).resolve().parents[2] / "examples/02-element-tests"
COUNT, BOX, AXES = 1000, 0.066, np.array([2.5e-3, 2.0e-3, 1.5e-3])
STRESS, LENGTH = 100.0e3, 0.25  # [Pa], of the shearing [s]
SCATTER = 0.9  # standard deviation of the critical angle over five seeds of the example [deg]
CRITICAL = (0.30, 0.40)  # axial strain over which the critical state is averaged


def run(case: Case) -> None:
    """Compress, shear, find the angles."""
    write_h5(case.folder / "cloud.h5", cloud(np.ones(COUNT), np.full(3, BOX), AXES, seed=1))
    isotropic = (EXAMPLE / "isotropic.nml").read_text()
    (case.folder / "isotropic.nml").write_text(isotropic)
    case.run("talus-dem", "isotropic.nml", "--threads=1")
    start = json.loads((case.folder / "isotropic_summary.json").read_text())["time_s"]
    deck = (EXAMPLE / "drained.nml").read_text()
    deck = re.sub(r"t_end = \+[0-9.]+", f"t_end = {start + LENGTH:.12g}", deck)
    (case.folder / "drained.nml").write_text(deck)
    case.run("talus-dem", "drained.nml", "--threads=1", "--restart=isotropic.chk.h5")
    test = read_specimen(case.folder / "drained_walls.csv")
    peak, where = peak_angle(test)
    case.metric("peak friction angle [deg]", peak, 40.0, 5.0, "35-45")
    case.below("axial strain at the peak", where, 0.05)
    critical = mean_over(test, test.friction_angle, *CRITICAL)
    why = "27-33 for the mean of many, one seed scatters by 0.9 (two standard deviations)"
    case.metric("critical friction angle [deg]", critical, 30.0, 3.0 + 2.0 * SCATTER, why)
    dilation = float(-test.volumetric_strain.min())
    case.above("largest gain of volume", dilation, 0.03, "a dense specimen dilates")
    late = mean_over(test, -np.gradient(test.volumetric_strain, test.axial_strain), *CRITICAL)
    case.below("dilation in the critical state", abs(late), 0.15, "0.5 and more at the peak")
    side = mean_over(test, test.lateral, 0.0, CRITICAL[1]) / STRESS
    case.metric("mean lateral stress / target", side, 1.0, 0.02, "it yields by jumps")
    rows = read_history(case.folder / "drained_measure_all.csv")
    case.below("mean inertial number", float(rows["inertial_number"].mean()), 3e-3)
    for name in ("isotropic", "drained"):
        energy = read_history(case.folder / f"{name}_energy.csv")
        worst = float(energy["relative_closure"].max())
        case.below(f"largest relative closure, {name}", worst, 1e-4)
    draw(case, test)


def draw(case: Case, test: Specimen) -> None:
    """Friction angle with its bands, and volume."""
    fig, (left, right) = case.figure(ncols=2, figsize=(9.4, 3.8))
    strain = 100.0 * test.axial_strain
    left.axhspan(35.0, 45.0, color="#e8edf2", label="peak, published")
    left.axhspan(27.0, 33.0, color="#f3e9e0", label="critical, published")
    left.plot(strain, test.friction_angle, lw=1.0, label="Talus")
    left.set(xlabel="axial strain [%]", ylabel="friction angle [deg]", ylim=(0.0, 50.0))
    left.legend(fontsize=8)
    right.plot(strain, -100.0 * test.volumetric_strain)
    right.set(xlabel="axial strain [%]", ylabel="gain of volume [%]")
    case.save(fig)
