"""Runs on several ranks against the run on one."""

import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
from solid import MATERIAL, distorted_cube, save, shape_of

from talus.compare import difference as apart
from talus.compare import extent, max_of
from talus.mesh import boundary_faces
from talus.verification import Case, field_steps, launcher, read_history

CLASSICAL = "density = 2000.0, young = 2.0e7, poisson = 0.3"
POLAR = MATERIAL.format(1.0e7, 0.7e7, 0.5e7, 1.0e4, 0.5e4, 2.0e4).replace(
    "density = 1.0,", "density = 2000.0, micro_inertia = 1.0e-3,"
)
PLASTIC = (
    "law = 'drucker_prager', density = 2000.0, young = 2.0e7, poisson = 0.3, cohesion = 1.2e4, "
    "friction_deg = 25.0, dilation_deg = 5.0, hardening = 1.0e5"
)
MICRO = (
    "&micromorphic id = 'm', density = 2000.0, micro_inertia = 1.0e-3, lambda = 2.9e7, mu = 0.7e7, "
    "eta = 6.0e7, tau = 1.0e7, kappa = 1.0e7, nu = 0.8e7, sigma = 0.5e7, "
    "taus = 0, 0, 0, 0, 0, 0, 5.0e4, 0, 0, 0, 0"
)
CONES = (
    "&cone level = 'macro', friction_deg = 12.0, dilation_deg = 5.0, cohesion = 3.0e4, "
    "hardening = 2.0e7 /\n&cone level = 'micro', friction_deg = 10.0, dilation_deg = 4.0, "
    "cohesion = 3.0e4, hardening = 2.0e7 /\n"
)
FINITE = "law = 'neo_hookean', density = 2000.0, young = 2.0e5, poisson = 0.3"
STRESS = "&initial_stress group = 'all', value = -1.0e4, -1.0e4, -1.0e4, 0.0, 0.0, 0.0 /\n"
SPRINGS = "&spring group = 'top', normal = 1.0e8, tangential = 1.0e7 /\n"
FOLLOWER = "&pressure group = 'top', value = 1.0e4, follower = .true., curve = 'up' /\n"
ABSORBING = "&absorbing group = 'side' /\n"
STAGES = """&stage group = 'core', time = 2.0e-3, duration = 2.0e-3 /
&stage group = 'core', action = 'place', time = 6.0e-3, duration = 1.0e-3 /
"""
RAYLEIGH = ", rayleigh_mass = 5.0, rayleigh_stiffness = 1.0e-5"
STEP = "dt = 1.0e-3"
SAME = 1.0e-10
ITERATE = "kind = 'static', solver = 'iterative'"
MULTIGRID = "kind = 'static', solver = 'multigrid'"
ARC = "continuation = 'arc_length'"
NEWTON = "tolerance = 1.0e-12"
RUNS = {  # element, material, more groups, analysis
    "factors": ("hex8_bbar", CLASSICAL, SPRINGS, "kind = 'static', solver = 'direct', dt = 5e-3"),
    "gradients": ("hex8_bbar", CLASSICAL, SPRINGS, f"{ITERATE}, tolerance = 1.0e-13"),
    "multigrid": ("hex20/hex8", POLAR, "", f"{MULTIGRID}, tolerance = 1.0e-13"),
    "flow": ("hex8_bbar", PLASTIC, STRESS, f"{MULTIGRID}, {NEWTON}, {STEP}"),
    "plastic": ("hex8_bbar", PLASTIC, STRESS, f"kind = 'static', {NEWTON}, {STEP}"),
    "stages": ("hex8_bbar", PLASTIC, STRESS + STAGES, f"kind = 'static', {NEWTON}, {STEP}"),
    "arc": ("hex8_bbar", FINITE, FOLLOWER, f"kind = 'static', {ARC}, {NEWTON}, {STEP}"),
    "finite": ("hex8_bbar", FINITE, FOLLOWER + SPRINGS, f"kind = 'static', {NEWTON}, {STEP}"),
    "newmark": ("hex20/hex8", POLAR, "", f"kind = 'newmark', {STEP}"),
    "hht": ("hex8_bbar", CLASSICAL, ABSORBING, f"kind = 'hht', alpha = -0.1, {STEP}{RAYLEIGH}"),
    "one_point": ("hex8_one_point", CLASSICAL, "", "kind = 'explicit', dt = 2.0e-4"),
    "explicit": ("hex8_bbar", PLASTIC, STRESS + ABSORBING, "kind = 'explicit', dt = 2.0e-4"),
    "micromorphic": ("hex8/hex8", MICRO, CONES, f"kind = 'static', {NEWTON}, {STEP}"),
    "micro_waves": ("hex20/hex8", MICRO, "", "kind = 'explicit', dt = 2.0e-4"),
    "inverted": ("hex8_bbar", FINITE, "", "kind = 'explicit', dt = 2.0e-4"),
}
JUDGED = [name for name in RUNS if name != "inverted"]


