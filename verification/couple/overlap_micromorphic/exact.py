"""Lattices that overlap a micromorphic solid: uniform strain, micropolar limit, rigid rotation."""

import h5py
import numpy as np
from coupled import audit_of, fields_that_differ
from overlap_cell import lattice

from talus.compare import max_of
from talus.mesh import box, write_mesh
from talus.verification import Case, field_steps, write_packing

D, STIFFNESS, WIDE, DENSITY = 1.0e-3, 1.0e5, 5, 1400.0
FINE = 0.5  # stiffness of the relative strain of chi, over that of the lattice
COUPLE = 10.0  # gamma of the micropolar limit [N]
END = 9.6e-4
SPIN, STEPS, STEP = 400.0, 1500, 4.0e-7  # of the turning block [rad/s], [-], [s]


def micromorphic(pitch: float) -> str:
    """Return the solid of the lattice: E = k/a, nu = 0, kappa = k/a, chi = F where it is free."""
    stiff = STIFFNESS / pitch
    sigma = -FINE * stiff
    kappa, nu = 0.5 * (sigma + stiff), 0.5 * (sigma - stiff)
    return (
        f"&micromorphic id = 'soil', density = {DENSITY}, micro_inertia = 5.0e-8, lambda = 0.0,"
        f" mu = {0.5 * stiff - 2.0 * sigma:.17g}, eta = 0.0, tau = 0.0, kappa = {kappa:.17g},"
        f" nu = {nu:.17g}, sigma = {sigma:.17g},"
        f" taus = 0, 0, 0, 0, 0, 0, {0.5 * COUPLE}, 0, 0, 0, 0 /"
    )


def micropolar(pitch: float) -> str:
    """Return the micropolar solid of the lattice."""
    stiff = STIFFNESS / pitch
    return (
        f"&material id = 'soil', law = 'micropolar', density = {DENSITY}, micro_inertia = 1.0e-7,"
        f" lambda = 0.0, mu = 0.0, kappa = {stiff:.17g}, alpha = 0.0,"
        f" beta = 0.0, gamma = {COUPLE} /"
    )


def write_input(case: Case, name: str, pitch: float) -> None:
    """Write lattice and block, its outer nodes in groups by their height."""
    h = 3 * pitch
    pack, _ = lattice("cubic", (WIDE,) * 3, np.array([0.31, 0.23, 0.17]))
    x = pack.x * pitch
    inside = ((x > h) & (x < (WIDE - 1) * h)).all(1)
    spin = np.array([0.0, 0.0, SPIN if name == "turning" else 0.0])
    v = np.cross(spin, x - 0.5 * WIDE * h)
    write_packing(case.folder / f"{name}.h5", x[inside], np.full((inside.sum(), 3), 0.5 * D),
                  v=v[inside], omega=np.tile(spin, (inside.sum(), 1)))  # fmt: skip
    mesh = box(np.zeros(3), np.full(3, WIDE * h), (WIDE,) * 3)
    middle = mesh.x[mesh.cells["hex8"]].mean(1) / h - 0.5 * WIDE
    layer = 0.5 * WIDE - 0.5 - np.abs(middle).max(1)
    mesh.volumes.update(
        free=np.flatnonzero(layer > 1.5), ghosts=np.flatnonzero(np.abs(layer - 1) < 0.5)
    )
    place = np.rint(mesh.x / h).astype(int)
    for level in range(WIDE + 1):
        mesh.nodes[f"lines_x{level}"] = np.flatnonzero(place[:, 0] == level)
        mesh.nodes[f"lines_y{level}"] = np.flatnonzero(place[:, 1] == level)
    outer = ((place == 0) | (place == WIDE)).any(1)
    for level in range(WIDE + 1):
        mesh.nodes[f"level{level}"] = np.flatnonzero(outer & (place[:, 2] == level))
    write_mesh(case.folder / f"{name}_block.h5", mesh)


def motion(strain: float, sheared: bool, pitch: float) -> str:
    """Return supports and motions of the outer nodes: u_z = -e z, or u_x = e z."""
    moved = "x" if sheared else "z"
    held = ", ".join(f"'{c}'" for c in "xyz" if c != moved)
    sign = 1.0 if sheared else -1.0
    lines = []
    for level in range(WIDE + 1):
        lines.append(f"&support group = 'level{level}', fix = {held} /")
        lines.append(
            f"&motion group = 'level{level}', component = '{moved}', curve = 'ramp',"
            f" scale = {sign * strain * level * 3 * pitch:.17g} /"
        )
    return "\n".join(lines)


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


