"""A column that starts with a geostatic stress."""

import numpy as np
from solid import save, shape_of

from talus.compare import max_of
from talus.mesh import box
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

HEIGHT, DENSITY, G, K0, SURCHARGE = 10.0, 1800.0, 9.81, 0.8, 5.0e3
YOUNG, POISSON = 2.0e7, 0.3
CONFINED = YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON))
LAWS = {
    "drucker": "law = 'drucker_prager', density = 1800.0, young = 2.0e7, poisson = 0.3, "
    "cohesion = 1.0e4, friction_deg = 30.0",
    "pressure": "law = 'pressure_elastic', density = 1800.0, young = 2.0e7, poisson = 0.3, "
    "exponent = 0.5, reference_pressure = 1.0e5",
    "clay": "law = 'cam_clay', density = 1800.0, poisson = 0.3, critical_slope = 1.0, "
    "compression_index = 0.1, swelling_index = 0.01, specific_volume = 1.8, "
    "overconsolidation = 2.0",
}
RUNS = (("drucker", "hex8_bbar"), ("drucker", "hex20"), ("drucker", "tet10"),
        ("pressure", "hex8_bbar"), ("clay", "hex8_bbar"))  # fmt: skip


def run_column(case: Case, law: str, element: str, start: float) -> tuple[list, dict, float]:
    """Run; return the steps, the ledger and the largest motion while settling [m]."""
    name = f"{law}_{element}_{start:.0f}"
    mesh = converted(box(np.zeros(3), np.array([1.0, 1.0, HEIGHT]), (1, 1, 10)), shape_of(element))
    save(mesh, case.folder / f"{shape_of(element)}.h5")
    text = (case.folder / "deck.nml").read_text()
    for word, value in (("NAME", name), ("KIND", shape_of(element)), ("MATERIAL", LAWS[law]),
                        ("ELEMENT", element), ("START", str(start))):  # fmt: skip
        text = text.replace(word, value)
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")
    log = (case.folder / f"{name}.log").read_text()
    moved = float(log.split("settled under the initial stress")[1].split()[0])
    energy = read_history(case.folder / f"{name}_energy.csv")
    return field_steps(case.folder / f"{name}.h5"), energy, moved


def judge_balance(case: Case, law: str, element: str) -> list:
    """Judge stress at the start, rest, and the ledger of what comes on."""
    steps, energy, moved = run_column(case, law, element, 1.0)
    label = f"{law}, {element}"
    depth = HEIGHT - steps[0].solid["points_x"][:, 2]
    vertical = -SURCHARGE - DENSITY * G * depth
    stress = steps[0].solid["stress_points"]
    for k, factor in ((2, 1.0), (0, K0), (1, K0)):
        off = abs(stress[:, k] - factor * vertical).max() / abs(vertical).max()
        case.below(f"{label}: stress {'xyz'[k]} at the start, error / largest", float(off), 1e-10)
    case.below(f"{label}: motion while settling [m]", moved, 1e-10)
    largest = max_of(abs(energy[k]).max() for k in ("load", "strain"))
    off = abs(energy["closure"]).max() / largest
    case.below(f"{label}: ledger, error / largest", float(off), 1e-9)
    return steps


def run(case: Case) -> None:
    """Judge all laws; settle a column whose surcharge is missing; plot the stress."""
    fig, ax = case.figure()
    for law, element in RUNS:
        steps = judge_balance(case, law, element)
        if law != "drucker":
            continue
        top = abs(steps[-1].solid["u"][:, 2]).max()
        wanted = SURCHARGE * HEIGHT / CONFINED
        case.metric(f"{law}, {element}: settlement / exact", float(top / wanted), 1.0, 1e-9)
    depth = HEIGHT - steps[0].solid["points_x"][:, 2]
    for k, name, mark in ((2, "vertical", "o"), (0, "horizontal", "s")):
        stress = -steps[0].solid["stress_points"][:, k] / 1e3
        ax.plot(stress, depth, mark, mfc="none", label=f"Talus, {name}")
    line = np.array([0.0, HEIGHT])
    exact = (SURCHARGE + DENSITY * G * line) / 1e3
    ax.plot(exact, line, "k-", lw=1, label="exact")
    ax.plot(K0 * exact, line, "k-", lw=1)
    # the surcharge of the stress does not act: the column rises and its stress loses it
    steps, _, moved = run_column(case, "drucker", "hex8_bbar", 0.0)
    wanted = SURCHARGE * HEIGHT / CONFINED
    case.metric("without the surcharge: rise / exact", moved / wanted, 1.0, 1e-4, "of the log")
    case.below("displacement at the start / rise", abs(steps[0].solid["u"]).max() / wanted, 1e-14)
    depth = HEIGHT - steps[0].solid["points_x"][:, 2]
    stress = steps[0].solid["stress_points"]
    off = abs(stress[:, 2] + DENSITY * G * depth).max() / (DENSITY * G * HEIGHT)
    case.below("without the surcharge: vertical stress, error / largest", float(off), 1e-10)
    sideways = -K0 * (SURCHARGE + DENSITY * G * depth) + POISSON / (1 - POISSON) * SURCHARGE
    off = abs(stress[:, 0] - sideways).max() / abs(sideways).max()
    case.below("without the surcharge: horizontal stress, error / largest", float(off), 1e-10)
    top = abs(steps[-1].solid["u"][:, 2]).max()
    case.metric("with it twice: settlement / exact", float(top / wanted), 2.0, 1e-9)
    ax.set(xlabel="compressive stress [kPa]", ylabel="depth [m]")
    ax.invert_yaxis()
    ax.legend()
    case.save(fig)
