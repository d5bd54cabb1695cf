"""A zone of grains that travels through a bed at rest and closes to continuum with a state."""

import h5py
import numpy as np
from tile_zone import STRESS, judge, make_bed, zone_opened

from talus.verification import Case, field_steps

YOUNG, POISSON = 4.0e7, 0.25  # [Pa], [-]
BULK = YOUNG / (3.0 * (1.0 - 2.0 * POISSON))
VOLUME, SWELLING = 1.7, 1.7 * STRESS / BULK  # of Cam-clay, as stiff as the others [-]
LAWS = {
    "drucker_prager": f"law = 'drucker_prager', young = {YOUNG}, poisson = {POISSON}, "
                      "friction_deg = 30.0, dilation_deg = 5.0, cohesion = 0.0",
    "cam_clay": f"law = 'cam_clay', poisson = {POISSON}, critical_slope = 1.2, specific_volume = "
                f"{VOLUME}, swelling_index = {SWELLING:.6g}, compression_index = 0.05, "
                "overconsolidation = 1.5",
}  # fmt: skip


def run(case: Case) -> None:
    """Make the bed, let the zone pass with each law, compare with the tile laid side by side."""
    make_bed(case)
    found = {}
    for law, text in LAWS.items():
        found[law] = zone_opened(case, law, law=text)
        rows = found[law]["rows"]
        case.above(f"{law}: elements born again", float(rows["reborn"].sum()), 40.0)
        judge(case, found[law])
        case.below(f"{law}: taken back by the law, over the pressure", rows["gap_yield"].max(),
                   1e-9)  # fmt: skip
        stress, shut = stress_of(case, law)
        found[law]["stress_xx"] = stress[shut]
        away = stress[shut] + STRESS * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        for k, name in enumerate(("xx", "yy", "zz")):
            case.metric(f"{law}: mean {name} of what has closed / never opened",
                        -stress[shut, k].mean() / STRESS, 1.0, 0.05)  # fmt: skip
        case.below(f"{law}: farthest component of an element, over the pressure",
                   np.abs(away).max() / STRESS, 0.15)  # fmt: skip
    draw(case, found)


def stress_of(case: Case, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the stress of the elements at the end, and which have closed to continuum alone."""
    last = sorted((case.folder / name).glob("coupled.x*.chk.h5"))[-1]
    with h5py.File(last) as file:
        part, shut = file["adapt/part"][:], file["adapt/shut"][:]
    stress = field_steps(case.folder / f"{name}/solid.h5")[-1].solid["stress"]
    return stress, (shut == 1) & (part <= 1)


def draw(case: Case, found: dict) -> None:
    """Draw the grains awake and the stresses of what has closed."""
    fig, (ax, ax2) = case.figure(ncols=2, figsize=(11, 4))
    for k, (law, item) in enumerate(found.items()):
        ax.plot(1e3 * item["time"], item["curve"], color=f"C{k}", label=law)
        for c, name in enumerate(("xx", "yy", "zz")):
            ax2.hist(-item["stress_xx"][:, c] / STRESS, bins=20, histtype="step",
                     ls=("-", "--", ":")[c], color=f"C{k}", label=f"{law} {name}")  # fmt: skip
    ax.set(xlabel="time [ms]", ylabel="kinetic / elastic energy of the grains", yscale="log")
    ax.legend(fontsize=8)
    ax2.axvline(1.0, color="k", lw=0.8)
    ax2.set(xlabel="stress of what has closed / tile", ylabel="elements")
    ax2.legend(fontsize=8)
    case.save(fig)
