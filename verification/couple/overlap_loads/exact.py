"""Impulse and moment of loads on a block with grains at its surface; what its supports carry."""

import json

import numpy as np
from coupled import audit_of, write_deck

from talus.mesh import box, write_mesh
from talus.verification import Case, field_steps, read_history, write_packing

D, DENSITY, STIFFNESS, PRESSED = 1.0e-2, 2500.0, 1.0e5, 2.0e-5
PITCH = D * (1 - PRESSED)
N, LAYERS = 3, 5  # grains an element, elements across
H = N * PITCH
TOP = 3 * H
MASS = DENSITY * np.pi / 6 * D**3
STEP = 0.2 * np.sqrt(MASS / STIFFNESS)
M, EXCHANGES = 4, 60
TRACTION = np.array([30.0, -20.0, 70.0])
PRESSURE, FORCE = 40.0, np.array([0.010, 0.015, -0.020])
TIMES = np.array([0.0, 7.0, 22.0, 41.0, 1000.0]) * M * STEP
VALUES = np.array([0.2, 1.0, -0.6, 0.9, 0.9])
SOLIDS = {
    "classical": ("density = {rho:.17g}, young = {young:.17g}, poisson = 0.0", "hex8_full"),
    "micropolar": (
        "law = 'micropolar', density = {rho:.17g}, micro_inertia = 1.0e-4, lambda = 0.0, mu = 0.0,"
        " kappa = {young:.17g}, alpha = 0.0, beta = 0.0, gamma = 100.0",
        "hex8/hex8",
    ),
}


def write_input(case: Case) -> int:
    """Write lattice and block, grains free in the middle of the top; return a node over them."""
    line = PITCH * (np.arange(3 * N) - 0.5 * (3 * N - 1))
    x = np.array(
        [(a, b, TOP - (c + 0.5) * PITCH) for c in range(2 * N) for a in line for b in line]
    )
    write_packing(case.folder / "pack.h5", x, np.full(x.shape, 0.5 * D))
    half = 0.5 * LAYERS * H
    mesh = box(np.array([-half, -half, 0.0]), np.array([half, half, TOP]), (LAYERS, LAYERS, 3))
    middle = mesh.x[mesh.hex8].mean(1) / H
    free = (np.abs(middle[:, :2]) < 0.5).all(1) & (middle[:, 2] > 2)
    near = (np.abs(middle[:, :2]) < 1.5).all(1) & (middle[:, 2] > 1) & ~free
    mesh.volumes.update(free=np.flatnonzero(free), ghosts=np.flatnonzero(near))
    write_mesh(case.folder / "block.h5", mesh)
    return int(np.linalg.norm(mesh.x - [0.5 * H, 0.5 * H, TOP], axis=1).argmin())


