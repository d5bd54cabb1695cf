"""The same coupled run over both transports, compared bit for bit."""

import numpy as np
from bed import write_bed
from coupled import audit_of, compare_runs, write_deck

from talus.verification import Case


def run(case: Case) -> None:
    """Run twice, compare histories as text and fields as arrays."""
    write_bed(case.folder)
    for transport in ("shared_memory", "hdf5"):
        write_deck(case, f"{transport}_grains.nml", "grains.nml")
        write_deck(case, f"{transport}_solid.nml", "solid.nml", analysis="static")
        case.run(
            "talus-couple", write_deck(case, f"{transport}.nml", "coupled.nml", transport=transport)
        )
    push = np.abs(audit_of(case, "hdf5")["force_on_solid_z"]).max()
    case.above("largest force on the block [N]", push, 0.1, "the bed has met the ghosts")
    compare_runs(case, "", "shared_memory", "hdf5")
