"""Lattices that overlap fully and partly with a strained block, against exact strain."""

import numpy as np
from coupled import audit_of, fields_that_differ
from overlap_cell import lattice

from talus.mesh import box, write_mesh
from talus.verification import Case, field_steps, write_packing

D, STIFFNESS = 1.0e-3, 1.0e5
WIDE = {"partly": 5, "fully": 6}  # elements a side: ghosts and one layer beyond around the free
# strain, and overlap / diameter that keeps contacts shut meanwhile, limit: pressed contacts turn
# when sheared, so that the lattice is stiffer than its springs by about as much; springs that turn
# on the way leave errors of second order, so that those that do nothing are left out (friction)
POLAR = {
    "material": "law = 'micropolar', density = 1400.0, micro_inertia = 1.0e-7, lambda = 1.0e7,"
    " mu = 1.0e7, kappa = 7.0e7, alpha = 0.0, beta = 0.0, gamma = 10.0",
    "element": "hex8/hex8",
    "moduli": "affine",
}
STATES = {
    "compressed": (1.0e-5, 1.0e-4, 1.0e-9),
    "pressed": (1.0e-5, 1.0e-4, 1.0e-9),  # the same from the pack's own stress and moduli
    "sheared": (1.0e-6, 1.0e-5, 1.0e-5),
}
END = 1.28e-3


def pitch(state: str) -> float:
    """Distance of the grains (m)."""
    return D * (1 - STATES[state][1])


def write_input(case: Case, name: str, state: str) -> None:
    """Write lattice and block, its outer nodes in groups by their height."""
    wide, a = WIDE[name], pitch(state)
    h = 3 * a
    pack, _ = lattice("cubic", (wide,) * 3, np.array([0.31, 0.23, 0.17]))
    x = pack.x * a
    inside = ((x > h) & (x < (wide - 1) * h)).all(1)
    write_packing(case.folder / f"{name}.h5", x[inside], np.full((inside.sum(), 3), 0.5 * D))
    mesh = box(np.zeros(3), np.full(3, wide * h), (wide,) * 3)
    middle = mesh.x[mesh.cells["hex8"]].mean(1) / h - 0.5 * wide
    layer = 0.5 * wide - 0.5 - np.abs(middle).max(1)
    mesh.volumes.update(
        free=np.flatnonzero(layer > 1.5), ghosts=np.flatnonzero(np.abs(layer - 1) < 0.5)
    )
    place = np.rint(mesh.x / h).astype(int)
    outer = ((place == 0) | (place == wide)).any(1)
    for level in range(wide + 1):
        mesh.nodes[f"level{level}"] = np.flatnonzero(outer & (place[:, 2] == level))
    write_mesh(case.folder / f"{name}_block.h5", mesh)


def motion(name: str, state: str) -> str:
    """Return supports and motions of the outer nodes: u_z = e z, or u_x = e z."""
    moved = "x" if state == "sheared" else "z"
    held = ", ".join(f"'{c}'" for c in "xyz" if c != moved)
    sign = 1.0 if state == "sheared" else -1.0
    lines = []
    for level in range(WIDE[name] + 1):
        lines.append(f"&support group = 'level{level}', fix = {held} /")
        lines.append(
            f"&motion group = 'level{level}', component = '{moved}', curve = 'ramp',"
            f" scale = {sign * STATES[state][0] * level * 3 * pitch(state):.17g} /"
        )
    return "\n".join(lines)


def strained(name: str, state: str, **more: object) -> dict[str, object]:
    """Values of the decks."""
    young = (0.7 if state == "pressed" else 1.0) * STIFFNESS / pitch(state)
    return {
        "name": name + more.pop("mark", ""),
        "pack": name,
        "material": f"density = 1400.0, young = {young:.17g}, poisson = 0.0",
        "element": "hex8_full",
        "motion": motion(name, state),
        "damping": "1.2e5",
        "transport": "shared_memory",
        "end": f"{END:.17g}",
        "saved": f"{END:.17g}",
        "initial": "stress" if state == "pressed" else "dead_load",
        "moduli": "affine" if state == "pressed" else "deck",
        "friction": 1.0e9 if state == "sheared" else 0.0,
        "threads": 1,
    } | more


