"""Columns that yield on four grains: start, stress on the recorded path, forces, works, restart."""

import numpy as np
from coupled import audit_of, compare_runs, write_box, write_deck
from yielding_laws import LAWS, law_of

from talus.verification import Case, Step, field_steps, write_packing

RADIUS, SIDE, STIFFNESS, STRESS, WAY = 5.0e-3, 0.022, 1.0e6, 1.0e5, 2.0e-4
AREA, END, CUT, REST = SIDE**2, 0.008, 0.004, 9.0e-4  # [m2], [s]: the cut, and the time at rest
HELD = "".join(f"&support group = '{c}{k}', fix = '{c}' /\n" for c in "xy" for k in (0, 1))
HELD_MICRO = HELD.replace("'x' /", "'x', 'chi12', 'chi13', 'chi21', 'chi31' /").replace(
    "'y' /", "'y', 'chi12', 'chi23', 'chi21', 'chi32' /")  # fmt: skip
SIDES = {"sand": HELD, "ellipse": HELD_MICRO, "crushing": HELD_MICRO}
STATIC = "'static', tolerance = 1.0e-10"
WAYS = {
    "static": (STATIC, 4.0e-5, "average", "springs"),
    "explicit": ("'explicit', rayleigh_mass = 2.0e3", 4.0e-6, "symmetric", "none"),
}  # analysis, exchange [s], scheme, interface
LIMITS = {"static": (1.0e-8, 0.04, 0.05), "explicit": (0.02, 0.03, 1.0e-3)}
PRESSED = f"&pressure group = 'z0', value = {STRESS} /"


def write_input(case: Case) -> None:
    """Write the column and the grains, four at places that load all four nodes alike."""
    sink = STRESS * AREA / 4.0 / STIFFNESS
    low = 3.0 * RADIUS - 2.0 * sink
    write_box(case.folder / "column.h5", [0.0, 0.0, low], [SIDE, SIDE, low + SIDE], (1, 1, 1))
    place = SIDE * np.array([0.25, 0.75])
    x = np.array([[a, b, z] for z in (RADIUS - sink, low) for a in place for b in place])
    write_packing(case.folder / "pack.h5", x, np.full((8, 3), RADIUS), kind=np.repeat([0, 1], 4),
                  groups={"ghosts": np.arange(5, 9)})  # fmt: skip


def write_solid(case: Case, head: str, law: str, analysis: str, below: str) -> None:
    """Write the deck of a column, whose lower face `below` presses or moves."""
    write_deck(case, f"{head}_solid.nml", "solid.nml", name=head, law=law_of(law),
               held=SIDES[law], below=below, analysis=analysis, way=WAY,
               until=f" t_end = {END}," if "dt" in analysis else "")  # fmt: skip


def couple(case: Case, law: str, way: str, head: str, ends: tuple[float, ...] = (END,)) -> None:
    """Run the coupled column in as many parts as there are ends."""
    analysis, exchange, scheme, interface = WAYS[way]
    write_deck(case, f"{head}_grains.nml", "grains.nml")
    write_solid(case, head, law, analysis, PRESSED)
    for end in ends:
        write_deck(case, f"{head}.nml", "coupled.nml", name=head, end=end, exchange=exchange,
                   scheme=scheme, interface=interface)  # fmt: skip
        again = ("--restart=auto",) if end != ends[0] else ()
        case.run("talus-couple", f"{head}.nml", *again)


def alone(case: Case, law: str, head: str, steps: list[Step]) -> list[Step]:
    """Run the element alone, its lower face moved as it was; return its outputs."""
    times = ", ".join(f"{step.time:.17g}" for step in steps)
    values = ", ".join(f"{step.solid['u'][:4, 2].mean():.17g}" for step in steps)
    moved = (
        f"&curve id = 'seen', times = {times}, values = {values} /\n"
        "&motion group = 'z0', component = 'z', curve = 'seen', scale = 1.0 /"
    )
    write_solid(case, head, law, STATIC + ", dt = 4.0e-5", moved)
    case.run("talus-fem", f"{head}_solid.nml")
    return field_steps(case.folder / f"{head}_solid.h5")


def stress_of(steps: list[Step]) -> np.ndarray:
    """Return xx and zz of every output, compression positive, (n, 2) [Pa]."""
    stress = np.array([step.solid["stress"][0] for step in steps])
    return -stress[:, [0, -1 if stress.shape[1] == 9 else 2]]


def judge(case: Case, law: str, way: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Judge one run; return the strain of the element, its stress, and that of it alone."""
    head = f"{law}_{way}"
    couple(case, law, way, head)
    steps = field_steps(case.folder / f"{head}_solid.h5")
    audit = audit_of(case, head)
    label = f"{law}, {way}: "
    still = [step for step in steps if step.time < REST]
    case.below(label + "motion at rest / way", max(abs(s.solid["u"]).max() for s in still) / WAY,
               1.0e-9)  # fmt: skip
    stress, again = stress_of(steps), stress_of(alone(case, law, f"{head}_alone", steps))
    time = np.array([step.time for step in steps])
    off = abs(stress - again).max() / stress.max()
    case.below(label + "stress off that on its path alone", off, LIMITS[way][0])
    force = np.interp(time, audit["time"], audit["force_on_solid_z"])
    off = abs(force - AREA * stress[:, 1]).max() / force.max()
    case.below(label + "force of the grains off stress times area", off, LIMITS[way][1])
    work = abs(audit["interface_work_on_grains"]).max()
    case.below(label + "works at the interface apart / work",
               abs(audit["interface_work_difference"]).max() / work, LIMITS[way][2])  # fmt: skip
    yielded = max(step.solid["dissipation"][0] for step in steps)
    strain = np.array([s.solid["u"][:4, 2].mean() - s.solid["u"][4:, 2].mean() for s in steps])
    given = np.trapezoid(stress[:, 1], strain / SIDE)
    case.above(label + "dissipated / work done on the element", yielded / given, 0.1)
    return strain / SIDE, stress, again


def run(case: Case) -> None:
    """Judge three laws, each solved in two ways, and a restart of each."""
    write_input(case)
    fig, axes = case.figure(ncols=3, figsize=(11.0, 3.6))
    for law, ax in zip(LAWS, axes, strict=True):
        for way, mark in (("static", "o"), ("explicit", "x")):
            strain, stress, again = judge(case, law, way)
            ax.plot(100.0 * strain, 1e-3 * stress[:, 1], "-", lw=1, label=f"on grains, {way}")
            ax.plot(100.0 * strain[::8], 1e-3 * again[::8, 1], mark, ms=4, mfc="none",
                    label="alone on that path")  # fmt: skip
        couple(case, law, "static", f"{law}_cut", (CUT, END))
        compare_runs(case, f"{law}, cut amid plastic flow: ", f"{law}_static", f"{law}_cut")
        ax.set(xlabel="shortening [%]", ylabel="axial pressure [kPa]", title=law)
        ax.legend(fontsize=7)
    case.save(fig)
