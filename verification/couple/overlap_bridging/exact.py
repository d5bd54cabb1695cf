"""Bridging domains: a pulse through a bar, and lattices that are strained at a constant rate."""

import numpy as np
from coupled import audit_of, write_deck
from overlap_bars import ACROSS, CUT_OFF, DENSITY, SIDE, SPEED, A, Bar, deck_values
from overlap_cell import lattice

from talus.mesh import box, write_mesh
from talus.verification import Case, field_steps, write_packing

BAR = Bar(grains=340, free=1, ghosts=8, rest=40)
CENTRE, WIDTH, PEAK = -70 * A, 20 * A, 2.0e-3 * SPEED
STEP = 0.5 * 2 / CUT_OFF
STEPS = 280  # of the grains: the pulse travels 140 layers
BEYOND = 40 * A  # from here on all that is seen has passed the domain
DOMAIN = "method = 'bridging_domain'"
LUMPED = DOMAIN + ", multipliers = 'lumped'"
BARS = {  # what &overlap says, steps of the grains in an exchange
    "consistent, m = 1": (DOMAIN, 1),
    "consistent, m = 4": (DOMAIN, 4),
    "lumped, m = 1": (LUMPED, 1),
    "bridging scale, m = 1": ("method = 'bridging_scale'", 1),
}

D, STIFFNESS, WIDE, LAYERS = 1.0e-3, 1.0e5, 6, 3
# overlap over the diameter, which keeps contacts shut: sheared, they turn and stiffen the lattice
# by as much
OVERLAP = {"zz": 1.0e-3, "xz": 1.0e-5}
RATE = {"zz": 1.0, "xz": 0.05}  # 1/s
CELL_STEP, CELL_STEPS = 1.25e-7, 160  # s
POLAR = (
    "law = 'micropolar', micro_inertia = 1.0e-7, lambda = 0.0, mu = 0.0, alpha = 0.0, beta = 0.0"
)
CELLS = {  # strain rate, micropolar, what &overlap says, limits of the grains' motion
    "compressed": ("zz", False, DOMAIN, (0.0, 1e-9, "uniform strain is exact")),
    "compressed, micropolar": ("zz", True, DOMAIN, (0.0, 1e-9, "uniform strain is exact")),
    "sheared, micropolar": ("xz", True, DOMAIN, (0.0, 1e-5, "contacts that turn")),
    "sheared": ("xz", False, DOMAIN, (0.0, 3e-3, "grains of the domain turn freely")),
    "compressed, lumped": ("zz", False, LUMPED, (1e-4, 1e-2, "grains are bound loosely")),
    "compressed, ramp": ("zz", False, DOMAIN + ", partition = 'ramp'", (1e-3, 1e-2, "no fit")),
    "compressed, twice": ("zz", False, DOMAIN + ", partition = 'twice'", (2e-2, 1.0, "meant")),
}


def pitch(strain: str) -> float:
    """Distance of the grains [m]."""
    return D * (1 - OVERLAP[strain])


def material(strain: str, polar: bool) -> tuple[str, str]:
    """Return the material that the lattice is, and its element."""
    young = STIFFNESS / pitch(strain)
    if polar:
        return f"{POLAR}, kappa = {young:.17g}, gamma = 10.0, density = 1400.0", "hex8/hex8"
    return f"density = 1400.0, young = {young:.17g}, poisson = 0.0", "hex8_full"


def pulse(z: np.ndarray) -> np.ndarray:
    """Velocity at the start; half of it runs each way."""
    return PEAK * np.exp(-(((z - CENTRE) / WIDTH) ** 2))


def exact(z: np.ndarray) -> np.ndarray:
    """Velocity at the end, beyond the domain: the half that runs to the right."""
    return 0.5 * pulse(z - SPEED * STEPS * STEP)


