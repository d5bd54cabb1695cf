"""Pure bending of a beam one cube thick, by several coefficients of the hourglass control."""

import numpy as np
from solid import save

from talus.mesh import box
from talus.verification import Case, field_steps, read_history

YOUNG, H, CELLS, FORCE, PULL = 1.0e7, 0.1, 20, 0.5, 3.0
LENGTH = CELLS * H
SHARES = (0.02, 0.05, 1.0 / 9.0, 0.2, 0.5)


def loads(mesh) -> str:
    """Deck lines of the couple (x forces +F above, -F below) and of the pull at the end."""
    lines = []
    for n in np.flatnonzero(np.isclose(mesh.x[:, 0], LENGTH)):
        force = FORCE * (1.0 if mesh.x[n, 2] > H / 2 else -1.0) + PULL / 4.0
        lines.append(f"&point_load node = {n + 1}, force = {force!r}, 0.0, 0.0 /")
    return "\n".join(lines)


def solve(case: Case, mesh, share, run: str, analysis: str, name: str) -> tuple[float, float]:
    """Run one coefficient; return deflection and stretch of the end [m]."""
    text = (case.folder / "deck.nml").read_text()
    words = {"RUN": run, "SHARE": repr(share), "LOADS": loads(mesh), "ANALYSIS": analysis}
    for word, value in words.items():
        text = text.replace(word, value)
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")
    u = field_steps(case.folder / f"{name}.h5")[-1].solid["u"]
    end = np.isclose(mesh.x[:, 0], LENGTH)
    return float(u[end, 2].mean()), float(u[end, 0].mean())


def run(case: Case) -> None:
    """Judge deflection and stretch of all coefficients; plot the deflections."""
    mesh = box(np.zeros(3), np.array([LENGTH, H, H]), (CELLS, 1, 1))
    save(mesh, case.folder / "beam.h5")
    couple = 2.0 * FORCE * H
    exact = -couple * LENGTH**2 / (2.0 * YOUNG * H**4 / 12.0)
    stretch = PULL * LENGTH / (YOUNG * H**2)
    found = []
    for k, share in enumerate(SHARES):
        deflection, pulled = solve(case, mesh, share, "", "kind = 'static'", f"share{k}")
        found.append(deflection / exact)
        case.metric(
            f"coefficient {share:.3g}: deflection / exact bending",
            deflection / exact,
            1.0 / (9.0 * share),
            1e-9 / share,
        )
        case.metric(f"coefficient {share:.3g}: stretch / exact", pulled / stretch, 1.0, 1e-9)
    settle = "kind = 'explicit', rayleigh_mass = 5.0"
    deflection, _ = solve(case, mesh, 1.0 / 9.0, ", t_end = 8.0", settle, "explicit")
    case.metric("explicit, at rest: deflection / exact bending", deflection / exact, 1.0, 1e-6)
    energy = read_history(case.folder / "explicit_energy.csv")
    error = float(abs(energy["closure"]).max() / abs(energy["load"]).max())
    case.below("explicit: ledger, error / work of the loads", error, 1e-9)
    fig, ax = case.figure()
    line = np.linspace(0.018, 0.55, 200)
    ax.loglog(line, 1.0 / (9.0 * line), "-", label="1/(9 coefficient)")
    ax.loglog(SHARES, found, "o", label="Talus")
    ax.axhline(1.0, color="k", lw=0.8, ls=":", label="exact bending")
    ax.set(xlabel="hourglass coefficient [-]", ylabel="deflection / exact bending [-]")
    ax.legend()
    case.save(fig)
