"""Plastic saturated soils: an element against the law's own paths, a footing at four rates."""

import numpy as np

from talus import mesh as meshes
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

SAND = (
    "law = 'sanisand', density = 1500.0, poisson = 0.05, stiffness_number = 125.0, "
    "critical_slope = 1.25, extension_ratio = 0.712, critical_void_ratio = 0.934, "
    "critical_line_slope = 0.019, critical_line_exponent = 0.7, yield_opening = 0.01, "
    "plastic_hardening = 7.05, hardening_void = 0.968, bounding_rate = 1.1, dilatancy = 0.704, "
    "dilatancy_rate = 3.5, fabric_limit = 4.0, fabric_rate = 600.0, residual_pressure = 0.0, "
    "void_ratio = VOID"
)
LAWS = {  # material, axial strain
    "drucker_prager": (
        "law = 'drucker_prager', density = 1800.0, young = 100.0e6, poisson = 0.25, "
        "cohesion = 20.0e3, friction_deg = 35.0, dilation_deg = 10.0, hardening = 0.5e6",
        0.01,
    ),
    "dense sand": (SAND.replace("VOID", "0.735"), 0.05),
    "loose sand": (SAND.replace("VOID", "0.88"), 0.05),
}
STEPS, P0 = 50, 1.0e5
COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "zx")
SEALED = (
    "&control  strain_part = 1.0, 1.0, 1.0, 0.0, 0.0, 0.0 /\n"
    "&control  strain_part = 1.0, -1.0, 0.0, 0.0, 0.0, 0.0 /\n"
)
DRAINED = "".join(
    f"&control  component = '{c}', kind = 'stress', scale = {-P0} /\n" for c in ("xx", "yy")
)
WIDTH, DEPTH, MODULUS, MOBILITY = 1.0, 0.1, 10.0e6 * 0.7 / 1.3 / 0.4, 1.0e-10
DRAIN = "&pore_pressure group = 'z1', value = 0.0 /"
BELOW = "&pore_pressure group = 'z0', value = 0.0 /"  # the layer lies on gravel
RATES = {"very fast": 1e-5, "fast": 0.5, "slow": 5.0, "very slow": 1e5}  # time c_v/B^2


def write_run(case: Case, source: str, name: str, values: dict[str, object], *words: str) -> None:
    """Write the deck of a run with its values, and run it."""
    text = (case.folder / f"{source}.nml").read_text()
    for key, value in values.items():
        text = text.replace(key, value if isinstance(value, str) else repr(float(value)))
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml", *words)


def judge_element(case: Case, law: str, sealed: bool, ax: object) -> None:
    """Judge the effective path of an element, its pore pressure and its volume."""
    material, strain = LAWS[law]
    title = f"{law}, {'sealed' if sealed else 'drained'}"
    name = title.replace(", ", "_").replace(" ", "_")
    write_run(case, "point", f"{name}_law", {
        "MATERIAL": material, "STEPS": str(STEPS), "STRAIN": strain,
        "CONTROLS": SEALED if sealed else DRAINED,
    }, "--point")  # fmt: skip
    span = 1.0 if sealed else 1.0e10  # far above h^2/c_v, below a second
    write_run(case, "element", name, {
        "MATERIAL": material, "STRAIN": strain, "T_END": span, "STEP": span / STEPS,
        "SEALED": "no" if sealed else "flow", "DRAIN": "" if sealed else DRAIN,
        "TOLERANCE": 1e-9 if sealed else 1e-11,  # sealed sand has round-off of 1e-11
    })  # fmt: skip
    point = read_history(case.folder / f"{name}_law_point.csv")
    wanted = np.column_stack([point[f"stress {c}"] for c in COMPONENTS])
    steps = field_steps(case.folder / f"{name}.h5")
    stress = np.array([s.solid["stress"].mean(axis=0) for s in steps])
    pore = np.array([s.solid["pore_pressure"] for s in steps])
    case.below(f"{title}: effective stress, error / p0", float(abs(stress - wanted).max() / P0),
               1e-8)  # fmt: skip
    excess = (wanted[:, :2].mean(axis=1) + P0)[:, None] if sealed else np.zeros((len(pore), 1))
    case.below(f"{title}: pore pressure, error / p0", float(abs(pore - excess).max() / P0), 1e-8)
    volume = -read_history(case.folder / f"{name}_pore.csv")["content"]
    change = -sum(point[f"strain {c}"] for c in COMPONENTS[:3])
    case.below(f"{title}: volume given off, error", float(abs(volume - change).max()), 1e-10)
    p, q = -wanted[:, :3].mean(axis=1), abs(wanted[:, 0] - wanted[:, 2])
    ax.plot(p / 1e3, q / 1e3, "k-", lw=1)
    p, q = -stress[:, :3].mean(axis=1), abs(stress[:, 0] - stress[:, 2])
    ax.plot(p[::2] / 1e3, q[::2] / 1e3, "o" if sealed else "s", ms=4, mfc="none", label=title)


