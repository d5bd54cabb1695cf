"""Stress wave in a confined bar whose end moves at a constant velocity."""

import numpy as np

from talus import mesh as meshes
from talus.verification import Case, field_steps, read_history

YOUNG, POISSON, DENSITY, LENGTH, VELOCITY = 1.0e8, 0.3, 2000.0, 10.0, 0.1
CONFINED = YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON))
SPEED = np.sqrt(CONFINED / DENSITY)
STRESS = -DENSITY * SPEED * VELOCITY
AREA = 0.01


def run(case: Case) -> None:
    """Judge plateau, front, reaction and ledger; plot the stress along the bar."""
    mesh = meshes.box(np.zeros(3), np.array([0.1, 0.1, LENGTH]), (1, 1, 200))
    meshes.write_mesh(case.folder / "bar.h5", mesh)
    case.run("talus-fem", "deck.nml")
    z = mesh.x[mesh.hex8].mean(axis=1)[:, 2]
    fig, ax = case.figure()
    for step in field_steps(case.folder / "deck.h5")[1:]:
        front = LENGTH - SPEED * step.time
        stress = step.solid["stress"][:, 2]
        behind = z > front + 0.1 * SPEED * step.time
        case.metric(
            f"t = {step.time:.2f} s: mean stress behind the front / (-rho c v)",
            float(stress[behind].mean() / STRESS),
            1.0,
            5e-3,
        )
        crossing = z[np.argmax(stress < 0.5 * STRESS)]
        case.metric(
            f"t = {step.time:.2f} s: distance of the front / (c t)",
            float((LENGTH - crossing) / (SPEED * step.time)),
            1.0,
            0.02,
            "half the plateau; elements of 50 mm",
        )
        ax.plot(z, np.where(z > front, STRESS, 0.0) / 1e3, "-", label=f"exact, {step.time:.2f} s")
        ax.plot(z, stress / 1e3, ".", ms=3, label="Talus")
    reaction = read_history(case.folder / "deck_reactions.csv")["z1 z"][1:] / (STRESS * AREA)
    half = len(reaction) // 2
    case.metric("reaction / (-rho c v A), second half", float(reaction[half:].mean()), 1.0, 5e-3)
    case.below("largest reaction / (-rho c v A)", float(np.abs(reaction).max()), 1.5)
    ledger = read_history(case.folder / "deck_energy.csv")
    case.below(
        "energy closure / work of the moved end",
        float(np.abs(ledger["closure"]).max() / ledger["support"].max()),
        1e-10,
    )
    ax.set(xlabel="position along the bar [m]", ylabel="axial stress [kPa]")
    ax.legend()
    case.save(fig)
