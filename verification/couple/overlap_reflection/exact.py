"""Reflection of a broad pulse at overlaps of several meshes, against the closed form."""

from dataclasses import dataclass

import numpy as np
from coupled import audit_of, write_deck
from overlap_bars import ACROSS, CUT_OFF, A, Bar, deck_values

from talus.verification import Case, field_steps

GRAINS, OVERLAP = 340, 8  # layers left of the mesh; elements over free grains
CENTRE, PEAK = -100 * A, 2.0e-5 * A  # of the displacement at the start
PRESSED = 1.0e-4  # little, so that chains do not buckle
TAPER = 40  # layers next to the mesh that count less and less at the end
STEP = 0.4 / CUT_OFF
STEPS = 1400  # of the grains: waves of w = 0.75 are back 40 layers from the mesh
DAMPING = 0.15 * CUT_OFF
LAYERS = GRAINS  # that the waves are counted in: left of the mesh
MASSES = ("consistent", "projected", "nearest")
MARKERS = "os^vDxP+*<"  # colours repeat after eight


def closed_form(w: np.ndarray, n: int) -> np.ndarray:
    """Reflection of a chain joined to lumped elements of n spacings, w the frequency over w_c."""
    c1 = np.sqrt(1 - w**2)
    c2 = np.sqrt((1 - (n * w) ** 2).astype(complex))
    return np.abs((c1 - c2) / (c1 + c2))


def numbers() -> tuple[np.ndarray, np.ndarray]:
    """Wave numbers of the layers and velocity over displacement of a wave, in steps STEP."""
    k = 2 * np.pi * np.fft.fftfreq(LAYERS)
    turn = 2 * np.arcsin(0.5 * STEP * CUT_OFF * np.sin(0.5 * k))
    return k, np.sin(turn) / STEP


