"""Energy of a bar of grains and elements after a pulse has crossed the interface several times."""

import json

import h5py
import numpy as np
from coupled import audit_of, write_deck
from overlap_bars import ACROSS, CUT_OFF, DENSITY, SIDE, SPEED, STIFFNESS, A, Bar, deck_values

from talus.mesh import box, write_mesh
from talus.verification import Case, field_steps, write_packing

PRESSED = 2.0e-4
CENTRE, WIDTH, PEAK = -40 * A, 8 * A, 1.0e-4 * SPEED
STEP = 0.3 * 2 / CUT_OFF
STEPS = 1320  # of the grains: 396 layers, five crossings
M = (1, 2, 4, 6)
AREA = (ACROSS * SIDE) ** 2
ENERGY = 0.5 * DENSITY * AREA * PEAK**2 * WIDTH * np.sqrt(np.pi / 2)
OVERLAP = Bar(grains=80, free=4, ghosts=1, rest=18, pressed=PRESSED)
LAYERS, ELEMENTS = 96, 20  # of the bar with facets
ON_OVERLAP = "&overlap free_elements = 'free', ghost_elements = 'ghosts', scheme = '{}' /"
ON_FACETS = "&facets  ghosts = 'ghosts', facets = 'z0', interface = 'none' /"
SCHEMES = {  # name: &clock of facets, group of the interface
    "overlap, symmetric": ("", ON_OVERLAP.format("symmetric")),
    "overlap, state_at_n": ("", ON_OVERLAP.format("state_at_n")),
    "facets, state_at_n": (", scheme = 'state_at_n'", ON_FACETS),
    "facets, average": (", scheme = 'average'", ON_FACETS),
    "facets, iterated": (", scheme = 'iterated'", ON_FACETS),
    "facets of an explicit bar, symmetric": (", scheme = 'symmetric'", ON_FACETS),
    "facets of an explicit bar, iterated": (", scheme = 'iterated'", ON_FACETS),
}


def pulse(z: np.ndarray) -> np.ndarray:
    """Velocity at the start; half of it runs each way."""
    return PEAK * np.exp(-(((z - CENTRE) / WIDTH) ** 2))


def write_facets(case: Case) -> None:
    """Grains up to a layer of ghosts on the first face of a bar of elements four grains long."""
    z = A * (np.arange(LAYERS) - LAYERS + 1.0)
    line = SIDE * (np.arange(ACROSS) - 0.5 * (ACROSS - 1))
    x = np.array([(a, b, c) for c in z for a in line for b in line])
    v = np.zeros_like(x)
    v[:, 2] = pulse(x[:, 2])
    held = (x[:, 2] < z[0] + 0.5 * A) | (x[:, 2] > -0.5 * A)
    v[held] = 0.0
    radius = np.full(x.shape, OVERLAP.radius)
    ids = np.arange(len(x)) + 1
    groups = {"ghosts": ids[x[:, 2] > -0.5 * A]}
    write_packing(case.folder / "pack.h5", x, radius, kind=held.astype(int), v=v, groups=groups)
    half = 0.5 * ACROSS * SIDE
    lower, upper = np.array([-half, -half, 0.0]), np.array([half, half, 4 * A * ELEMENTS])
    write_mesh(case.folder / "bar.h5", box(lower, upper, (1, 1, ELEMENTS)))


def energy_kept(case: Case, stem: str, facets: bool) -> np.ndarray:
    """Energy over that of the pulse, by exchange (facets: first and last)."""
    audit = audit_of(case, stem)
    if not facets:
        return 1 + (audit["total_energy"] - audit["total_energy"][0]) / ENERGY
    parts = ("grains_kinetic", "grains_elastic", "solid_kinetic", "solid_elastic")
    total = sum(audit[p] for p in parts)
    last = field_steps(case.folder / "solid.h5")[-1]
    with h5py.File(case.folder / "solid.h5") as file:
        face = file["mesh/x"][:, 2] < 0.1 * A
    overlap = 2 * OVERLAP.radius - A
    held = ACROSS**2 * STIFFNESS * overlap * last.solid["u"][face, 2].mean()
    return 1 + np.array([0.0, total[-1] + held - total[0]]) / ENERGY


def one(case: Case, name: str, m: int) -> tuple[np.ndarray, float]:
    """Run one scheme; energies and wall time [s]."""
    clock, interface = SCHEMES[name]
    facets = "facets" in name
    values = deck_values(STEP, m, STEPS // m, name=name, m=m, clock=clock, interface=interface)
    values |= {
        "density": f"{OVERLAP.density:.17g}",
        "kind": "newmark" if "facets, " in name else "explicit",
    }
    write_deck(case, "grains.nml", "bar_grains.nml", **values)
    write_deck(case, "solid.nml", "bar_solid.nml", **values)
    case.run("talus-couple", write_deck(case, "run.nml", "coupled.nml", **values))
    summary = json.loads((case.folder / "run_summary.json").read_text())
    return energy_kept(case, "run", facets), summary["wall_time_s"]


def judge(case: Case, kept: dict) -> None:
    """Judge energies at the end over those at the start."""
    for (name, m), energy in kept.items():
        label, end = f"{name}, m = {m}", float(energy[-1])
        if name == "overlap, symmetric":
            case.below(f"{label}: swing", float(np.ptp(energy)), 0.04, "prototype: 0.963")
            half = len(energy) // 2
            late, early = np.ptp(energy[half:]), np.ptp(energy[:half])
            case.below(f"{label}: later over earlier swing", float(late / early), 1.5, "no drift")
        elif "explicit" in name:
            limit = 1e-2 if "symmetric" in name else 1e-3
            case.metric(label, end, 1.0, limit, "iterated: kinetic energy of central differences")
        elif name == "facets, iterated":
            case.metric(label, end, 1.0, 1e-4, "trapezoidal rule on both sides of the facets")
        elif name == "facets, average" and m >= 4:
            case.above(label, end, 2.0, "ghosts lag: unstable, meant to fail")
        else:
            case.metric(label, end, 1.0, 0.02, "not conserved")
    swings = [np.ptp(kept["overlap, symmetric", m]) for m in (2, 4, 6)]
    order = float(np.polyfit(np.log([2, 4, 6]), np.log(swings), 1)[0])
    case.metric("overlap, symmetric: order of the swing in m", order, 2.0, 0.3, "second order")
    drift = abs(float(kept["overlap, state_at_n", 6][-1]) - 1)
    case.above("overlap, state_at_n, m = 6: change", drift, 1e-3, "meant to fail")


def run(case: Case) -> None:
    """Fill the table and judge it."""
    kept, times = {}, {}
    for name in SCHEMES:
        if "facets" in name:
            write_facets(case)
        else:
            OVERLAP.write(case.folder, pulse)
        for m in M:
            kept[name, m], times[name, m] = one(case, name, m)
    judge(case, kept)
    fig, (left, right) = case.figure(ncols=2, figsize=(9.0, 4.0))
    for name in SCHEMES:
        left.plot(M, [kept[name, m][-1] for m in M], "o-", ms=4, label=name)
        right.plot(M, [times[name, m] for m in M], "o-", ms=4, label=name)
    left.set(xlabel="steps of the grains in an exchange", ylabel="energy at end / start [-]")
    left.set(ylim=(0.98, 1.02))
    right.set(xlabel="steps of the grains in an exchange", ylabel="wall time [s]", ylim=(0, None))
    left.legend(fontsize=7)
    case.save(fig)
