"""Pulses into an absorbing face: what comes back, and what the ledger says."""

import numpy as np
from solid import save

from talus.mesh import box
from talus.verification import Case, field_steps, read_history

YOUNG, POISSON, RHO, L, CELLS, PEAK, LENGTH = 50e6, 0.25, 1800.0, 20.0, 80, 1e4, 0.06
SHEAR = YOUNG / (2 * (1 + POISSON))
SPEED = {
    "p": np.sqrt(YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON)) / RHO),
    "s": np.sqrt(SHEAR / RHO),
}
KINDS = {"explicit": "kind = 'explicit'", "implicit": "kind = 'newmark', dt = 5.0e-4"}


def solve(case: Case, wave: str, kind: str, absorbing: bool) -> tuple[np.ndarray, np.ndarray, dict]:
    """Run one pulse; return times, velocity at mid-height and the ledger."""
    t = np.linspace(0.0, LENGTH, 61)
    words = {
        "ACROSS": "'x', 'y'" if wave == "p" else "'y', 'z'",
        "TIMES": ", ".join(f"{float(v)!r}" for v in t),
        "VALUES": ", ".join(f"{float(v)!r}" for v in np.sin(np.pi * t / LENGTH) ** 2),
        "VALUE": f"0.0, 0.0, {-PEAK!r}" if wave == "p" else f"{PEAK!r}, 0.0, 0.0",
        "ANALYSIS": KINDS[kind],
        "ABSORBING": "&absorbing group = 'z0' /" if absorbing else "",
    }
    text = (case.folder / "deck.nml").read_text()
    for word in ("VALUES", "TIMES", "VALUE", "ACROSS", "ANALYSIS", "ABSORBING"):
        text = text.replace(word, words[word])
    name = f"{wave}_{kind}" + ("" if absorbing else "_free")
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")
    steps = field_steps(case.folder / f"{name}.h5")
    middle = case.middle
    v = np.array([s.solid["v"][middle, 2 if wave == "p" else 0] for s in steps])
    return np.array([s.time for s in steps]), v, read_history(case.folder / f"{name}_energy.csv")


def run(case: Case) -> None:
    """Judge reflection, amplitude and energies of both waves and both integrations."""
    mesh = box(np.zeros(3), np.array([0.25, 0.25, L]), (1, 1, CELLS))
    save(mesh, case.folder / "column.h5")
    case.middle = int(np.flatnonzero(np.isclose(mesh.x[:, 2], L / 2))[0])
    fig, ax = case.figure()
    for wave, speed in SPEED.items():
        for kind in KINDS:
            t, v, energy = solve(case, wave, kind, True)
            back = t > (L / 2) / speed + LENGTH + 0.01
            peak = abs(v).max()
            case.below(
                f"{wave}, {kind}: reflected / incident", float(abs(v[back]).max() / peak), 1e-2
            )
            case.metric(
                f"{wave}, {kind}: rho c v / traction", float(RHO * speed * peak / PEAK), 1.0, 1e-2
            )
            scale = abs(energy["load"]).max()
            case.below(
                f"{wave}, {kind}: ledger, error / largest",
                float(abs(energy["closure"]).max() / scale),
                1e-9,
            )
            gone = float(energy["damping"][-1] / energy["load"][-1])
            case.metric(f"{wave}, {kind}: absorbed / put in", gone, 1.0, 1e-2)
            if kind == "explicit":
                ax.plot(t * 1e3, v * 1e3, "-", label=f"{wave} wave, absorbing")
    t, v, _ = solve(case, "p", "explicit", False)
    back = t > (L / 2) / SPEED["p"] + LENGTH + 0.01
    case.metric(
        "p, free end: reflected / incident",
        float(abs(v[back]).max() / abs(v[~back]).max()),
        1.0,
        2e-2,
    )
    ax.plot(t * 1e3, v * 1e3, "k:", lw=1, label="p wave, free end")
    ax.set(xlabel="time [ms]", ylabel="velocity at mid-height [mm/s]")
    ax.legend()
    case.save(fig)
