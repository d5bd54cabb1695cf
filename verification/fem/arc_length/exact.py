"""Paths past limits of the load and of the motion, against closed forms."""

import shutil

import numpy as np

from talus.compare import max_of
from talus.mesh import Mesh, boundary_faces, structured, write_mesh
from talus.verification import Case, field_steps, read_history

LOWER, UPPER, LONG = 1.0e6, 2.0e6, 5.0  # moduli [Pa], length of the upper block [m]
LAYERS, SHEAR, COHESION = 10, 4.0e7, 1.0e5
TANGENT = -SHEAR / 12.0
SLOPE = 2.0 * np.sqrt(6.0) / 3.0
HARDENING = 2.0 / SLOPE**2 / (1.0 / TANGENT - 1.0 / SHEAR)
STRENGTH = SLOPE * COHESION / np.sqrt(2.0)


def write_stack(case: Case, name: str, z: np.ndarray, groups: dict[str, np.ndarray]) -> np.ndarray:
    """Write a stack of elements of 1 m^2; return the levels of its nodes."""
    line = np.array([0.0, 1.0])
    x, hex8 = structured((line, line, z))
    mesh = Mesh(x, hex8, groups | {"all": np.arange(len(hex8))})
    faces = [q for _, q in boundary_faces(hex8).values() if np.isclose(x[q][:, 2], z[-1]).all()]
    mesh.facets["top"] = np.array(faces)
    mesh.nodes["z0"] = np.flatnonzero(np.isclose(x[:, 2], 0.0))
    mesh.nodes["z1"] = np.flatnonzero(np.isclose(x[:, 2], z[-1]))
    write_mesh(case.folder / f"{name}_mesh.h5", mesh)
    return x[:, 2]


def ledger(case: Case, stem: str) -> float:
    """Return the largest closure over the largest entry of the ledger."""
    energy = read_history(case.folder / f"{stem}_energy.csv")
    largest = max_of(abs(v).max() for k, v in energy.items() if k not in ("time", "closure"))
    return float(abs(energy["closure"]).max() / largest)


def block(young: float, stretch: np.ndarray) -> np.ndarray:
    """Force per area of St. Venant and Kirchhoff's solid [Pa]."""
    return 0.5 * young * (stretch**3 - stretch)