def settle(case: Case, name: str, strain: float, sheared: bool, solid: str) -> tuple:
    """Run a block to rest; return what it moved and stood at (n, 3), the solid, the pitch."""
    pitch = D * (1 - (1.0e-5 if sheared else 1.0e-4))
    write_input(case, name, pitch)
    values = {
        "name": name, "pack": name, "end": END, "saved": END, "exchange": 4.0e-6, "dt": 4.0e-7,
        "scheme": "static", "initial": "dead_load", "damping": 1.2e5, "kind": "static",
        "micro": "", "threads": 1, "more": motion(strain, sheared, pitch),
        "material": micropolar(pitch) if solid == "micropolar" else micromorphic(pitch),
    }  # fmt: skip
    launch(case, values)
    first, last = (list(field_steps(case.folder / f"{name}_grains.h5"))[i] for i in (0, -1))
    field = list(field_steps(case.folder / f"{name}_solid.h5"))[-1].solid
    return last.grains["x"] - first.grains["x"], first.grains["x"], field, pitch


def uniform(case: Case, label: str, strain: float, sheared: bool) -> tuple[float, np.ndarray]:
    """Judge a block in uniform strain; return how far grains are off, and what they moved."""
    name = label.replace(" ", "")
    moved, x, field, pitch = settle(case, name, strain, sheared, "micromorphic")
    exact = np.zeros_like(moved)
    exact[:, 0 if sheared else 2] = (strain if sheared else -strain) * x[:, 2]
    off = np.abs(moved - exact).max() / (strain * WIDE * 3 * pitch)
    case.below(f"{label}: grains off the uniform strain", off, strain, "of the order of the strain")
    wanted = STIFFNESS / pitch * (0.5 * strain if sheared else -strain)
    component = 6 if sheared else 8
    case.metric(f"{label}: stress", field["stress"][0, component] / wanted, 1.0, 5 * strain)
    phi = field["phi"].reshape(-1, 3, 3)
    symmetric = 0.5 * (phi + phi.transpose(0, 2, 1))
    wanted = np.zeros((3, 3))
    wanted[(2, 0) if sheared else (2, 2)] = (0.5 if sheared else -1.0) * strain
    wanted = np.maximum(np.abs(wanted), np.abs(wanted.T)) * (1 if sheared else -1)
    error = np.abs(symmetric - wanted).max() / strain
    case.below(f"{label}: sym phi off the strain, all nodes", error, 5 * strain)
    balance = audit_of(case, name)["unbalanced"][-1]
    case.below(f"{label}: not balanced / contact force", balance, 1e-7)
    return off, moved / strain


def turning(case: Case, name: str, steps: int, saved: int, *options: str) -> float:
    """Run a free block under a pressure that follows its faces, spinning; return the pressure."""
    pitch = D * (1 - 1.0e-4)
    write_input(case, "turning", pitch)
    pressure = STIFFNESS * 1.0e-4 * D / pitch**2
    held = ", ".join(3 * [f"{-pressure:.17g}"])
    lines = [f"&initial_stress group = 'all', value = {held}, 0.0, 0.0, 0.0 /"]
    lines += [
        f"&pressure group = '{axis}{side}', value = {pressure:.17g}, follower = .true. /"
        for axis in "xyz"
        for side in "01"
    ]
    for level in range(WIDE + 1):
        v = SPIN * (level - 0.5 * WIDE) * 3 * pitch
        for line, component, value in (("y", "x", -v), ("x", "y", v)):
            lines.append(
                f"&initial group = 'lines_{line}{level}', component = '{component}',"
                f" value = {value:.17g} /"
            )
    for component, value in (("chi12", -SPIN), ("chi21", SPIN)):
        lines.append(f"&initial group = 'all', component = '{component}', value = {value} /")
    values = {
        "name": name, "pack": "turning", "end": f"{steps * STEP:.17g}",
        "saved": f"{saved * STEP:.17g}", "exchange": STEP, "dt": STEP, "scheme": "symmetric",
        "initial": "none", "damping": 0.0, "kind": "explicit", "threads": 1,
        "micro": "micro_deformation = 'positions'", "more": "\n".join(lines),
        "material": micromorphic(pitch),
    }  # fmt: skip
    launch(case, values, *options)
    return pressure


def volume(x: np.ndarray, hex8: np.ndarray) -> float:
    """Volume of trilinear hexahedra by their Gauss points [m3]."""
    corner = np.array([[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1],
                       [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]])  # fmt: skip
    total = 0.0
    for xi in corner / np.sqrt(3.0):
        factor = 0.5 * (1.0 + corner * xi)
        slope = np.stack([0.5 * corner[:, i] * np.delete(factor, i, 1).prod(1) for i in range(3)])
        total += np.linalg.det(np.einsum("ia,eaj->eij", slope, x[hex8])).sum()
    return total


