"""Runs with overlap in one go, in two parts and over both transports, compared bit for bit."""

import numpy as np
from coupled import audit_of, compare_runs, write_deck

from talus.mesh import box, write_mesh
from talus.verification import Case, write_packing

RADIUS, ACROSS, N = 1.0e-3, 3, 3
D = 2 * RADIUS
SOILS = {
    "classical": (
        "id = 'soil', density = 1400.0, young = 5.0e7, poisson = 0.2",
        "hex8_bbar",
    ),
    "micropolar": (
        "id = 'soil', law = 'micropolar', density = 1400.0, micro_inertia = 4.0e-7, lambda = 1.0e7,"
        " mu = 1.0e7, kappa = 1.0e7, alpha = 0.0, beta = 0.0, gamma = 20.0",
        "hex8/hex8",
    ),
}


def write_column(case: Case) -> None:
    """Write a column of slightly shifted spheres, knocked sideways below, and elements on top."""
    rng = np.random.default_rng(5)
    line = D * (np.arange(ACROSS) + 0.5)
    z = D * (np.arange(-5, 5 * N) + 0.5)
    x = np.array([(a, b, c) for c in z for a in line for b in line])
    x += rng.uniform(-5e-3, 5e-3, x.shape) * RADIUS
    v = np.where(x[:, 2:] < -3 * D, np.array([0.05, 0.02, 0.1]), 0.0)
    kind = np.where(x[:, 2] < z[0] + 0.5 * D, 1, 0)
    v[kind == 1] = 0.0
    axes = np.full(x.shape, 1.01 * RADIUS)
    axes[len(x) // 2 :: 7] *= np.array([1.0, 0.99, 0.98])
    write_packing(case.folder / "pack.h5", x, axes, kind=kind, v=v)
    side = ACROSS * D
    mesh = box(np.zeros(3), np.array([side, side, 8 * N * D]), (1, 1, 8))
    mesh.volumes.update(free=np.arange(3), ghosts=np.arange(3, 5))
    write_mesh(case.folder / "block.h5", mesh)


def run(case: Case) -> None:
    """Compare for both solids and both projections."""
    write_column(case)
    for soil, method, of_both in (
        ("classical", "projection = 'l2'", False),
        ("classical", "projection = 'mls'", False),
        ("micropolar", "projection = 'l2', ghost_contacts = 'exchange'", True),
        ("classical", "ghost_contacts = 'exchange', partition = 'share'", False),
        ("micropolar", "method = 'bridging_domain'", True),
        ("micropolar", "method = 'penalty', penalty_damping = 0.05", False),
        ("classical", "method = 'bridging_domain', multipliers = 'lumped'", False),
    ):
        label = f"{soil}, {method}: "
        material, element = SOILS[soil]
        values = {"material": material, "element": element, "method": method}
        for name in ("whole", "parts", "files"):
            for path in case.folder.glob(f"{name}*"):
                path.unlink()
            write_deck(case, f"{name}_grains.nml", "bed_grains.nml")
            write_deck(case, f"{name}_solid.nml", "bed_solid.nml", **values)
        runs = [
            ("whole", "2.56e-4", 1, "shared_memory", ()),
            ("parts", "1.28e-4", 2, "shared_memory", ()),
            ("parts", "2.56e-4", 1, "shared_memory", ("--restart=auto",)),
        ]
        if of_both:
            runs.append(("files", "2.56e-4", 1, "hdf5", ()))
        for name, end, threads, transport, more in runs:
            places = values | {"name": name, "end": end, "threads": threads}
            deck = write_deck(case, f"{name}.nml", "coupled.nml", transport=transport, **places)
            case.run("talus-couple", deck, *more)
        moved = audit_of(case, "whole")["largest_ghost_displacement"].max()
        case.above(f"{label}ghosts moved [m]", moved, 1e-9, "the knock has arrived")
        compare_runs(case, f"{label}in parts, ", "whole", "parts")
        said = " ".join((case.folder / "whole.log").read_text().split())
        warned = "loads of the solid's deck on elements of free grains do nothing" in said
        beyond = "method = " in method
        case.metric(f"{label}warns of loads that do nothing", warned, beyond, 0)
        if of_both:
            compare_runs(case, f"{label}by files, ", "whole", "files")
