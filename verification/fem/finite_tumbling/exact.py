"""A soft block that spins and tumbles in free flight."""

import shutil

import numpy as np
from solid import save

from talus.compare import same_arrays
from talus.mesh import Mesh, box
from talus.verification import Case, Step, field_steps, read_history

SIZE, CELLS = np.array([0.1, 0.2, 0.4]), (2, 3, 6)
DENSITY, SPIN = 1000.0, np.array([4.0, 20.0, 9.0])
FLIGHT = np.array([0.5, -0.3, 0.8])
RUNS = {  # analysis, mark
    "explicit": "kind = 'explicit', dt = 4.0e-4",
    "half": "kind = 'explicit', dt = 2.0e-4",
    "newmark": "kind = 'newmark', dt = 1.0e-3, tolerance = 1.0e-11",
    "hht": "kind = 'hht', alpha = -0.05, dt = 1.0e-3, tolerance = 1.0e-11",
}


def write_block(case: Case) -> tuple[Mesh, str]:
    """Write the block; return it and the deck lines of its velocities."""
    mesh = box(-0.5 * SIZE, 0.5 * SIZE, CELLS)
    v = np.cross(SPIN, mesh.x) + FLIGHT
    lines = ""
    for n, row in enumerate(v):
        mesh.nodes[f"n{n}"] = np.array([n])
        for c, value in zip("xyz", row, strict=True):
            lines += f"&initial group = 'n{n}', component = '{c}', value = {float(value)!r} /\n"
    save(mesh, case.folder / "block.h5")
    return mesh, lines


def fly(case: Case, name: str, law: str, analysis: str, lines: str, *options: str) -> list[Step]:
    """Run a deck; return its steps."""
    text = (case.folder / "deck.nml").read_text().replace("ANALYSIS", analysis)
    (case.folder / f"{name}.nml").write_text(text.replace("LAW", law) + lines)
    case.run("talus-fem", f"{name}.nml", *options)
    return field_steps(case.folder / f"{name}.h5")


def masses(mesh: Mesh) -> np.ndarray:
    """Return the lumped masses of equal bricks [kg]."""
    share = DENSITY * np.prod(SIZE) / len(mesh.hex8) / 8
    return share * np.bincount(mesh.hex8.ravel(), minlength=len(mesh.x))


def momenta(mesh: Mesh, steps: list[Step]) -> tuple[np.ndarray, np.ndarray]:
    """Return momentum and angular momentum about the origin at all steps."""
    m = masses(mesh)[:, None]
    p = np.array([(m * s.solid["v"]).sum(axis=0) for s in steps])
    turn = [np.cross(mesh.x + s.solid["u"], m * s.solid["v"]).sum(axis=0) for s in steps]
    return p, np.array(turn)


def judge_momenta(case: Case, name: str, mesh: Mesh, steps: list[Step]) -> None:
    """Judge that momentum and angular momentum stay."""
    for what, found in zip(("momentum", "angular momentum"), momenta(mesh, steps), strict=True):
        off = abs(found - found[0]).max() / np.linalg.norm(found[0])
        case.below(f"{name}: {what}, change / size", float(off), 1e-10)


def energy_off(case: Case, name: str) -> float:
    """Return the largest error of the ledger over the energy at the start."""
    energy = read_history(case.folder / f"{name}_energy.csv")
    return float(abs(energy["closure"]).max() / energy["kinetic"][0])


def same_steps(a: list[Step], b: list[Step]) -> float:
    """Return 1 where all fields are the same bits."""
    same = len(a) == len(b)
    for p, q in zip(a, b, strict=True):
        same = same and same_arrays(p.solid, q.solid)
    return float(same)


def repeats(case: Case, name: str, whole: list[Step]) -> None:
    """Go on from the checkpoint half-way; judge that all that follows is the same bits."""
    shutil.copy(case.folder / f"{name}.chk.h5", case.folder / "half.chk.h5")
    case.run("talus-fem", f"{name}.nml", "--restart=half.chk.h5")
    again = field_steps(case.folder / f"{name}.h5")
    case.metric(f"{name}: restart repeats every bit", same_steps(whole, again), 1.0, 0)


def run(case: Case) -> None:
    """Judge momenta, energies and repetition; plot stored and kinetic energy."""
    mesh, lines = write_block(case)
    flights = {n: fly(case, n, "neo_hookean", a, lines) for n, a in RUNS.items()}
    fly_k = fly(case, "kirchhoff", "st_venant_kirchhoff", RUNS["explicit"], lines)
    for name, steps in (("explicit", flights["explicit"]), ("kirchhoff", fly_k)):
        judge_momenta(case, name, mesh, steps)
        stretch = abs(steps[-1].solid["green_zz"]).max()
        case.above(f"{name}: axial strain at the end, largest", float(stretch), 0.02)
        repeats(case, name, steps)
    repeats(case, "newmark", flights["newmark"])
    threads = fly(case, "threads", "neo_hookean", RUNS["explicit"], lines, "--threads=2")
    case.metric("two threads: every bit", same_steps(flights["explicit"], threads), 1.0, 0)
    off = {name: energy_off(case, name) for name in RUNS}
    case.below("explicit: energy, error / start", off["explicit"], 2e-3)
    ratio = off["explicit"] / off["half"]
    case.metric("explicit: error of the energy, step over half the step", ratio, 4.0, 1.0)
    for name in ("newmark", "hht"):
        case.below(f"{name}: energy, error / start", off[name], 2e-2)
        p, turn = momenta(mesh, flights[name])
        drift = abs(p - p[0]).max() / np.linalg.norm(p[0])
        case.below(f"{name}: momentum, change / size", float(drift), 1e-8)
        last = flights[name][-1].solid["u"] - flights["half"][-1].solid["u"]
        moved = np.abs(last - last.mean(axis=0)).max() / SIZE.max()
        case.below(f"{name}: shape and place at the end against explicit, over the size",
                   float(moved), 0.1)  # fmt: skip
    fig, ax = case.figure()
    for name, mark in zip(RUNS, ("-", ":", "--", "-."), strict=True):
        energy = read_history(case.folder / f"{name}_energy.csv")
        ax.plot(energy["time"], energy["strain"], mark, label=name)
    ax.set(xlabel="time [s]", ylabel="stored energy [J]")
    ax.legend()
    case.save(fig)
