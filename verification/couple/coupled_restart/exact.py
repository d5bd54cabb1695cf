"""Coupled runs in one go and in two parts, compared bit for bit."""

import numpy as np
from bed import write_bed
from coupled import audit_of, write_deck

from talus.verification import Case, field_steps


def run(case: Case) -> None:
    """Compare for three ways of coupling."""
    write_bed(case.folder)
    ways = (("static", "average", "springs"), ("newmark", "average", "none"), ("newmark", "iterated", "aitken"))
    for analysis, scheme, interface in ways:
        label = f"{analysis}, {scheme}, {interface}"
        values = {"analysis": analysis, "scheme": scheme, "interface": interface}
        for name in ("whole", "parts"):
            for path in case.folder.glob(f"{name}*"):
                path.unlink()
            write_deck(case, f"{name}_grains.nml", "grains.nml")
            write_deck(case, f"{name}_solid.nml", "solid.nml", analysis=analysis)
        write_deck(case, "whole.nml", "coupled.nml", name="whole", end="2.0e-3", threads=1, **values)
        case.run("talus-couple", "whole.nml")
        write_deck(case, "parts.nml", "coupled.nml", name="parts", end="1.0e-3", threads=2, **values)
        case.run("talus-couple", "parts.nml")
        write_deck(case, "parts.nml", "coupled.nml", name="parts", end="2.0e-3", threads=1, **values)
        case.run("talus-couple", "parts.nml", "--restart=auto")
        push = np.abs(audit_of(case, "parts")["force_on_solid_z"]).max()
        case.above(f"{label}: largest force on the block [N]", push, 0.1, "the bed has met the ghosts")
        compare(case, label)


def compare(case: Case, label: str) -> None:
    """Judge histories as text and fields as arrays."""
    for name in ("audit.csv", "grains_energy.csv", "solid_energy.csv", "solid_reactions.csv"):
        a, b = (case.folder / f"{part}_{name}" for part in ("whole", "parts"))
        case.metric(f"{label}: {name} differs", float(a.read_bytes() != b.read_bytes()), 0.0, 0.0, "bytes")
    for side in ("grains", "solid"):
        a, b = (field_steps(case.folder / f"{part}_{side}.h5") for part in ("whole", "parts"))
        other = abs(len(a) - len(b)) + sum(
            not np.array_equal(p[k], q[k])
            for s, t in zip(a, b, strict=False)
            for p, q in ((s.grains, t.grains), (s.contacts, t.contacts), (s.solid, t.solid))
            for k in p
        )
        case.metric(f"{label}: fields of the {side} that differ", other, 0, 0, f"{len(a)} steps")