def write_meshes(case: Case) -> None:
    """Write a distorted cube of each kind with its groups."""
    for kind in ("hex8", "hex20"):
        mesh = distorted_cube(4 if kind == "hex8" else 2, kind)
        x = mesh.x
        mesh.nodes["base"] = np.flatnonzero(x[:, 2] < 1e-9)
        mesh.nodes["edge"] = np.flatnonzero((x[:, 2] > 1 - 1e-9) & (x[:, 0] > 1 - 1e-9))
        faces = [nodes for _, nodes in boundary_faces(mesh.cells).values()]
        mesh.facets["side"] = np.array([q for q in faces if (x[q][:, 1] > 1 - 1e-9).all()])
        mesh.facets["top"] = np.array([q for q in faces if (x[q][:, 2] > 1 - 1e-9).all()])
        middles = np.array([x[c].mean(0) for c in mesh.cells[kind]])
        core = (middles[:, 0] < 0.5) & (middles[:, 1] < 0.5) & (middles[:, 2] > 0.5)
        mesh.volumes["core"] = np.flatnonzero(core)
        save(mesh, case.folder / f"{kind}.h5")


def write_deck(case: Case, name: str, stem: str) -> None:
    """Write the deck of a run under the name of its files."""
    element, material, more, analysis = RUNS[name]
    text = (case.folder / "deck.nml").read_text() + more
    if material.startswith("&"):
        text = text.replace("&material id = 'm', MATERIAL", material)
    words = {"MESH": f"{shape_of(element)}.h5", "MATERIAL": material, "ELEMENT": element}
    for word, value in (words | {"ANALYSIS": analysis}).items():
        text = text.replace(word, value)
    (case.folder / f"{stem}.nml").write_text(text)


def results(case: Case, stem: str) -> dict[str, np.ndarray]:
    """Return all fields of all steps and all columns of all histories.

    Of Newton's iterations, which round-off may turn where a point just unloads, the converged ones.
    """
    found = {}
    for step in field_steps(case.folder / f"{stem}.h5"):
        for key, values in step.solid.items():
            found[f"{step.time:.4f} {key}"] = values
    for name in ("energy", "reactions"):
        for key, values in read_history(case.folder / f"{stem}_{name}.csv").items():
            found[f"{name} {key}"] = values
    table = case.folder / f"{stem}_newton.csv"
    if table.exists():
        newton = read_history(table)
        last = np.append(np.diff(newton["time"]) > 0.0, True)
        for key in ("time", "share of the step", "yielding points"):
            found[f"newton {key}"] = newton[key][last]
    return found


def kind_of(key: str) -> str:
    """Return what a result is measured by: its field, or the largest of its history."""
    first, rest = key.split(" ", 1)
    return first if first in ("energy", "reactions") and rest != "time" else rest


