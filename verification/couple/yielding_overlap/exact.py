"""Blocks that yield around a lattice that they overlap: start, ledger, statics, restart."""

import numpy as np
from coupled import audit_of, compare_runs, write_deck
from overlap_cell import lattice
from yielding_laws import LAWS, law_of

from talus.mesh import box, write_mesh
from talus.verification import Case, field_steps, read_history, write_packing

D, PRESSED, WIDE = 1.0e-3, 1.0e-3, 5
PITCH = D * (1.0 - PRESSED)
STRAIN, REST, END, STEP = 2.0e-3, 1.0e-4, 6.0e-4, 4.0e-7
CUT = 1000 * STEP


def write_input(case: Case) -> None:
    """Write the lattice and the block, with groups of its outer nodes by their height."""
    h = 3 * PITCH
    pack, _ = lattice("cubic", (WIDE,) * 3, np.full(3, 0.31))
    x = pack.x * PITCH
    x = x[((x > h) & (x < (WIDE - 1) * h)).all(1)]
    write_packing(case.folder / "pack.h5", x, np.full((len(x), 3), 0.5 * D))
    mesh = box(np.zeros(3), np.full(3, WIDE * h), (WIDE,) * 3)
    layer = np.rint(np.abs(mesh.x[mesh.cells["hex8"]].mean(1) / h - 0.5 * WIDE).max(1))
    mesh.volumes.update(free=np.flatnonzero(layer == 0), ghosts=np.flatnonzero(layer == 1))
    place = np.rint(mesh.x / h).astype(int)
    outer = ((place == 0) | (place == WIDE)).any(1)
    for level in range(WIDE + 1):
        mesh.nodes[f"level{level}"] = np.flatnonzero(outer & (place[:, 2] == level))
    write_mesh(case.folder / "block.h5", mesh)


def pressing() -> str:
    """Return supports and motions of the outer nodes: u_z = -e z, nothing sideways."""
    lines = []
    for level in range(WIDE + 1):
        lines.append(f"&support group = 'level{level}', fix = 'x', 'y' /")
        lines.append(
            f"&motion group = 'level{level}', component = 'z', curve = 'ramp',"
            f" scale = {-STRAIN * level * 3 * PITCH:.17g} /"
        )
    return "\n".join(lines)


def launch(case: Case, head: str, law: str, way: str, threads: int = 1,
           ends: tuple[float, ...] = (END,)) -> None:  # fmt: skip
    """Run the coupled block in as many parts as there are ends."""
    static = way == "static"
    values = {
        "name": head, "threads": threads, "exchange": 4.0e-6 if static else STEP, "dt": STEP,
        "scheme": "static" if static else "symmetric", "saved": 4.0e-5, "rest": REST, "last": END,
        "damping": 1.2e5 if static else 0.0, "law": law_of(law, 1.0e-7), "more": pressing(),
        "micro": ", micro_deformation = 'positions'" if law != "sand" else "",
        "kind": "'static', tolerance = 1.0e-9" if static else "'explicit'",
    }  # fmt: skip
    for end in ends:
        for side, name in (("grains", f"{head}_grains"), ("solid", f"{head}_solid"),
                           ("coupled", head)):  # fmt: skip
            write_deck(case, f"{name}.nml", f"{side}.nml", end=end, **values)
        again = ("--restart=auto",) if end != ends[0] else ()
        case.run("talus-couple", f"{head}.nml", *again)


def work_of(case: Case, head: str) -> float:
    """Work of the reactions on the outer nodes [J]."""
    reaction = read_history(case.folder / f"{head}_solid_reactions.csv")
    ramp = np.clip((reaction["time"] - REST) / (END - REST), 0.0, 1.0)
    moved = [-STRAIN * level * 3 * PITCH * ramp for level in range(WIDE + 1)]
    return sum(np.trapezoid(reaction[f"level{k} z"], u) for k, u in enumerate(moved))


def judge(case: Case, law: str, way: str, ax: object) -> np.ndarray:
    """Judge one run; return the stress zz of its elements at the end, compression positive."""
    head = f"{law}_{way}"
    launch(case, head, law, way)
    label = f"{law}, {way}: "
    audit = audit_of(case, head)
    grains = field_steps(case.folder / f"{head}_grains.h5")
    still = [s for s in grains if s.time < REST]
    way_at_rest = max(abs(s.grains["x"] - grains[0].grains["x"]).max() for s in still) / D
    case.below(label + "way of a grain at rest / diameter", way_at_rest, 1.0e-9, "nothing moves")
    given, taken = audit["interface_work_given"], audit["interface_work_taken"]
    case.below(label + "works of both sides apart / work", abs(given - taken).max()
               / abs(given).max(), 1.0e-9)  # fmt: skip
    solid = field_steps(case.folder / f"{head}_solid.h5")
    yielded = np.mean([s.solid["yield"] > 0 for s in solid[-3:]])
    case.above(label + "share of elements that yield at the end", float(yielded), 0.3)
    energy = read_history(case.folder / f"{head}_solid_energy.csv")
    spent = energy["plastic"][-1] / energy["support"][-1]
    case.above(label + "dissipated / work of the supports", float(spent), 0.05)
    if way == "explicit":
        work, total = work_of(case, head), audit["total_energy"]
        error = total[-1] - total[0] + energy["plastic"][-1] - work
        case.below(label + "energy not accounted for / work", abs(error) / work, 2.0e-3)
    stress = np.array([s.solid["stress"].mean(0) for s in solid])
    stress = -stress[:, -1 if stress.shape[1] == 9 else 2]
    times = np.array([s.time for s in solid])
    pressed = 100.0 * STRAIN * np.clip((times - REST) / (END - REST), 0.0, 1.0)
    ax.plot(pressed, 1e-3 * stress, "-" if way == "explicit" else "o", ms=4, mfc="none", label=way)
    return stress


def run(case: Case) -> None:
    """Judge three laws in motion and at rest, and a run in parts and on two threads."""
    write_input(case)
    fig, axes = case.figure(ncols=3, figsize=(11.0, 3.6))
    for law, ax in zip(LAWS, axes, strict=True):
        moving = judge(case, law, "explicit", ax)
        slow = judge(case, law, "static", ax)
        off = abs(moving - slow).max() / slow.max()
        case.below(f"{law}: mean stress of both ways apart", float(off), 0.05)
        launch(case, f"{law}_cut", law, "explicit", 2, (CUT, END))
        compare_runs(case, f"{law}, cut and on two threads: ", f"{law}_explicit", f"{law}_cut")
        ax.set(xlabel="shortening [%]", ylabel="mean axial pressure of the block [kPa]", title=law)
        ax.legend()
    case.save(fig)
