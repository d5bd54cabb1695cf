"""A zone of grains that travels through a bed at rest and closes to continuum with a state."""

import h5py
import numpy as np
from tile_zone import STRESS, judge, make_bed, zone_opened

from talus.mesh import read_mesh
from talus.verification import Case, field_steps

YOUNG, POISSON = 4.0e7, 0.25  # [Pa], [-]
BULK = YOUNG / (3.0 * (1.0 - 2.0 * POISSON))
PIECES = 32  # of a branch
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
        own = grains_stress(case, law)[shut].mean(0)
        found[law] |= {"closed": stress[shut], "grains_mean": own}
        away = stress[shut] + STRESS * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        for k, name in enumerate(("xx", "yy", "zz")):
            mean = stress[shut, k].mean()
            case.metric(f"{law}: mean {name} of what has closed / of the grains there",
                        mean / own[k], 1.0, 0.03)  # fmt: skip
            case.metric(f"{law}: mean {name} of what has closed / never opened",
                        -mean / STRESS, 1.0, 0.08)  # fmt: skip
        case.below(f"{law}: farthest component of an element, over the pressure",
                   np.abs(away).max() / STRESS, 0.20)  # fmt: skip
    draw(case, found)


def stress_of(case: Case, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the stress of the elements at the end, and which have closed to continuum alone."""
    last = sorted((case.folder / name).glob("coupled.x*.chk.h5"))[-1]
    with h5py.File(last) as file:
        part, shut = file["adapt/part"][:], file["adapt/shut"][:]
    stress = field_steps(case.folder / f"{name}/solid.h5")[-1].solid["stress"]
    return stress, (shut == 1) & (part <= 1)


def grains_stress(case: Case, name: str) -> np.ndarray:
    """Return xx, yy, zz of the whole bed in each element, by short pieces of all branches [Pa]."""
    still = field_steps(case.folder / "still.h5")[0]
    row = np.zeros(still.grains["id"].max() + 1, dtype=int)
    row[still.grains["id"]] = np.arange(len(still.grains["id"]))
    inner = (still.contacts["ids"] > 0).all(1)
    first, second = still.grains["x"][row[still.contacts["ids"][inner]]].transpose(1, 0, 2)
    product = (second - first) * still.contacts["force"][inner] / PIECES
    mesh = read_mesh(case.folder / f"{name}/bed.h5")
    corners = mesh.x[mesh.cells["hex8"]]
    size = np.ptp(corners[0], axis=0)
    place = np.round(corners.min(axis=1) / size).astype(int)
    number = np.full(place.max(0) + 1, -1)
    number[tuple(place.T)] = np.arange(len(place))
    sums = np.zeros((len(place), 3))
    for k in range(PIECES):
        cell = np.floor((first + (k + 0.5) / PIECES * (second - first)) / size).astype(int)
        there = ((cell >= 0) & (cell < number.shape)).all(1)
        np.add.at(sums, number[tuple(cell[there].T)], product[there])
    return -sums / size.prod()


def draw(case: Case, found: dict) -> None:
    """Draw the kinetic energy, and stresses of what has closed beside those of the grains there."""
    fig, (ax, ax2) = case.figure(ncols=2, figsize=(11, 4))
    for k, (law, item) in enumerate(found.items()):
        ax.plot(1e3 * item["time"], item["curve"], color=f"C{k}", ls=("-", "--")[k], label=law)
    ax.set(xlabel="time [ms]", ylabel="kinetic / elastic energy of the grains", yscale="log")
    ax.legend(fontsize=8)
    law, item = list(found.items())[-1]  # both are the same to 1e-8
    for c, name in enumerate(("xx", "yy", "zz")):
        ax2.hist(-item["closed"][:, c] / STRESS, bins=np.linspace(0.85, 1.2, 36), color=f"C{c}",
                 histtype="step", label=f"{law}, {name}")  # fmt: skip
        ax2.axvline(-item["grains_mean"][c] / STRESS, color=f"C{c}", ls="--", lw=0.8)
    ax2.axvline(1.0, color="k", lw=0.8)
    ax2.set(xlabel="stress of what has closed / tile", ylabel="elements",
            title="dashed: mean of the grains there")  # fmt: skip
    ax2.legend(fontsize=8)
    case.save(fig)