def rigid_rotation(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Judge the spinning block; return times and the error of its ledger."""
    pressure = turning(case, "turning", STEPS, STEPS // 10)
    audit = audit_of(case, "turning")
    first, last = (list(field_steps(case.folder / "turning_grains.h5"))[i] for i in (0, -1))
    middle = 0.5 * WIDE * 3 * D * (1 - 1.0e-4)
    map_of = np.linalg.lstsq(first.grains["x"] - middle, last.grains["x"] - middle, rcond=None)[0].T
    left, stretch, right = np.linalg.svd(map_of)
    rotation = left @ right
    angle = np.arctan2(rotation[1, 0], rotation[0, 0])
    case.metric("turning: angle / spin time", angle / (SPIN * STEPS * STEP), 1.0, 1e-3,
                "centrifugal stretch slows it")  # fmt: skip
    solid = list(field_steps(case.folder / "turning_solid.h5"))
    chi = solid[-1].solid["phi"].reshape(-1, 3, 3) + np.eye(3)
    limit = 5.0 * np.abs(stretch - 1.0).max()
    case.below("turning: chi off the rotation, all nodes", np.abs(chi - rotation).max(), limit,
               "five times the stretch")  # fmt: skip
    couple = np.abs(solid[-1].solid["couple_stress"]).max() / (0.5 * COUPLE / middle)
    case.below("turning: couple stress / (tau_7/half width)", couple, limit, "of the stretch alone")
    spin = np.abs([audit[f"angular_momentum_{c}"] for c in "xyz"])
    drift = max_of(np.ptp(audit[f"angular_momentum_{c}"]) for c in "xyz") / spin.max()
    case.below("turning: angular momentum", drift, 1e-12, "of its size")
    drift = max_of(np.ptp(audit[f"momentum_{c}"]) for c in "xyz")
    case.below("turning: momentum", drift / (spin.max() / (WIDE * 3 * D)), 1e-12)
    works = np.abs(audit["interface_work_given"] - audit["interface_work_taken"]).max()
    case.below("turning: works of both sides", works / audit["total_energy"][0], 1e-12)
    with h5py.File(case.folder / "turning_block.h5") as file:
        x, hex8 = file["nodes/x"][...], file["cells/hex8"][...]
    volumes = np.array([volume(x + step.solid["u"], hex8) for step in solid])
    times = np.array([step.time for step in solid])
    total = np.interp(times[1:], audit["time"], audit["total_energy"])
    ledger = total + pressure * volumes[1:]
    error = (ledger - ledger[0]) / audit["total_energy"][0]
    case.below("turning: ledger with the pressure's work", np.abs(error).max(), 1e-6)
    return times[1:], error


def repeat(case: Case) -> None:
    """Judge that a run in parts repeats the whole one."""
    turning(case, "whole", 60, 30)
    turning(case, "parts", 30, 30)
    turning(case, "parts", 60, 30, "--restart=auto")
    a, b = (case.folder / f"{name}_audit.csv" for name in ("whole", "parts"))
    case.metric("in parts: audit differs", float(a.read_bytes() != b.read_bytes()), 0, 0, "bytes")
    for side in ("grains", "solid"):
        a, b = (case.folder / f"{name}_{side}.h5" for name in ("whole", "parts"))
        case.metric(f"in parts: fields of the {side}", fields_that_differ(a, b), 0, 0)


def run(case: Case) -> None:
    """Uniform strain, the micropolar solid beside it, rigid rotation, restart."""
    fig, (left, right) = case.figure(ncols=2, figsize=(9.4, 3.8))
    strains = (1.0e-6, 1.0e-5)
    off = [uniform(case, f"pressed {strain:.0e}", strain, False)[0] for strain in strains]
    left.loglog(strains, off, "o-", label="pressed")
    left.loglog(strains, strains, "k-", lw=0.8, label="strain")
    off, moved = uniform(case, "sheared 1e-05", 1.0e-5, True)
    left.loglog(strains[-1:], [off], "s", label="sheared")
    left.set(xlabel="strain [-]", ylabel="grains off the exact motion [-]")
    left.legend()
    other = settle(case, "micropolar", 1.0e-5, True, "micropolar")[0] / 1.0e-5
    gap = np.abs(moved - other).max() / np.abs(other).max()
    case.below("sheared: off the run with a micropolar solid", gap, 1e-5)
    times, error = rigid_rotation(case)
    right.plot(SPIN * times, error, "o-")
    right.set(xlabel="rotation [rad]", ylabel="error of the ledger / kinetic energy [-]")
    case.save(fig)
    repeat(case)
