"""A zone of grains that travels through a bed at rest, open before, closed behind."""

import h5py
import numpy as np
from tile_zone import CENTRE, DIAMETER, judge, make_bed, zone_opened

from talus.mesh import read_mesh
from talus.verification import Case, field_steps


def run(case: Case) -> None:
    """Make the bed, let the zone pass, compare with the tile laid side by side."""
    make_bed(case)
    found = zone_opened(case, "closed")
    rows = found["rows"]
    parts = parts_of(case)
    case.above("elements that closed", float(rows["closed"].sum()), 40.0)
    case.metric("opened at the start and no continuum at the end",
                float((parts["opened"] & (parts["last"] != 0)).sum()), 0.0, 0.0)  # fmt: skip
    case.above("grains that fell asleep", float(rows["left"].sum()), 2000.0)
    case.below("grains awake, most / at the start", rows["awake"].max() / rows["awake"][0], 1.5)
    judge(case, found)
    way = [np.linalg.norm(step.solid["u"], axis=1).max()
           for step in field_steps(case.folder / "closed/solid.h5")]  # fmt: skip
    case.below("largest displacement of a node, of a diameter", max(way) / DIAMETER, 1e-4)
    draw(case, found)


def parts_of(case: Case) -> dict:
    """Return the parts of the elements at the end, and which were opened at the start."""
    last = sorted((case.folder / "closed").glob("coupled.x*.chk.h5"))[-1]
    with h5py.File(last) as file:
        part, shut = file["adapt/part"][:], file["adapt/shut"][:]
    mesh = read_mesh(case.folder / "closed/bed.h5")
    middle = mesh.x[mesh.cells["hex8"]].mean(axis=1)
    opened = (np.abs(middle - CENTRE) < [5e-3, 5e-3, 5e-3]).all(1)
    return {"last": part, "shut": shut == 1, "opened": opened}


def draw(case: Case, found: dict) -> None:
    """Draw who is awake, and the grains at the end."""
    fig, (ax, ax2) = case.figure(ncols=2, figsize=(11, 4))
    rows = found["rows"]
    for name, label in (("awake", "awake"), ("opened", "opened elements, times 10")):
        ax.step(1e3 * rows["time"], rows[name] * (10 if name == "opened" else 1), where="post",
                label=label)  # fmt: skip
    for name, label in (("woken", "woken so far"), ("left", "fallen asleep so far")):
        ax.step(1e3 * rows["time"], np.cumsum(rows[name]), where="post", label=label)
    ax.set(xlabel="time [ms]", ylabel="grains", ylim=(0.0, None))
    ax.legend(fontsize=8)
    g = found["grains"]
    middle = np.abs(g["x"][:, 1] - CENTRE[1]) < 2e-3
    x = 1e3 * g["x"][middle]
    ax2.scatter(x[:, 0], x[:, 2], s=18, c=g["kind"][middle], cmap="coolwarm")
    ax2.set(xlabel="x [mm]", ylabel="z [mm]", aspect="equal", xlim=(0.0, 60.0), ylim=(0.0, 36.0),
            title="free and ghosts at the end")  # fmt: skip
    case.save(fig)
