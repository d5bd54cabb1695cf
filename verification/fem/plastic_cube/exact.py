"""Cubes in triaxial compression against the material point."""

import numpy as np
from cube import write_cube
from solid import shape_of

from talus.compare import max_of
from talus.verification import Case, field_steps, read_history

DRUCKER = (
    "law = 'drucker_prager', density = 1.0, young = 100.0e6, poisson = 0.25, cohesion = 20.0e3, "
    "friction_deg = 35.0, dilation_deg = 10.0, hardening = 0.5e6"
)
CLAY = (
    "law = 'cam_clay', density = 1.0, poisson = 0.3, critical_slope = 1.2, "
    "compression_index = 0.2, swelling_index = 0.05, specific_volume = 1.9"
)
POLAR = DRUCKER.replace("'drucker", "'micropolar_drucker") + (
    ", l_t = 0.05, l_b = 0.05, coupling = 0.5, polar_ratio = 1.0, plastic_length = 0.05, "
    "micro_inertia = 1.0e-2"
)
STRONG = DRUCKER.replace("cohesion = 20.0e3", "cohesion = 1.0e9")
ELEMENTS = ("hex8_bbar", "hex8_full", "hex20", "hex27", "tet4", "tet10", "wedge6",
            "hex8/hex8", "hex20/hex8", "tet10/tet4")  # fmt: skip
# triaxial compression in closed form at 0.4, 0.6, 1 and 2 %: deviatoric stress, radial strain,
# hardening variable
TIMES = np.array([0.004, 0.006, 0.01, 0.02])
Q = np.array([348227.03399, 356983.455346, 374496.298056, 418278.404831])
RADIAL = np.array([0.00123822725225, 0.00261821222823, 0.0053781821802, 0.0122781070601])
HARDENING = np.array([0.00123401236482, 0.00579231680304, 0.0149089256795, 0.0377004478705])


def run_cube(case: Case, element: str, material: str, stem: str) -> dict[str, np.ndarray]:
    """Run a cube; return time, force on the top, radial motion, points and ledger error."""
    kind = shape_of(element)
    mesh = write_cube(case, f"{kind}.h5", kind)
    text = (case.folder / "deck.nml").read_text().replace("ELEMENT", element)
    text = text.replace("KIND", kind).replace("MATERIAL", material)
    (case.folder / f"{stem}.nml").write_text(text)
    case.run("talus-fem", f"{stem}.nml")
    steps = field_steps(case.folder / f"{stem}.h5")
    side = np.isclose(mesh.x[:, 0], 1.0)
    u = np.array([s.solid["u"][side, 0] for s in steps])
    energy = read_history(case.folder / f"{stem}_energy.csv")
    forces = read_history(case.folder / f"{stem}_reactions.csv")
    work = max_of(abs(energy[k]).max() for k in ("load", "support", "strain", "plastic"))
    newton = read_history(case.folder / f"{stem}_newton.csv")
    return {
        "time": np.array([s.time for s in steps]),
        "force": -forces["z1 z"],
        "radial": u.mean(axis=1),
        "bulge": np.array([np.ptp(u)]) if len(u) == 1 else np.ptp(u, axis=1),
        "state": np.array([s.solid["state_points"] for s in steps]),
        "stress": np.array([s.solid["stress_points"] for s in steps]),
        "ledger": np.array([abs(energy["closure"]).max() / work]),
        "dissipation": energy["plastic"],
        "iterations": newton["iteration"],
    }


def judge_drucker(case: Case, element: str) -> dict[str, np.ndarray]:
    """Judge one element against the reference."""
    material = POLAR if "/" in element else DRUCKER
    found = run_cube(case, element, material, "dp_" + element.replace("/", "_"))
    row = [int(np.argmin(abs(found["time"] - t))) for t in TIMES]
    off = abs(found["force"][row] - 1e5 - Q).max() / Q.max()
    case.below(f"{element}: q, error / largest", float(off), 1e-8)
    off = abs(found["radial"][row] - RADIAL).max() / RADIAL.max()
    case.below(f"{element}: radial strain, error / largest", float(off), 1e-8)
    state = found["state"][row][:, :, 11]
    off = abs(state - HARDENING[:, None]).max() / HARDENING.max()
    case.below(f"{element}: hardening at all points, error / largest", float(off), 1e-8)
    case.below(f"{element}: ledger, error / largest", float(found["ledger"][0]), 1e-9)
    growth = float(np.diff(found["dissipation"]).min())
    case.above(f"{element}: least growth of the dissipation [J]", growth, 0.0)
    return found