def push(case: Case, name: str, values: dict[str, object]) -> np.ndarray:
    """Run the footing; return its resistance at all steps, over the surcharge [Pa]."""
    write_run(case, "footing", name, {"DEPTH": DEPTH} | values)
    found = read_history(case.folder / f"{name}_reactions.csv")
    return -found["strip z"] / (WIDTH * 0.5)


def judge_footing(case: Case, ax: object) -> None:
    """Judge resistance at four rates against the drained and the sealed soil."""
    mesh = meshes.box(np.zeros(3), np.array([6.0, 0.5, 4.0]), (12, 1, 8))
    mesh = converted(mesh, "hex20")
    top = np.isclose(mesh.x[:, 2], 4.0) & (mesh.x[:, 0] < WIDTH + 1e-9)
    mesh.nodes["strip"] = np.flatnonzero(top)
    meshes.write_mesh(case.folder / "footing.h5", mesh)
    count = 25
    span = {"T_END": 1.0, "STEP": 1 / count}
    dry = {"SEALED": "flow", "DRAIN": "&pore_pressure group = 'all', value = 0.0 /"}
    found = {"drained": push(case, "drained", span | dry),
             "sealed": push(case, "sealed", span | {"SEALED": "no", "DRAIN": ""})}  # fmt: skip
    for rate, factor in RATES.items():
        end = factor * WIDTH**2 / (MOBILITY * MODULUS)
        values = {"T_END": end, "STEP": end / count, "SEALED": "flow", "DRAIN": BELOW}
        found[rate] = push(case, rate.replace(" ", "_"), values)
    last = {k: float(v[-1]) for k, v in found.items()}
    span_of = last["drained"] - last["sealed"]
    case.above("drained over sealed resistance", last["drained"] / last["sealed"], 1.2)
    share = {k: (last[k] - last["sealed"]) / span_of for k in RATES}
    case.metric("very fast: share from sealed to drained", share["very fast"], 0.0, 0.03)
    case.metric("very slow: share from sealed to drained", share["very slow"], 1.0, 0.03)
    case.above("fast over very fast: share", share["fast"] - share["very fast"], 0.05)
    case.above("slow over fast: share", share["slow"] - share["fast"], 0.05)
    case.above("very slow over slow: share", share["very slow"] - share["slow"], 0.05)
    depth = np.linspace(0, DEPTH, len(found["drained"]))
    for k, v in found.items():
        style = "k-" if k == "drained" else "k--" if k == "sealed" else "o-"
        ax.plot(depth / WIDTH, v / 1e3, style, ms=3, lw=1, label=k)
    ax.set(xlabel="depth / half width", ylabel="mean pressure [kPa]")
    ax.legend()


def run(case: Case) -> None:
    """Judge elements and the footing; plot paths and resistance."""
    fig, (ax, bx) = case.figure(ncols=2)
    box = converted(meshes.box(np.zeros(3), np.ones(3), (1, 1, 1)), "hex20")
    meshes.write_mesh(case.folder / "element.h5", box)
    for law in LAWS:
        for sealed in (True, False):
            judge_element(case, law, sealed, ax)
    ax.set(xlabel="mean effective stress [kPa]", ylabel="q [kPa]", xlim=(0, 700), ylim=(0, 700))
    ax.legend(fontsize="small", loc="lower right")
    judge_footing(case, bx)
    case.save(fig)
