"""Ledgers of both solvers and of the interface while ghosts are driven into a bed."""

import numpy as np
from bed import write_bed
from coupled import audit_of, write_deck

from talus.compare import max_of
from talus.verification import Case, read_history

TURNS = ", rotation = 'curl', spread = 4.0e-3"


def run(case: Case) -> None:
    """Judge closures for a static and a dynamic solid, with and without iterations."""
    write_bed(case.folder)
    fig, ax = case.figure()
    ways = (
        ("static", "average", "springs", "", 3e-2),
        ("static", "iterated", "springs", "", 1e-9),
        ("newmark", "average", "none", "", 3e-3),
        ("newmark", "iterated", "none", "", 1e-9),
        ("static", "iterated", "springs", TURNS, 1e-9),
        ("newmark", "iterated", "none", TURNS, 1e-9),
    )
    for analysis, scheme, interface, more, limit in ways:
        name = f"{analysis}_{scheme}" + ("_curl_kernel" if more else "")
        values = {"name": name, "analysis": analysis, "scheme": scheme, "interface": interface}
        values |= {"more": more}
        write_deck(case, f"{name}_grains.nml", "grains.nml")
        write_deck(case, f"{name}_solid.nml", "solid.nml", **values)
        case.run("talus-couple", write_deck(case, f"{name}.nml", "coupled.nml", **values))
        audit = audit_of(case, name)
        on_grains, on_solid = audit["interface_work_on_grains"], audit["interface_work_on_solid"]
        turnover = np.abs(np.diff(on_grains)).sum()
        case.above(
            f"{name}: work on the grains [J]", np.abs(on_grains).max(), 1e-6, "something happens"
        )
        case.below(
            f"{name}: works at the interface", np.abs(on_grains + on_solid).max() / turnover, limit
        )
        energy = read_history(case.folder / f"{name}_grains_energy.csv")
        case.below(f"{name}: ledger of the grains", np.abs(energy["relative_closure"]).max(), 5e-4)
        solid = read_history(case.folder / f"{name}_solid_energy.csv")
        most = max_of(
            np.abs(solid[k]).max() for k in ("strain", "kinetic", "load", "gravity", "support")
        )
        case.below(f"{name}: ledger of the solid", np.abs(solid["closure"]).max() / most, 1e-11)
        ax.plot(1e3 * audit["time"], 1e6 * on_grains, label=name.replace("_", ", "))
    ax.set(xlabel="time [ms]", ylabel="work of the ghosts on the grains [µJ]")
    ax.legend()
    case.save(fig)
