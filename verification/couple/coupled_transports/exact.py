"""The same coupled run over both transports, compared bit for bit."""

import numpy as np
from bed import write_bed
from coupled import audit_of, write_deck

from talus.verification import Case, field_steps


def run(case: Case) -> None:
    """Run twice, compare histories as text and fields as arrays."""
    write_bed(case.folder)
    for transport in ("shared_memory", "hdf5"):
        write_deck(case, f"{transport}_grains.nml", "grains.nml")
        write_deck(case, f"{transport}_solid.nml", "solid.nml", analysis="static")
        case.run("talus-couple", write_deck(case, f"{transport}.nml", "coupled.nml", transport=transport))
    push = np.abs(audit_of(case, "hdf5")["force_on_solid_z"]).max()
    case.above("largest force on the block [N]", push, 0.1, "the bed has met the ghosts")
    for name in ("audit.csv", "grains_energy.csv", "solid_energy.csv", "solid_reactions.csv"):
        a, b = (case.folder / f"{t}_{name}" for t in ("shared_memory", "hdf5"))
        case.metric(f"{name} differs", float(a.read_bytes() != b.read_bytes()), 0.0, 0.0, "bytes")
    for side in ("grains", "solid"):
        a, b = (field_steps(case.folder / f"{t}_{side}.h5") for t in ("shared_memory", "hdf5"))
        other = sum(not np.array_equal(p[k], q[k]) for s, t in zip(a, b, strict=True)
                    for p, q in ((s.grains, t.grains), (s.contacts, t.contacts), (s.solid, t.solid)) for k in p)  # fmt: skip
        case.metric(f"fields of the {side} that differ", other, 0, 0, f"{len(a)} steps")