def judge_column(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Judge both blocks at all steps; return motion of the top and load."""
    z = write_stack(case, "column", np.array([0.0, 1.0, 1.0 + LONG]),
                    {"lower": np.array([0]), "upper": np.array([1])})  # fmt: skip
    case.run("talus-fem", "column.nml")
    steps = field_steps(case.folder / "column.h5")
    path = read_history(case.folder / "column_arc.csv")
    load = -2.0e5 * path["load factor"]
    middle = np.array([s.solid["u"][np.isclose(z, 1.0), 2].mean() for s in steps])
    top = np.array([s.solid["u"][np.isclose(z, 1.0 + LONG), 2].mean() for s in steps])
    limit = LOWER / (3 * np.sqrt(3.0))
    off = abs(block(LOWER, 1 + middle) - load).max() / limit
    case.below("column: lower block, error / largest load", float(off), 1e-6)
    off = abs(block(UPPER, 1 + (top - middle) / LONG) - load).max() / limit
    case.below("column: upper block, error / largest load", float(off), 1e-6)
    case.metric("column: largest load / exact", float(-load.min() / limit), 1.0, 1e-3)
    case.below("column: stretch of the lower block at the end", float(1 + middle[-1]), 0.4)
    case.above("column: way that the top turns back [m]", float(top[-1] - top.min()), 0.05)
    case.metric("column: limit points", float(path["limit points"][-1]), 1.0, 0.0)
    judge_restart(case, "column")
    return top, load


def judge_restart(case: Case, stem: str) -> None:
    """Judge that a run from a checkpoint repeats every bit."""
    kept = {p: p.read_bytes() for p in case.folder.glob(f"{stem}_*.csv")}
    shutil.copy(case.folder / f"{stem}.chk.1.h5", case.folder / "half.chk.h5")
    case.run("talus-fem", f"{stem}.nml", "--restart=half.chk.h5")
    same = all(p.read_bytes() == data for p, data in kept.items())
    case.metric(f"{stem}: restart repeats every bit", float(same), 1.0, 0)


def judge_layer(case: Case, name: str, load: str) -> tuple[np.ndarray, np.ndarray]:
    """Judge a layer under a traction or a motion; return motion of the top and shear stress."""
    text = (case.folder / "layer.nml").read_text()
    for word, value in (
        ("WHAT", name),
        ("YOUNG", repr(2.5 * SHEAR)),
        ("HARDENING", repr(float(HARDENING))),
        ("LOAD", load),
    ):
        text = text.replace(word, value)
    (case.folder / f"{name}.nml").write_text(text)
    z = write_stack(case, "layer", np.linspace(0.0, 1.0, LAYERS + 1),
                    {"weak": np.array([4]), "sound": np.delete(np.arange(LAYERS), 4)})  # fmt: skip
    case.run("talus-fem", f"{name}.nml")
    steps = field_steps(case.folder / f"{name}.h5")
    top = np.array([s.solid["u"][np.isclose(z, 1.0), 0].mean() for s in steps])
    tau = -read_history(case.folder / f"{name}_reactions.csv")["z0 x"]
    peak = int(np.argmax(tau)) + 1
    h = 1.0 / LAYERS
    soft = tau * (1 - h) / SHEAR + h * (STRENGTH / SHEAR + (tau - STRENGTH) / TANGENT)
    largest = STRENGTH / SHEAR
    before = abs(top - tau / SHEAR)[: peak - 1].max() / largest
    case.below(f"{name}: motion before the strength, error / largest", float(before), 1e-8)
    off = abs(top - soft)[peak:].max() / largest
    case.below(f"{name}: motion after it, error / largest", float(off), 1e-8)
    case.below(f"{name}: stress at the end / strength", float(tau[-1] / STRENGTH), 0.5)
    case.below(f"{name}: ledger, error / largest", ledger(case, name), 1e-9)
    return top, tau


def run(case: Case) -> None:
    """Judge both; plot the paths."""
    fig, axes = case.figure(ncols=2)
    top, load = judge_column(case)
    stretch = np.linspace(1.0, 0.1, 200)
    p = block(LOWER, stretch)
    far = np.array([np.max(np.real(np.roots([1, 0, -1, -2 * q / UPPER]))) for q in p])
    axes[0].plot(1 - stretch + LONG * (1 - far), -p / 1e3, "k-", lw=1, label="exact")
    axes[0].plot(-top, -load / 1e3, "o", ms=3, mfc="none", label="Talus")
    axes[0].set(xlabel="the top goes down [m]", ylabel="load [kPa]", title="collapse")
    loads = {
        "traction": "&traction group = 'top', value = 2.0e5, 0.0, 0.0, curve = 'ramp' /",
        "motion": f"&motion group = 'z1', component = 'x', curve = 'ramp', "
        f"scale = {float(2.0e5 / SHEAR)!r} /",
    }
    tau = np.array([0.0, STRENGTH, 0.0])
    h = 1.0 / LAYERS
    soft = tau * (1 - h) / SHEAR + h * (STRENGTH / SHEAR + (tau - STRENGTH) / TANGENT)
    exact = np.array([0.0, STRENGTH / SHEAR, soft[2]])
    axes[1].plot(1e3 * exact, tau / 1e3, "k-", lw=1, label="exact")
    for (name, text), mark in zip(loads.items(), "os", strict=True):
        top, tau = judge_layer(case, name, text)
        axes[1].plot(1e3 * top, tau / 1e3, mark, ms=3, mfc="none", label=f"Talus, {name}")
    axes[1].set(xlabel="the top moves [mm]", ylabel="shear stress [kPa]", title="softening")
    for ax in axes:
        ax.legend()
    case.save(fig)