def loads(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Total force [N] and moment about the origin [N m] at times, (n, 3) each."""
    area = (LAYERS * H) ** 2
    even = area * (np.interp(times, TIMES, VALUES)[:, None] * TRACTION - [0.0, 0.0, PRESSURE])
    moment = np.cross([0.0, 0.0, TOP], even) + np.cross([0.5 * H, 0.5 * H, TOP], FORCE)
    return even + FORCE, moment


def values_of(solid: str, node: int, **more: str) -> dict[str, str]:
    """Values of the decks."""
    material, element = SOLIDS[solid]
    density, young = MASS / PITCH**3, STIFFNESS / PITCH
    return {
        "material": material.format(rho=density, young=young),
        "element": element,
        "dt": f"{STEP:.17g}",
        "damping": "0.0",
        "times": ", ".join(f"{t:.17g}" for t in TIMES),
        "values": ", ".join(f"{v:.17g}" for v in VALUES),
        "traction": ", ".join(f"{v:.17g}" for v in TRACTION),
        "pressure": f"{PRESSURE:.17g}",
        "force": ", ".join(f"{v:.17g}" for v in FORCE),
        "node": str(node + 1),
        "support": "",
        "surcharge": "",
        "kind": "explicit",
        "exchange": f"{M * STEP:.17g}",
        "end": f"{EXCHANGES * M * STEP:.17g}",
    } | more


def launch(case: Case, stem: str, values: dict[str, str]) -> dict[str, np.ndarray]:
    """Run; return the audit."""
    for side in ("grains", "solid"):
        write_deck(case, f"{stem}_{side}.nml", f"{side}.nml", **values)
    text = (case.folder / "coupled.nml").read_text()
    (case.folder / f"{stem}.nml").write_text(text.replace("'grains.nml", f"'{stem}_grains.nml"))
    text = (case.folder / f"{stem}.nml").read_text()
    (case.folder / f"{stem}.nml").write_text(text.replace("'solid.nml", f"'{stem}_solid.nml"))
    write_deck(case, f"{stem}.nml", f"{stem}.nml", **values)
    case.run("talus-couple", f"{stem}.nml")
    return audit_of(case, stem)


def judge_impulse(case: Case, label: str, audit: dict[str, np.ndarray]) -> np.ndarray:
    """Momentum against the impulse of all loads; return both along z."""
    t = audit["time"]
    force, moment = loads(t)
    step = np.diff(t)[:, None]
    gained = np.column_stack([audit[f"momentum_{c}"] for c in "xyz"])
    impulse = np.vstack([np.zeros(3), np.cumsum(0.5 * step * (force[1:] + force[:-1]), 0)])
    scale = np.abs(impulse).max()
    error = np.abs(gained - gained[0] - impulse).max() / scale
    case.below(f"{label}: momentum less impulse", float(error), 1e-10, "round-off")
    spin = np.column_stack([audit[f"angular_momentum_{c}"] for c in "xyz"])
    turn = np.vstack([np.zeros(3), np.cumsum(0.5 * step * (moment[1:] + moment[:-1]), 0)])
    error = np.abs(spin - spin[0] - turn).max() / np.abs(turn).max()
    case.below(f"{label}: angular momentum less impulse", float(error), 2e-3, "places move")
    works = np.abs(audit["interface_work_given"] - audit["interface_work_taken"]).max()
    kinetic = (audit["grains_kinetic"] + audit["solid_kinetic"] + audit["edge_kinetic"]).max()
    case.below(f"{label}: works of both sides", float(works / kinetic), 1e-10, "round-off")
    return np.column_stack([t, gained[:, 2] - gained[0, 2], impulse[:, 2]])


def run(case: Case) -> None:
    """Free blocks, explicit; a held one, static."""
    node = write_input(case)
    fig, ax = case.figure()
    runs = (("classical", "step"), ("classical", "exchange"), ("micropolar", "step"))
    for (solid, contacts), mark in zip(runs, "ox+", strict=True):
        label = f"{solid}, ghosts by {contacts}"
        overlap = f"partition = 'ramp', initial = 'none', ghost_contacts = '{contacts}'"
        audit = launch(case, f"{solid}_{contacts}", values_of(solid, node, overlap=overlap))
        z = judge_impulse(case, label, audit)
        ax.plot(1e3 * z[:, 0], 1e3 * z[:, 1], mark, ms=4, label=label)
    ax.plot(1e3 * z[:, 0], 1e3 * z[:, 2], "k-", lw=0.8, label="impulse of the loads")
    ax.set(xlabel="time [ms]", ylabel="momentum along z [g m/s]")
    ax.legend(loc="upper right")
    case.save(fig)
    judge_start(case, node)
    for initial in ("none", "stress"):
        judge_statics(case, node, initial)
    judge_domain(case, node)


def judge_start(case: Case, node: int) -> None:
    """Loads that act from the start are held, those that come later move the whole block."""
    overlap = "partition = 'ramp', initial = 'dead_load'"
    for solid in SOLIDS:
        audit = launch(case, "later", values_of(solid, node, overlap=overlap))
        judge_later(case, f"{solid}, start held", audit)
    steady = {"values": "0.2, 0.2, 0.2, 0.2, 0.2"}
    idle = {"traction": "0.0, 0.0, 0.0", "pressure": "0.0", "force": "0.0, 0.0, 0.0"}
    ways = {}
    for stem, more in (("idle", idle), ("standing", steady), ("acting", steady)):
        how = overlap.replace("dead_load", "none") if stem == "acting" else overlap
        launch(case, stem, values_of("classical", node, overlap=how, **more))
        ways[stem] = field_steps(case.folder / f"{stem}_solid.h5")[-1].solid["u"] / D
    held, acting = (float(np.abs(ways[k] - ways["idle"]).max()) for k in ("standing", "acting"))
    case.below("start held: way of a node by its loads / diameter", held, 1e-12, "round-off")
    case.above("start not held: way of a node by its loads / diameter", acting, 1e-5)
    for stem in ("standing", "acting"):
        told = json.loads((case.folder / f"{stem}_summary.json").read_text())["overlap"]
        label = f"start {'not ' if stem == 'acting' else ''}held: rest over the largest load"
        case.metric(label, told["solid_rest_share"], 1.0, 1e-6, "no stress balances it")


def judge_later(case: Case, label: str, audit: dict[str, np.ndarray]) -> None:
    """Momentum along x and y, where the lattice itself pushes nothing, of what the loads change."""
    t = audit["time"]
    force = (loads(t)[0] - loads(np.zeros(1))[0])[:, :2]
    gained = np.column_stack([audit[f"momentum_{c}"] for c in "xy"])
    step = np.diff(t)[:, None]
    impulse = np.vstack([np.zeros(2), np.cumsum(0.5 * step * (force[1:] + force[:-1]), 0)])
    error = np.abs(gained - gained[0] - impulse).max() / np.abs(impulse).max()
    case.below(f"{label}: momentum less later impulse", float(error), 1e-10, "round-off")


def judge_domain(case: Case, node: int) -> None:
    """Grains of a bridging domain under a surcharge and background damping go with its nodes."""
    low, high = f"{-1.5 * H:.17g}", f"{1.5 * H:.17g}"
    values = values_of(
        "micropolar",
        node,
        overlap="method = 'bridging_domain', partition = 'ramp', initial = 'none'",
        damping=f"{0.05 / STEP:.17g}",
        surcharge=f"&surcharge stress = 100.0, update_every = 1000, lower = {low}, {low},"
        f" upper = {high}, {high} /",
    )
    audit = launch(case, "domain", values)
    gap = audit["fine_scale"].max() / audit["largest_ghost_displacement"].max()
    case.below("bridging domain: gap of grains and nodes / way", float(gap), 1e-9, "round-off")


def judge_statics(case: Case, node: int, initial: str) -> None:
    """What the bottom of a held block carries at rest."""
    end = 1600 * STEP
    values = values_of(
        "classical", node, kind="static", support="&support group = 'z0', fix = 'x', 'y', 'z' /",
        exchange=f"{10 * STEP:.17g}", end=f"{end:.17g}", damping=f"{0.1 / STEP:.17g}",
        overlap=f"scheme = 'static', settled = 1.0e-9, initial = '{initial}'",
    )  # fmt: skip
    audit = launch(case, "held", values)
    label = f"held, initial = '{initial}'"
    if initial == "stress":
        told = json.loads((case.folder / "held_summary.json").read_text())["overlap"]
        case.below(f"{label}: rest of the start", told["start_rest"], 1e-10, "gate")
    case.below(f"{label}: not balanced / contact force", audit["unbalanced"][-1], 1e-9)
    rows = read_history(case.folder / "held_solid_reactions.csv")
    found = [rows[f"z0 {c}"][-1] for c in "xyz"]
    force = loads(np.array([end]))[0][0]
    for c, a, b in zip("xyz", found, force, strict=True):
        case.metric(f"{label}: reaction along {c} / load", -a / b, 1.0, 1e-10, "round-off")