def elements_of(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Places and velocities of the nodes on an edge of the bar beyond the domain at the end."""
    import h5py

    with h5py.File(case.folder / "solid.h5") as file:
        x = file["mesh/x"][...]
    v = field_steps(case.folder / "solid.h5")[-1].solid["v"]
    edge = (x[:, 0] < 0) & (x[:, 1] < 0) & (x[:, 2] - BAR.start > BEYOND)
    order = np.argsort(x[edge, 2])
    return x[edge, 2][order] - BAR.start, v[edge, 2][order]


def bar(case: Case, ax: object) -> None:
    """Judge the pulse beyond the domain, momentum, energy and works."""
    BAR.write(case.folder, pulse)
    area = (ACROSS * SIDE) ** 2
    energy = 0.5 * DENSITY * area * PEAK**2 * WIDTH * np.sqrt(np.pi / 2)
    momentum = DENSITY * area * PEAK * WIDTH * np.sqrt(np.pi)
    z = np.linspace(BEYOND, BAR.h * (BAR.free + BAR.ghosts + BAR.rest), 400)
    ax.plot(z, exact(z) / PEAK, label="exact")
    for label, (method, steps) in BARS.items():
        values = deck_values(STEP, steps, STEPS // steps, method=method, threads=1)
        values |= {"grains": "grains", "solid": "solid", "saved": values["end"]}
        values["density"] = f"{BAR.density:.17g}"
        write_deck(case, "grains.nml", "bar_grains.nml", **values)
        write_deck(case, "solid.nml", "bar_solid.nml", **values)
        case.run("talus-couple", write_deck(case, "run.nml", "coupled.nml", **values))
        audit = audit_of(case, "run")
        drift = np.abs(audit["momentum_z"] - audit["momentum_z"][0]).max() / momentum
        case.below(f"{label}: momentum", drift, 1e-9, "round-off of positions times stiffness")
        swing = np.ptp(audit["total_energy"]) / energy
        case.below(f"{label}: energy", swing, 2e-3, "bounded, second order in the step")
        works = audit["interface_work_given"] - audit["interface_work_taken"]
        taken = audit["fine_scale_damping"][-1] / energy
        if label.startswith("lumped"):
            case.metric(f"{label}: taken by the multipliers", taken, -works[-1] / energy, 1e-10)
            case.below(f"{label}: taken by the multipliers", taken, 1e-2, "a wave it can carry")
        else:
            case.below(f"{label}: works of both sides", np.abs(works).max() / energy, 1e-10)
        if label.startswith("consistent"):
            gap = audit["fine_scale"].max() / audit["largest_ghost_displacement"].max()
            case.below(f"{label}: gap of grains and nodes over motion", gap, 1e-8, "round-off")
        x, v = elements_of(case)
        worst = np.abs(v - exact(x)).max() / (0.5 * PEAK)
        case.below(f"{label}: velocities over the peak", worst, 0.05, "dispersion of elements")
        ax.plot(x, v / PEAK, ".", ms=4, label=label)


def velocity(x: np.ndarray, strain: str) -> np.ndarray:
    """Uniform strain rate: compression along z, or shear in xz without rotation."""
    v, rate = np.zeros_like(x), RATE[strain]
    if strain == "zz":
        v[:, 2] = -rate * x[:, 2]
    else:
        v[:, 0], v[:, 2] = 0.5 * rate * x[:, 2], 0.5 * rate * x[:, 0]
    return v


def write_cell(case: Case, strain: str) -> None:
    """Write lattice and block; nodes in groups by their level along x and along z."""
    h = LAYERS * pitch(strain)
    pack, _ = lattice("cubic", (WIDE,) * 3, np.array([0.31, 0.23, 0.17]))
    x = pack.x * pitch(strain)
    inside = ((x > h) & (x < (WIDE - 1) * h)).all(1)
    axes = np.full((inside.sum(), 3), 0.5 * D)
    write_packing(case.folder / "cell.h5", x[inside], axes, v=velocity(x[inside], strain))
    mesh = box(np.zeros(3), np.full(3, WIDE * h), (WIDE,) * 3)
    middle = mesh.x[mesh.cells["hex8"]].mean(1) / h - 0.5 * WIDE
    layer = 0.5 * WIDE - 0.5 - np.abs(middle).max(1)
    mesh.volumes.update(
        free=np.flatnonzero(layer > 1.5), ghosts=np.flatnonzero(np.abs(layer - 1) < 0.5)
    )
    place = np.rint(mesh.x / h).astype(int)
    outer = ((place == 0) | (place == WIDE)).any(1)
    for axis in (0, 2):
        for level in range(WIDE + 1):
            here = place[:, axis] == level
            mesh.nodes[f"outer{'xyz'[axis]}{level}"] = np.flatnonzero(outer & here)
            mesh.nodes[f"inner{'xyz'[axis]}{level}"] = np.flatnonzero(~outer & here)
    write_mesh(case.folder / "cell_block.h5", mesh)


def cell_motion(strain: str) -> str:
    """Return velocities at the start, and motions of the outer nodes."""
    rate = RATE[strain]
    moves = {"zz": [("z", "z", -rate)], "xz": [("x", "z", 0.5 * rate), ("z", "x", 0.5 * rate)]}
    moved = {component for component, _, _ in moves[strain]}
    held = ", ".join(f"'{c}'" for c in "xyz" if c not in moved)
    lines = [f"&support group = 'outerz{k}', fix = {held} /" for k in range(WIDE + 1)]
    for component, axis, slope in moves[strain]:
        for k in range(WIDE + 1):
            v = f"{slope * k * LAYERS * pitch(strain):.17g}"
            if 0 < k < WIDE:
                lines.append(
                    f"&initial group = 'inner{axis}{k}', component = '{component}', value = {v} /"
                )
            lines.append(
                f"&motion group = 'outer{axis}{k}', component = '{component}', curve = 'steady',"
                f" scale = {v} /"
            )
    return "\n".join(lines)


def cells(case: Case) -> None:
    """Judge that grains and nodes keep the uniform rate."""
    end = f"{CELL_STEP * CELL_STEPS:.17g}"
    values = {"grains": "lattice", "solid": "block", "threads": 1, "end": end, "output": end}
    values |= {"saved": end, "dt": f"{CELL_STEP:.17g}", "exchange": f"{CELL_STEP:.17g}"}
    for label, (strain, polar, method, (least, most, why)) in CELLS.items():
        write_cell(case, strain)
        values["material"], values["element"] = material(strain, polar)
        values |= {"method": method, "motion": cell_motion(strain)}
        values["friction"] = 1.0e9 if strain == "xz" else 0.0
        write_deck(case, "lattice.nml", "cell_grains.nml", **values)
        write_deck(case, "block.nml", "cell_solid.nml", **values)
        case.run("talus-couple", write_deck(case, "cell.nml", "coupled.nml", **values))
        first, last = (field_steps(case.folder / "lattice.h5")[i].grains["x"] for i in (0, -1))
        time = CELL_STEP * CELL_STEPS
        off = last - first - time * velocity(first, strain)
        error = np.abs(off).max() / (RATE[strain] * time * WIDE * LAYERS * pitch(strain))
        case.below(f"{label}: grains off the uniform strain", error, most, why)
        if least > 0:
            case.above(f"{label}: grains off the uniform strain", error, least, why)


def run(case: Case) -> None:
    """Judge bars and cells."""
    fig, ax = case.figure()
    bar(case, ax)
    ax.set(xlabel="place along the bar [m]", ylabel="velocity / peak at the start [-]")
    ax.legend()
    case.save(fig)
    cells(case)
