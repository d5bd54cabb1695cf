"""Pull-off from triangles, motion on triangles against the plane, a cohesive bed among surfaces."""

import numpy as np
import same_bits
from triangle_nets import net, pyramids, rough_net, write_stl

from talus.compare import max_of
from talus.generate import random_quaternions
from talus.packing import make_packing, write_h5
from talus.verification import Case, field_steps, read_history

RADIUS, DENSITY, YOUNG, POISSON, W = 5.0e-5, 2650.0, 1.0e8, 0.25, 0.05
E_STAR = YOUNG / (2.0 * (1.0 - POISSON**2))
MASS = DENSITY * 4.0 / 3.0 * np.pi * RADIUS**3
JKR = 1.5 * np.pi * W * RADIUS
AXES = [2.5e-3, 2.0e-3, 1.5e-3]
ROLLING = "rolling_friction = 0.1, twisting_friction = 0.05, rolling_damping = 0.1"
LAWS = {
    "rolling": f"law = 'hertz_mindlin', damping_ratio = 0.1, {ROLLING}",
    "necks": "law = 'hertz_mindlin', damping_ratio = 0.1, cohesion = 'jkr', surface_energy = 0.01",
    "turning": "law = 'mindlin_deresiewicz', damping_ratio = 0.1",
}
WALL = "&wall id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'glass' /\n"
SURFACE = "&surface id = 'floor', file = 'floor.stl', material = 'glass' /\n"
ONE = "&dynamics dt = 2.0e-6 /\n&output every_time = 1.0e-3 /\n&history every_time = 1.0e-3 /\n"
CHAMBER = """&surface id = 'floor', file = 'pyramids.stl', material = 'glass' /
&cylinder id = 'chamber', side = 'inside', radius = 9.8e-3, centre = 0.0, 0.0, 0.0,
          axis = 0.0, 0.0, 1.0, material = 'glass' /
&dynamics dt_factor = 0.06 /
&history every_time = 1.0e-3 /
&output every_time = 0.016, fields = 'contacts' /
&checkpoint every_time = 0.016, keep = 2 /
"""
COLUMNS = ("friction", "contact_damping", "tangential_relaxation", "rolling", "breakage")


def write_deck(case: Case, name: str, words: dict[str, object], text: str) -> None:
    """Write the common deck with its words and its own end."""
    deck = (case.folder / "deck.nml").read_text()
    for word, value in words.items():
        deck = deck.replace(word, str(value))
    (case.folder / f"{name}.nml").write_text(deck + text)


def pulled(case: Case, place: str, x: float, load: float) -> tuple[np.ndarray, ...]:
    """Load a sphere below a sheet downwards under drag; return time, its height, pull of both."""
    write_h5(case.folder / "drop.h5", make_packing(
        np.array([[x, 0.0, -RADIUS + 1e-12]]), np.full((1, 3), RADIUS),
        np.array([[1.0, 0.0, 0.0, 0.0]])))  # fmt: skip
    law = f"law = 'hertz_mindlin', damping_ratio = 0.0, cohesion = 'jkr', surface_energy = {W}"
    words = {"END": 3.0e-3, "GZ": -load / MASS, "YOUNG": YOUNG, "LAW": law, "PACK": "drop"}
    name = f"pull_{place}_{load / JKR:.2f}"
    text = "&surface id = 'sheet', file = 'sheet.stl', material = 'glass' /\n"
    text += "&dynamics dt = 2.0e-7, damping = 5.0e6 /\n&output every_time = 5.0e-5 /\n"
    write_deck(case, name, words, text + "&history every_time = 5.0e-5 /\n")
    case.run("talus-dem", f"{name}.nml")
    steps = field_steps(case.folder / f"{name}.h5")
    rows = read_history(case.folder / f"{name}_surfaces.csv")
    return (
        np.array([s.time for s in steps]),
        np.array([s.grains["x"][0, 2] for s in steps]),
        np.array([s.grains["force"][0, 2] for s in steps]),
        rows["force_z"],
    )


def pull_off(case: Case, ax: object) -> None:
    """Judge what a neck to a sheet holds; plot force over overlap."""
    write_stl(case.folder / "sheet.stl", net(2, 4.0 * RADIUS))
    for place, x in (("face", 1.5 * RADIUS), ("edge", 2.0e-3 * RADIUS), ("corner", 0.0)):
        _, height, force, sheet = pulled(case, place, x, 0.99 * JKR)
        case.metric(f"{place}: pull at rest under 0.99 of 3/2 pi w R", force[-1] / JKR, 0.99, 1e-4)
        case.metric(f"{place}: pull on the sheet / on the grain", sheet[-1] / force[-1], -1.0,
                    1e-12)  # fmt: skip
        _, height, force, sheet = pulled(case, place, x, 1.01 * JKR)
        case.metric(f"{place}: torn off at 1.01", float(height[-1] < -RADIUS - 1e-6), 1.0, 0.0)
        acts = force > 0
        ax.plot(-1e6 * (-RADIUS - height[acts]), -force[acts] / JKR, "o", label=place)
    neck = np.linspace(1.0, 2.6, 400) * (np.pi * W * RADIUS**2 / (8 * E_STAR)) ** (1 / 3)
    overlap = neck**2 / RADIUS - np.sqrt(2 * np.pi * W * neck / E_STAR)
    exact = 4 * E_STAR * neck**3 / (3 * RADIUS) - np.sqrt(8 * np.pi * W * E_STAR * neck**3)
    ax.plot(1e6 * overlap, exact / JKR, "-", label="JKR")
    ax.set(xlabel="overlap [um]", ylabel="force / (3/2 pi w R) [-]")
    ax.legend()