def judge_clay(case: Case, element: str) -> None:
    """Judge Cam-clay against the material point with the same steps."""
    text = (case.folder / "point.nml").read_text().replace("MATERIAL", CLAY)
    (case.folder / "clay_point.nml").write_text(text)
    case.run("talus-fem", "clay_point.nml", "--point")
    point = read_history(case.folder / "clay_point_point.csv")
    found = run_cube(case, element, CLAY, f"clay_{element}")
    wanted = -point["stress zz"]
    off = abs(found["force"] - wanted).max() / wanted.max()
    case.below(f"clay, {element}: axial stress, error / largest", float(off), 1e-6)
    off = abs(found["state"][-1, :, 11] / point["preconsolidation"][-1] - 1).max()
    case.below(f"clay, {element}: preconsolidation at all points, error", float(off), 1e-6)
    case.below(f"clay, {element}: ledger, error / largest", float(found["ledger"][0]), 1e-8)


def judge_strong(case: Case, element: str) -> None:
    """Judge a strength that is not reached: E times the strain."""
    found = run_cube(case, element, STRONG, f"strong_{element}")
    off = abs(found["force"] - 1e5 - 1e8 * found["time"]).max() / 2e6
    case.below(f"{element}, strong: axial stress, error / largest", float(off), 1e-12)
    case.metric(f"{element}, strong: most iterations", float(found["iterations"].max()), 1.0, 0.0)


def judge_dynamic(case: Case, name: str, element: str, analysis: str) -> None:
    """Judge slow dynamics with little mass, damped, against the reference."""
    write_cube(case, "hex8.h5")
    stem = name.replace(" ", "_")
    material = POLAR if "/" in element else DRUCKER
    text = (case.folder / "deck.nml").read_text().replace("ELEMENT", element)
    text = text.replace("KIND", "hex8").replace("MATERIAL", material.replace("= 1.0,", "= 0.1,", 1))
    before = text[text.index("kind = 'static'") : text.index(" /", text.index("kind = 'static'"))]
    (case.folder / f"{stem}.nml").write_text(text.replace(before, analysis))
    case.run("talus-fem", f"{stem}.nml")
    forces = read_history(case.folder / f"{stem}_reactions.csv")
    energy = read_history(case.folder / f"{stem}_energy.csv")
    q = np.interp(TIMES, forces["time"], -forces["z1 z"]) - 1e5
    case.below(f"{name}: q, error / largest", float(abs(q - Q).max() / Q.max()), 2e-3)
    work = max_of(abs(energy[k]).max() for k in ("load", "support", "strain", "plastic"))
    off = float(abs(energy["closure"]).max() / work)
    case.below(f"{name}: ledger, error / largest", off, 1e-8)
    growth = float(np.diff(energy["plastic"]).min())
    case.above(f"{name}: least growth of the dissipation [J]", growth, -1e-12)


def run(case: Case) -> None:
    """Judge all elements; plot the hex8."""
    runs = {element: judge_drucker(case, element) for element in ELEMENTS}
    for element in ("hex8_bbar", "tet10"):
        judge_clay(case, element)
        judge_strong(case, element)
    slow = "rayleigh_mass = 5.0e3"
    hht = f"kind = 'hht', alpha = -0.3, dt = 1.0e-4, tolerance = 1.0e-10, {slow}"
    for name, element in (("", "hex8_bbar"), ("polar ", "hex8/hex8")):
        judge_dynamic(case, name + "hht", element, hht)
        judge_dynamic(case, name + "explicit", element, f"kind = 'explicit', {slow}")
    fig, ax = case.figure()
    line = np.array([(0.0, 0.0), (0.345856518293, 345.856518293), (2.0, 418.278404831)])
    ax.plot(*line.T, "-", label="exact")
    for (element, found), mark in zip(runs.items(), "os^vDx+<>*", strict=True):
        q = (found["force"] - 1e5) / 1e3
        ax.plot(100 * found["time"], q, mark, ms=5, mfc="none", label=element)
    ax.set(xlabel="axial compression [%]", ylabel="deviatoric stress q [kPa]")
    ax.legend()
    case.save(fig)