def difference(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> float:
    """Return the largest difference over the largest value of its kind."""
    if {k: v.shape for k, v in a.items()} != {k: v.shape for k, v in b.items()}:
        return np.inf
    scale: dict[str, float] = {}
    for key, values in a.items():
        scale[kind_of(key)] = max_of(scale.get(kind_of(key), 1e-300), extent(values))
    return max_of(
        apart(a[k], b[k]) / scale[kind_of(k)]
        for k in a if scale[kind_of(k)] > 1e-300
    )  # fmt: skip


def judge_ranks(case: Case, name: str, counts: tuple[int, ...]) -> list[float]:
    """Judge runs on several ranks; return the differences."""
    write_deck(case, name, name)
    case.run("talus-fem", f"{name}.nml")
    one = results(case, name)
    case.above(f"{name}: largest displacement [m]", float(abs(one["0.0100 u"]).max()), 1e-5)
    off = []
    for ranks in counts:
        write_deck(case, name, f"{name}_{ranks}")
        case.run("talus-fem", f"{name}_{ranks}.nml", ranks=ranks)
        off.append(difference(one, results(case, f"{name}_{ranks}")))
        case.below(f"{name}: {ranks} ranks, difference / largest", off[-1], SAME)
    return off


def judge_restart(case: Case, name: str, first: int, then: int) -> None:
    """Judge a run that goes on from half-way with another number of ranks."""
    stem = f"{name}_{first}" if first else name
    whole = results(case, name)
    shutil.copy(case.folder / f"{stem}.chk.h5", case.folder / "half.h5")
    case.run("talus-fem", f"{stem}.nml", "--restart=half.h5", ranks=then)
    off = difference(whole, results(case, stem))
    text = f"{first or 1} ranks, then {then or 1}"
    case.below(f"{name}: {text}, difference / largest", off, SAME)


def steady_deck(case: Case, words: dict[str, str], more: str = "") -> str:
    """Return the deck without what varies in time, with words replaced and groups added."""
    text = (case.folder / "deck.nml").read_text()
    apart_from = ("&curve", "&motion", "&checkpoint", "&traction")
    lines = [line for line in text.splitlines() if not line.startswith(apart_from)]
    deck = "\n".join(lines) + "\n" + more
    steady = {", t_end = 0.01": "", "3.0, 0.0, -9.81": "0.0, 0.0, 0.0", "2.0e-3": "1.0",
              "5.0e-3": "1.0", ", fields = 'points'": ""}  # fmt: skip
    for word, value in (steady | words).items():
        deck = deck.replace(word, value)
    return deck


def judge_modes(case: Case) -> None:
    """Judge frequencies of a cube on its base, and effective masses of all its modes together.

    Two modes are nearly one frequency: round-off turns them in their plane, which moves mass
    between them.
    """
    words = {"MESH": "hex20.h5", "MATERIAL": CLASSICAL, "ELEMENT": "hex20",
             "ANALYSIS": "kind = 'modal', modes = 8"}  # fmt: skip
    found = {}
    for ranks in (0, 2, 3):
        (case.folder / f"modes_{ranks}.nml").write_text(steady_deck(case, words))
        case.run("talus-fem", f"modes_{ranks}.nml", ranks=ranks)
        found[ranks] = read_history(case.folder / f"modes_{ranks}_modes.csv")
    case.above("modes: lowest frequency [Hz]", found[0]["frequency"][0], 1.0)
    for ranks in (2, 3):
        off = apart(found[0]["frequency"], found[ranks]["frequency"])
        case.below(f"modes: {ranks} ranks, frequencies, difference / largest",
                   off / extent(found[0]["frequency"]), SAME)  # fmt: skip
        pair = (found[0], found[ranks])
        one, several = (np.array([m[f"mass {c}"].sum() for c in "xyz"]) for m in pair)
        case.below(f"modes: {ranks} ranks, masses, difference / largest",
                   apart(one, several) / extent(one), SAME)  # fmt: skip


def response(case: Case, stem: str) -> dict[str, np.ndarray]:
    """Return complex motions and reactions of a harmonic response by column."""
    table = read_history(case.folder / f"{stem}_harmonic.csv")
    return {name: table[name] * np.exp(1j * table[f"{name} phase"])
            for name in table if f"{name} phase" in table}  # fmt: skip


def judge_harmonic(case: Case) -> None:
    """Judge steady responses: damped and absorbing on springs, and with micro-rotations."""
    pull = "&traction group = 'side', value = 2.0e4, 1.0e4, 0.0 /\n"
    analysis = ("kind = 'harmonic', frequencies = 5.0, 20.0, 60.0, loss_factor = 0.05, "
                "response = 'top'")  # fmt: skip
    kinds = {
        "harmonic": ("hex20.h5", CLASSICAL, "hex20", pull + SPRINGS + ABSORBING,
                     analysis + RAYLEIGH),
        "harmonic_polar": ("hex20.h5", POLAR, "hex20/hex8", pull, analysis),
    }  # fmt: skip
    for name, (mesh, material, element, more, kind) in kinds.items():
        words = {"MESH": mesh, "MATERIAL": material, "ELEMENT": element, "ANALYSIS": kind}
        found = {}
        for ranks in (0, 2, 3):
            stem = f"{name}_{ranks}"
            (case.folder / f"{stem}.nml").write_text(steady_deck(case, words, more))
            case.run("talus-fem", f"{stem}.nml", ranks=ranks)
            found[ranks] = response(case, stem)
        lag = max(np.abs(np.angle(v[np.abs(v) > 0.1 * np.abs(v).max()])).max()
                  for v in found[0].values() if np.abs(v).max() > 0.0)  # fmt: skip
        case.above(f"{name}: largest phase [rad]", float(lag), 0.1, "real parts are not all")
        for ranks in (2, 3):
            worst = 0.0
            for what in ("force ", ""):
                names = [n for n in found[0] if ("force " in n) == bool(what)]
                largest = max(np.abs(found[0][n]).max() for n in names)
                worst = max(worst, *(np.abs(found[ranks][n] - found[0][n]).max() / largest
                                     for n in names))  # fmt: skip
            case.below(f"{name}: {ranks} ranks, difference / largest", float(worst), SAME)


def judge_faults(case: Case) -> None:
    """Judge a fault that one rank meets, and a rank that is killed."""
    write_deck(case, "inverted", "inverted")
    deck = case.folder / "inverted.nml"
    deck.write_text(deck.read_text().replace("scale = 1.0e-4", "scale = -300.0"))
    done = case.run("talus-fem", "inverted.nml", ranks=3, expect=2)
    case.metric("an element inside out: messages", float(done.stderr.count("error N31")), 1.0, 0)
    write_deck(case, "one_point", "killed")
    deck = case.folder / "killed.nml"
    deck.write_text(deck.read_text().replace("t_end = 0.01", "t_end = 1.0e4"))
    command = [*launcher(3), str(case.bin("talus-fem")), "killed.nml"]
    environment = dict(os.environ, OMP_NUM_THREADS="1")
    run = subprocess.Popen(command, cwd=case.folder, env=environment, stdout=subprocess.DEVNULL,
                           stderr=subprocess.DEVNULL)  # fmt: skip
    ranks: list[int] = []
    while len(ranks) < 3 or not (case.folder / "killed.chk.h5").exists():
        time.sleep(0.05)
        ranks = children(run.pid)
    os.kill(ranks[-1], signal.SIGKILL)
    case.above("a rank is killed: exit code", float(run.wait(timeout=60.0)), 0.5)
    time.sleep(0.5)
    left = [pid for pid in ranks if is_alive(pid)]
    case.metric("a rank is killed: ranks that stay behind", float(len(left)), 0.0, 0)
    case.run("talus-fem", "killed.nml", "--restart=auto", "--check")
    case.above("a rank is killed: time of its last whole step [s]",
               field_steps(case.folder / "killed.h5")[-1].time, 0.0)  # fmt: skip


def children(pid: int) -> list[int]:
    """Return the processes that a process has started."""
    found = Path(f"/proc/{pid}/task/{pid}/children")
    return [int(child) for child in found.read_text().split()] if found.exists() else []


def is_alive(pid: int) -> bool:
    """Return whether a process runs; one that nobody has waited for does not."""
    status = Path(f"/proc/{pid}/stat")
    return status.exists() and status.read_text().rpartition(")")[2].split()[0] != "Z"


def run(case: Case) -> None:
    """Judge every analysis, restarts and faults; plot the differences."""
    write_meshes(case)
    fig, ax = case.figure()
    for place, name in enumerate(JUDGED):
        off = judge_ranks(case, name, (2, 3, 4) if place == 0 else (2, 3 + place % 2))
        ax.semilogy([place] * len(off), np.maximum(off, 1e-17), "o", mfc="none", color="C0")
    ax.axhline(SAME, color="k", lw=1, label="limit")
    ax.set_xticks(range(len(JUDGED)), JUDGED, fontsize="small")
    ax.set(xlabel="analysis", ylabel="difference to one rank / largest [-]")
    ax.legend()
    judge_restart(case, "plastic", 2, 0)
    judge_restart(case, "plastic", 0, 3)
    judge_restart(case, "explicit", 2, 3)
    judge_restart(case, "stages", 2, 3)
    judge_modes(case)
    judge_harmonic(case)
    judge_faults(case)
    case.save(fig)