def start(z: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Displacement and velocity of the layers of a pulse that runs to the right alone."""
    u = PEAK * np.exp(-(((z - CENTRE) / (n * A / 3)) ** 2))
    head = np.fft.fft(u[:LAYERS])
    v = np.zeros_like(u)
    v[:LAYERS] = np.fft.ifft(-1j * numbers()[1] * head).real
    u[LAYERS:] = 0.0
    return u, v


def waves(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Size of the waves that run to the right and to the left, by wave number above 0."""
    k, rate = numbers()
    upper = k > 0
    u, v = np.fft.fft(u[:LAYERS])[upper], np.fft.fft(v[:LAYERS])[upper]
    return np.abs(u + 1j * v / rate[upper]) / 2, np.abs(u - 1j * v / rate[upper]) / 2


@dataclass
class Run:
    """One run: elements of n grains, and what else is asked for."""

    n: int
    label: str
    mass: str = "consistent"
    partition: str = "auto"
    damping: float = 0.0
    rest: int = 0
    more: str = ""
    m: int = 1
    domain: str = ""  # multipliers of a bridging domain eight elements long
    rim: bool = False  # the rim is free


def make(bar: Bar, case: Case, alone: bool = False) -> np.ndarray:
    """Write input; return the places of the layers from the mesh on."""
    layers = GRAINS + bar.n * (bar.free + bar.ghosts + (bar.rest if alone else 0))
    z = A * (np.arange(layers) + 0.5) - bar.start
    u, v = start(z, bar.n)
    at = {round(p / A, 3): k for k, p in enumerate(z)}

    def row(values: np.ndarray, places: np.ndarray) -> np.ndarray:
        return values[[at[round(p / A, 3)] for p in places]]

    bar.write(case.folder, lambda p: row(v, p), shift=lambda p: row(u, p), alone=alone)
    return z


def reflected(case: Case, stem: str, z: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Frequency over w_c and reflection by frequency, from the end of a run."""
    keep = np.ones(len(z))
    keep[LAYERS - TAPER : LAYERS] = np.cos(0.5 * np.pi * (np.arange(TAPER) + 0.5) / TAPER) ** 2
    state = field_steps(case.folder / f"{stem}.h5")[-1].grains
    first = slice(None, None, ACROSS**2)
    u = state["x"][first, 2][: len(z)] - (z + GRAINS * A)
    there = waves(*start(z, n))[0]
    back = waves(keep * u, keep * state["v"][first, 2][: len(z)])[1]
    k = numbers()[0]
    w = np.sin(0.5 * k[k > 0])
    return w, back / there


def run_one(case: Case, run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Coupled run; frequency and reflection."""
    free, ghosts = (1, OVERLAP) if run.domain else (OVERLAP, max(1, 4 // run.n))
    bar = Bar(GRAINS, free, ghosts, run.rest or 120 // run.n, run.n, PRESSED)
    z = make(bar, case)
    steps = STEPS // run.m
    how = f"mass = '{run.mass}', partition = '{run.partition}', fine_damping = {run.damping:.17g}"
    if run.rim:
        how = f"rim_nodes = 'free', partition = '{run.partition}'"
    if run.domain:
        how = f"method = 'bridging_domain', multipliers = '{run.domain}'"
    values = deck_values(STEP, run.m, steps, how=how)
    values["density"] = f"{bar.density:.17g}"
    more = run.more or "&support  group = 'z1', fix = 'z' /"
    write_deck(case, "grains.nml", "grains_base.nml", **values)
    write_deck(case, "solid.nml", "solid_base.nml", more=more, **values)
    case.run("talus-couple", write_deck(case, "run.nml", "coupled.nml", **values))
    return reflected(case, "grains", z, run.n)


def alone(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Grains alone, as long as grains and mesh together."""
    bar = Bar(GRAINS, OVERLAP, 1, 30, 4, PRESSED)
    z = make(bar, case, alone=True)
    values = deck_values(STEP, 1, STEPS, density=f"{bar.density:.17g}")
    case.run("talus-dem", write_deck(case, "only.nml", "grains_base.nml", **values))
    return reflected(case, "only", z, 4)


def at(curve: tuple[np.ndarray, np.ndarray], w: float) -> float:
    """Reflection at a frequency."""
    return float(np.interp(w, *curve))


def apart(case: Case, label: str, pair: list, top: float, limit: float, note: str) -> None:
    """Judge the largest difference of two curves, or of one to a function, up to a frequency."""
    w = np.linspace(0.1 * top, top, 60)
    values = [one(w) if callable(one) else np.interp(w, *one) for one in pair]
    case.below(label, float(np.abs(values[0] - values[1]).max()), limit, note)


def judge_energy(case: Case, label: str) -> None:
    """Judge that energy stays, with what the damping took."""
    audit = audit_of(case, "run")
    total = audit["total_energy"] - audit["total_energy"][0]
    energy = 2 * audit["grains_kinetic"][0]
    case.below(f"{label}: energy", np.ptp(total) / energy, 5e-3, "bounded, second order in dt")


def judge(case: Case, curves: dict) -> None:
    """Judge all curves."""
    w = np.linspace(0.01, 0.75, 60)
    case.below("grains alone", float(np.interp(w, *curves["grains alone"]).max()), 1e-3)
    for n in (4, 8):
        name, damped = f"n = {n}", f"n = {n}, damped"
        for top, limit in ((0.25, 0.02), (0.5, 0.04), (0.75, 0.12)):
            apart(
                case, f"{name}: closed form up to nw = {top}",
                [curves[name], lambda w, n=n: closed_form(w, n)], top / n, limit,
                "the joint of the overlap is no edge",
            )  # fmt: skip
        for nw in (1.5, 2.0):  # nearer to the cut-off some still rings in the overlap
            case.metric(f"{name}: at nw = {nw}", at(curves[name], nw / n), 1.0, 0.06, "whole")
        case.below(f"{damped}: at nw = 2", at(curves[damped], 2 / n), 0.12)
        case.below(f"{damped}: at nw = 3", at(curves[damped], 3 / n), 0.02)
        apart(
            case, f"{damped}: change up to nw = 0.5", [curves[name], curves[damped]], 0.5 / n,
            0.015, "the coarse motion is left alone",
        )  # fmt: skip
    apart(
        case, "m = 4: change up to nw = 0.9", [curves["n = 4"], curves["n = 4, m = 4"]], 0.9 / 4,
        0.02, "step of the solid",
    )  # fmt: skip
    near = "n = 4, dashpots close by"
    apart(
        case, "dashpots: change up to nw = 0.5", [curves["n = 4"], curves[near]], 0.5 / 4, 0.06,
        "of waves of 13 elements and less",
    )  # fmt: skip
    for top, limit in ((0.25, 0.02), (0.5, 0.04)):
        apart(
            case, f"n = 4, free rim: closed form up to nw = {top}",
            [curves["n = 4, free rim"], lambda w: closed_form(w, 4)], top / 4, limit,
            "last grain and first node hang on one contact",
        )  # fmt: skip
    judge_domain(case, curves)
    judge_choices(case, curves)


def judge_choices(case: Case, curves: dict) -> None:
    """Judge what the ways with the mass and the partition reflect beside one another."""
    nearest = curves["n = 4, mass = 'nearest'"]
    case.above("mass = 'nearest': at nw = 0.25", at(nearest, 0.25 / 4), 0.04, "mass goes inwards")
    for nw in (0.25, 0.5):
        for mass, name in (("consistent", "n = 4"), ("projected", "n = 4, mass = 'projected'")):
            ratio = at(curves[name], nw / 4) / at(nearest, nw / 4)
            case.below(f"mass = '{mass}' over 'nearest': at nw = {nw}", ratio, 0.75)
    for mass, most in (("consistent", 0.65), ("projected", 0.85), ("nearest", 0.85)):
        shared = at(curves[f"n = 4, mass = '{mass}', share"], 0.55 / 4)
        whole = "n = 4" if mass == "consistent" else f"n = 4, mass = '{mass}'"
        ratio = shared / at(curves[whole], 0.55 / 4)
        case.below(f"mass = '{mass}', share over fit: at nw = 0.55", ratio, most)


def judge_domain(case: Case, curves: dict) -> None:
    """Judge bridging domains of eight elements beside the overlap, and what lumping takes."""
    bound, loose = (curves[f"n = 4, domain, {name}"] for name in ("consistent", "lumped"))
    for nw, limit in ((0.25, 0.02), (0.5, 0.02), (0.75, 0.05)):
        for name, curve in (("consistent", bound), ("lumped", loose)):
            why = "a ramp of eight elements"
            case.below(f"domain, {name}: at nw = {nw}", at(curve, nw / 4), limit, why)
    for nw in (1.5, 2.0, 3.0):
        case.metric(f"domain, consistent: at nw = {nw}", at(bound, nw / 4), 1.0, 0.02, "whole")
    for nw, most in ((1.5, 0.75), (2.0, 0.5), (3.0, 0.3)):
        why = "the rest is lost in the domain"
        case.below(f"domain, lumped: at nw = {nw}", at(loose, nw / 4), most, why)


def draw(case: Case, curves: dict) -> None:
    """One panel a length of the elements."""
    fig, axes = case.figure(ncols=2, figsize=(9.0, 4.0), sharey=True)
    for n, ax in zip((4, 8), axes, strict=True):
        nw = np.linspace(0.01, 3.0, 600)
        ax.plot(nw, closed_form(nw / n, n), label="closed form")
        mine = [k for k in curves if k.startswith(f"n = {n}") or (n == 4 and "alone" in k)]
        for k, name in enumerate(mine):
            w, size = curves[name]
            shown = (w * n < 3.0) & (w < 0.7)
            ax.plot(n * w[shown], size[shown], MARKERS[k % len(MARKERS)], ms=2.5, label=name)
        ax.set(xlabel="n w = frequency / cut-off of the mesh [-]", ylim=(0, 1.1))
        ax.legend(fontsize=6, labelspacing=0.2, loc="upper right", bbox_to_anchor=(1.0, 0.75))
    axes[0].set(ylabel="reflection [-]")
    case.save(fig)


def run(case: Case) -> None:
    """Judge curves of reflection by frequency."""
    lysmer = "&absorbing group = 'z1' /"
    runs = [
        Run(4, "n = 4"),
        Run(8, "n = 8"),
        Run(4, "n = 4, damped", damping=DAMPING),
        Run(8, "n = 8, damped", damping=DAMPING),
        Run(4, "n = 4, mass = 'projected'", mass="projected"),
        Run(4, "n = 4, mass = 'nearest'", mass="nearest"),
        *(Run(4, f"n = 4, mass = '{m}', share", mass=m, partition="share") for m in MASSES),
        Run(4, "n = 4, free rim", partition="share", rim=True),
        Run(4, "n = 4, dashpots close by", rest=8, more=lysmer),
        Run(4, "n = 4, m = 4", m=4),
        Run(4, "n = 4, domain, consistent", domain="consistent"),
        Run(4, "n = 4, domain, lumped", domain="lumped"),
    ]
    curves = {"grains alone": alone(case)}
    for one in runs:
        curves[one.label] = run_one(case, one)
        if not one.more:
            judge_energy(case, one.label)
        if one.domain:
            audit = audit_of(case, "run")
            lost = audit["fine_scale_damping"][-1] / (2 * audit["grains_kinetic"][0])
            if one.domain == "lumped":
                case.above(f"{one.label}: taken by the multipliers", lost, 1e-3, "above nw = 1")
            else:
                why = "round-off of places, 3e-14 m, over the motion, 8e-6 m"
                case.below(f"{one.label}: taken by the multipliers", abs(lost), 1e-8, why)
    judge(case, curves)
    draw(case, curves)
