"""Upward flow through a saturated column against Terzaghi's critical gradient."""

import re

import numpy as np

from talus import mesh as meshes
from talus.compare import max_of
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

HEIGHT, POROSITY, GRAINS, WATER, GRAVITY, MOBILITY = 0.1, 0.4, 2650.0, 1000.0, 9.81, 1.0e-6
CRITICAL = (GRAINS / WATER - 1) * (1 - POROSITY)
RATIOS = (0.0, 0.25, 0.5, 0.75, 0.9, 1.0)
VELOCITY = MOBILITY * CRITICAL * WATER * GRAVITY  # at the critical gradient
EXCESS = CRITICAL * WATER * GRAVITY * HEIGHT
DRIVES = {
    # what is held at the base is hydrostatic and constant; the excess is a second group on it
    "pressure": "&pore_pressure group = 'z0', value = {0!r}, curve = 'base' /\n"
    "&curve id = 'base', times = {1}, values = {2} /",
    "flux": "&flux group = 'z0', value = {0!r}, curve = 'rise' /",
    "well": "&well group = 'z0', rate = {0!r}, curve = 'rise' /",
}
TIMES = (0.0, 8.0, 8.1, 16.0, 16.1, 24.0, 24.1, 32.0, 32.1, 40.0, 40.1, 48.0)


def judge(case: Case, element: str, drive: str, ax: object) -> None:
    """Judge stress, pressure and flow of a column at six gradients."""
    kind = element.split("_")[0]
    mesh = meshes.box(np.zeros(3), np.array([0.02, 0.02, HEIGHT]), (1, 1, 5))
    mesh = converted(mesh, kind)
    meshes.write_mesh(case.folder / f"{kind}.h5", mesh)
    rest = WATER * GRAVITY * HEIGHT
    values = [1 + r * EXCESS / rest for r in RATIOS for _ in (0, 1)]
    times = ", ".join(map(str, TIMES))
    value = {"pressure": rest, "flux": VELOCITY, "well": VELOCITY * 0.02**2}[drive]
    line = DRIVES[drive].format(value, times, ", ".join(map(repr, values)))
    text = (case.folder / "deck.nml").read_text()
    for key, value in (("MESH", kind), ("ELEMENT", element), ("DRIVE", line)):
        text = text.replace(key, value)
    name = f"{drive}_{element}"
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")
    steps = field_steps(case.folder / f"{name}.h5")
    title = f"{drive}, {element}"
    log = (case.folder / f"{name}.log").read_text()
    settled = float(re.search(r"settled under the initial stress\s+(\S+) m", log)[1])
    case.below(f"{title}: motion to the start [m]", settled, 1e-15)
    stress, flow, pressure, base = [], [], [], []
    z = mesh.x[:, 2]
    for ratio, step in zip(RATIOS, steps[1:], strict=True):
        points, found = step.solid["points_x"][:, 2], step.solid["stress_points"][:, 2]
        exact = -(1 - ratio) * (HEIGHT - points) * EXCESS / HEIGHT
        stress.append(np.abs(found - exact).max() / EXCESS)
        head = WATER * GRAVITY * (HEIGHT - z) + ratio * EXCESS * (HEIGHT - z) / HEIGHT
        pressure.append(np.abs(step.solid["pore_pressure"] - head).max() / EXCESS)
        flow.append(np.abs(step.solid["darcy"][:, 2] - ratio * VELOCITY).max() / VELOCITY)
        base.append(-np.polyval(np.polyfit(points, found, 1), 0.0) / EXCESS)
    case.below(f"{title}: effective stress, error / buoyant weight", max_of(stress), 1e-8)
    case.below(f"{title}: pressure, error / excess", max_of(pressure), 1e-8)
    case.below(f"{title}: flow, error / critical", max_of(flow), 1e-8)
    books = read_history(case.folder / f"{name}_pore.csv")
    off = abs(books["balance"]).max() / abs(books["z1 entered"]).max()
    case.below(f"{title}: liquid unaccounted for", float(off), 1e-12)
    energy = read_history(case.folder / f"{name}_energy.csv")
    largest = max_of(abs(v).max() for k, v in energy.items() if k not in ("time", "closure"))
    case.below(f"{title}: ledger", float(abs(energy["closure"]).max() / largest), 1e-12)
    ax.plot(RATIOS, base, "o" if drive == "pressure" else "x", mfc="none", label=title)


def judge_submerged(case: Case) -> None:
    """Judge a column under three metres of free water: only its buoyant weight is felt."""
    text = (case.folder / "deck.nml").read_text()
    for key, value in (
        ("MESH", "hex20"), ("ELEMENT", "hex20"), ("DRIVE", ""),
        ("&water_table level = 0.1", "&water_table level = 3.1"),
        ("level = 0.1, k0", f"surcharge = {3 * WATER * GRAVITY!r}, level = 0.1, k0"),
        ("&pore_pressure group = 'z1', head = 0.1", "&submerged group = 'z1', level = 3.1"),
    ):  # fmt: skip
        text = text.replace(key, value)
    (case.folder / "submerged.nml").write_text(text)
    case.run("talus-fem", "submerged.nml")
    last = field_steps(case.folder / "submerged.h5")[-1].solid
    points = last["points_x"][:, 2]
    off = np.abs(last["stress_points"][:, 2] + (HEIGHT - points) * EXCESS / HEIGHT).max() / EXCESS
    case.below("submerged: effective stress, error / buoyant weight", float(off), 1e-10)
    total = last["total_stress"][:, 2].max() / (3 * WATER * GRAVITY)
    case.below("submerged: largest total stress / free water's", float(total), -1.0)
    case.below("submerged: motion [m]", float(np.abs(last["u"]).max()), 1e-12)


def judge_squeezed(case: Case) -> None:
    """Judge the flow through a column of less permeability after its compression."""
    start = POROSITY / (1 - POROSITY)
    voids = start - 0.05 * (1 + start)
    n = voids / (1 + voids)
    laws = {
        "law = 'constant'": 1.0,
        "law = 'kozeny_carman'": n**3 / (1 - n) ** 2 * (1 - POROSITY) ** 2 / POROSITY**3,
        "law = 'void_ratio', permeability_index = 0.2": 10 ** ((voids - start) / 0.2),
    }
    for k, (law, factor) in enumerate(laws.items()):
        text = (case.folder / "squeezed.nml").read_text().replace("LAW", law)
        (case.folder / f"squeezed_{k}.nml").write_text(text)
        case.run("talus-fem", f"squeezed_{k}.nml")
        flow = field_steps(case.folder / f"squeezed_{k}.h5")[-1].solid["darcy"][:, 2]
        off = float(np.abs(flow * HEIGHT / MOBILITY / factor - 1).max())
        case.below(f"squeezed, {law.split(chr(39))[1]}: flow, error", off, 1e-9)


def run(case: Case) -> None:
    """Judge columns that are driven by pressure and by flux; plot the stress at the base."""
    fig, ax = case.figure()
    for element, drive in (("hex20", "pressure"), ("hex20", "flux"), ("hex27", "pressure"),
                           ("hex20", "well")):
        judge(case, element, drive, ax)
    judge_squeezed(case)
    judge_submerged(case)
    ax.plot([0, 1], [1, 0], "k-", lw=1, label="exact")
    ax.set(xlabel="gradient / critical [-]", ylabel="effective stress at the base / first [-]")
    ax.legend()
    case.save(fig)