def throw(case: Case, law: str, floor: str, text: str) -> tuple[np.ndarray, ...]:
    """Throw an ellipsoid onto a floor; return time [s], position, velocity and spin (n, 3)."""
    packing = make_packing(
        np.array([[-9.0e-3, -8.0e-3, 2.6e-3]]), np.array([AXES]),
        np.array([[0.9, 0.3, -0.2, np.sqrt(1.0 - 0.94)]]),
    )  # fmt: skip
    packing.v[:] = [0.25, 0.2, -0.1]
    packing.omega[:] = [3.0, -5.0, 20.0]
    write_h5(case.folder / "grain.h5", packing)
    words = {"END": 0.03, "GZ": -9.81, "YOUNG": 2.9e8, "LAW": LAWS[law], "PACK": "grain"}
    write_deck(case, f"{law}_{floor}", words, text + ONE)
    case.run("talus-dem", f"{law}_{floor}.nml")
    steps = field_steps(case.folder / f"{law}_{floor}.h5")
    return np.array([s.time for s in steps]), *(
        np.array([s.grains[key][0] for s in steps]) for key in ("x", "v", "omega")
    )


def throws(case: Case) -> None:
    """Judge motion on triangles against the plane."""
    write_stl(case.folder / "floor.stl", rough_net())
    for law in LAWS:
        _, x, v, w = throw(case, law, "wall", WALL)
        _, x1, v1, w1 = throw(case, law, "triangles", SURFACE)
        off = max_of(np.abs(x1 - x).max() / AXES[0], np.abs(v1 - v).max(),
                  np.abs(w1 - w).max() * AXES[0])  # fmt: skip
        case.below(f"{law}: place / size, velocity, spin x size off the plane's", off, 1e-10)
        rows = read_history(case.folder / f"{law}_triangles_energy.csv")
        case.below(f"{law}: closure / first energy",
                   np.abs(rows["closure_error"]).max() / rows["kinetic"][0], 1e-4)  # fmt: skip


def bed(case: Case, ax: object) -> None:
    """Judge ledger, threads and restart of a cohesive bed among surfaces."""
    write_stl(case.folder / "pyramids.stl", pyramids())
    rng = np.random.default_rng(3)
    i, j, k = np.meshgrid(np.arange(3), np.arange(3), np.arange(2), indexing="ij")
    x = np.column_stack([i.ravel() - 1, j.ravel() - 1, k.ravel()]) * [5.2e-3, 5.2e-3, 5.5e-3]
    packing = make_packing(x + [0.0, 0.0, 5.2e-3], np.tile([2.2e-3, 1.8e-3, 1.4e-3], (18, 1)),
                           random_quaternions(rng, 18))  # fmt: skip
    packing.skew[::3] = rng.uniform(-0.3, 0.3, (6, 3))
    packing.exponent[1::3] = rng.uniform(2.5, 6.0, 6)
    packing.v[:, :2] = 30.0 * x[:, :2]
    write_h5(case.folder / "bed.h5", packing)
    law = f"{LAWS['necks'].replace('0.01', '0.05')}, {ROLLING}"
    words = {"END": 0.032, "GZ": -9.81, "YOUNG": 2.9e8, "LAW": law, "PACK": "bed"}
    write_deck(case, "chamber", words, CHAMBER)
    case.run("talus-dem", "chamber.nml", "--threads=1")
    rows = read_history(case.folder / "chamber_energy.csv")
    case.below("bed: largest closure error / work of gravity",
               np.abs(rows["closure_error"]).max() / np.abs(rows["gravity"]).max(),
               1e-4)  # fmt: skip
    pushed = read_history(case.folder / "chamber_surfaces.csv")
    push = sum(np.abs(pushed[f"force_{c}"]) for c in "xyz")
    case.metric("bed: surfaces that were pushed", len(set(pushed["surface"][push > 0])), 2, 0)
    same_bits.judge(case, "chamber", "bed: ")
    ax.plot(rows["time"], rows["gravity"], "-", label="work of gravity")
    for name in ("kinetic", "elastic_other", *COLUMNS):
        ax.plot(rows["time"], rows[name], "--", label=name.replace("_", " "))
    ax.set(xlabel="time [s]", ylabel="energy [J]")
    ax.legend(fontsize=8)


def run(case: Case) -> None:
    """Judge pull-off, throws and the bed; plot the first and the last."""
    fig, axes = case.figure(ncols=2, figsize=(9.0, 3.8))
    pull_off(case, axes[0])
    throws(case)
    bed(case, axes[1])
    case.save(fig)