def launch(case: Case, values: dict[str, object], *options: str) -> None:
    """Write the decks and run."""
    name = values["name"]
    for side in ("grains", "solid", "coupled"):
        text = (case.folder / f"{side}.nml").read_text()
        for key, value in values.items():
            text = text.replace(f"@{key}@", str(value))
        stem = f"{name}.nml" if side == "coupled" else f"{name}_{side}.nml"
        (case.folder / stem).write_text(text)
    case.run("talus-couple", f"{name}.nml", *options)


def judge(case: Case, name: str, state: str, polar: bool) -> np.ndarray:
    """Run; judge grains, nodes and stress; return the history of the rest."""
    write_input(case, name, state)
    launch(case, strained(name, state, **(POLAR if polar else {})))
    label = f"{name}, {state}{', micropolar' if polar else ''}: "
    strain, _, limit = STATES[state]
    k = 0 if state == "sheared" else 2
    slope = strain if state == "sheared" else -strain
    length = WIDE[name] * 3 * pitch(state)
    first, last = (list(field_steps(case.folder / f"{name}_grains.h5"))[i] for i in (0, -1))
    exact = np.zeros_like(first.grains["x"])
    exact[:, k] = slope * first.grains["x"][:, 2]
    error = np.abs(last.grains["x"] - first.grains["x"] - exact).max()
    case.below(f"{label}grains off the uniform strain", error / (strain * length), limit)
    solid = list(field_steps(case.folder / f"{name}_solid.h5"))
    stress = solid[-1].solid["stress"] - solid[0].solid["stress"]
    wanted = STIFFNESS / pitch(state) * slope * (0.5 if state == "sheared" else 1.0)
    zz, zx = (8, 6) if polar else (2, 5)
    column = zx if state == "sheared" else zz
    case.metric(f"{label}stress of the outer elements", stress[0, column] / wanted, 1.0, limit)
    audit = audit_of(case, name)
    case.below(f"{label}not balanced / contact force", audit["unbalanced"][-1], 1e-7)
    return audit["unbalanced"]


def repeat(case: Case) -> None:
    """Judge that a run with initial stress, in parts and over files, repeats the whole one."""
    write_input(case, "partly", "sheared")
    ends = {"end": "1.28e-4", "saved": "6.4e-5", "initial": "stress"}
    for mark in ("whole", "parts", "files"):
        more = ends | {"transport": "hdf5" if mark == "files" else "shared_memory"}
        if mark == "parts":
            launch(case, strained("partly", "sheared", mark=mark, **(more | {"end": "6.4e-5"})))
            more["threads"] = 2
        values = strained("partly", "sheared", mark=mark, **more)
        launch(case, values, *(("--restart=auto",) if mark == "parts" else ()))
    whole = case.folder / "partlywhole_audit.csv"
    for mark in ("parts", "files"):
        other = case.folder / f"partly{mark}_audit.csv"
        differs = float(whole.read_bytes() != other.read_bytes())
        case.metric(f"in {mark}: audit differs", differs, 0, 0, "bytes")
        for side in ("grains", "solid"):
            a, b = (case.folder / f"partly{m}_{side}.h5" for m in ("whole", mark))
            count = fields_that_differ(a, b)
            case.metric(f"in {mark}: fields of the {side} that differ", count, 0, 0)


def run(case: Case) -> None:
    """Both strains, partly and fully overlapped; restart and the other transport."""
    fig, ax = case.figure()
    for name, state, polar in (
        ("partly", "compressed", False),
        ("partly", "pressed", False),
        ("partly", "pressed", True),
        ("partly", "sheared", False),
        ("partly", "sheared", True),
        ("fully", "compressed", False),
        ("fully", "sheared", False),
    ):
        rest = judge(case, name, state, polar)
        label = f"{name}, {state}{', micropolar' if polar else ''}"
        ax.semilogy(np.arange(1, len(rest) + 1), rest, label=label)
    ax.axhline(1e-7, color="k", lw=0.8)
    ax.set(xlabel="exchange [-]", ylabel="force not balanced / contact force [-]")
    ax.legend()
    case.save(fig)
    repeat(case)
