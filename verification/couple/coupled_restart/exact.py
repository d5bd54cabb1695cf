"""Coupled runs in one go and in two parts, compared bit for bit."""

import numpy as np
from bed import write_bed
from coupled import audit_of, compare_runs, write_deck

from talus.verification import Case

COHESION = 400.0  # Pa: some points yield under the bed


def run(case: Case) -> None:
    """Compare for three ways of coupling."""
    write_bed(case.folder)
    ways = (
        ("static", "average", "springs", "", ""),
        ("newmark", "average", "none", "", ""),
        ("newmark", "iterated", "aitken", "", ""),
        ("newmark", "state_at_n", "none", "", ""),
        ("static", "average", "springs", ", rotation = 'curl', spread = 4.0e-3", ""),
        ("static", "average", "springs", ", initial = 'relax', relax_exchanges = 150", ""),
        ("explicit", "symmetric", "none", "", ""),
        ("explicit", "iterated", "aitken", "", ""),
        ("newmark", "average", "none", "", "neo_hookean"),
        ("newmark", "iterated", "aitken", "", "neo_hookean"),
        ("static", "average", "springs", "", "drucker_prager"),
        ("static", "average", "springs", " ", ""),
    )
    for analysis, scheme, interface, more, law in ways:
        label = f"{analysis}, {scheme}, {interface}{more}{law and ', ' + law}"
        constants = law and f"law = '{law}',"
        if law == "drucker_prager":
            constants += f" cohesion = {COHESION}, friction_deg = 20.0,"
        values = {"analysis": analysis, "scheme": scheme, "interface": interface, "more": more,
                  "pieces": 10 if more == " " else 1}  # fmt: skip
        for name in ("whole", "parts"):
            for path in case.folder.glob(f"{name}*"):
                path.unlink()
            write_deck(case, f"{name}_grains.nml", "grains.nml")
            write_deck(case, f"{name}_solid.nml", "solid.nml", analysis=analysis, law=constants)
        write_deck(
            case, "whole.nml", "coupled.nml", name="whole", end="2.0e-3", threads=1, **values
        )
        case.run("talus-couple", "whole.nml")
        write_deck(
            case, "parts.nml", "coupled.nml", name="parts", end="1.0e-3", threads=2, **values
        )
        case.run("talus-couple", "parts.nml")
        write_deck(
            case, "parts.nml", "coupled.nml", name="parts", end="2.0e-3", threads=1, **values
        )
        case.run("talus-couple", "parts.nml", "--restart=auto")
        push = np.abs(audit_of(case, "parts")["force_on_solid_z"]).max()
        case.above(
            f"{label}: largest force on the block [N]", push, 0.1, "the bed has met the ghosts"
        )
        compare_runs(case, f"{label}: ", "whole", "parts")
