"""Triangular wave of the end of a bar under a step load."""

import numpy as np

from talus import mesh as meshes
from talus.verification import Case, field_steps, read_history

YOUNG, DENSITY, LENGTH, TRACTION = 302.4, 1.89e-9, 5.0, -1.512
PERIOD = 4.0 * LENGTH / np.sqrt(YOUNG / DENSITY)


def triangle(time: np.ndarray) -> np.ndarray:
    """0 at 0 and T, 1 at T/2."""
    phase = np.mod(time / PERIOD, 1.0)
    return 1.0 - np.abs(2.0 * phase - 1.0)


def run(case: Case) -> None:
    """Judge the end displacement; plot it."""
    mesh = meshes.box(np.zeros(3), np.array([0.5, 0.5, LENGTH]), (1, 1, 80))
    meshes.write_mesh(case.folder / "bar.h5", mesh)
    case.run("talus-fem", "deck.nml")
    steps = field_steps(case.folder / "deck.h5")
    time = np.array([s.time for s in steps])
    end = np.array([s.solid["u"][mesh.x[:, 2] > LENGTH - 1e-9, 2].mean() for s in steps])
    full = 2.0 * TRACTION * LENGTH / YOUNG
    for share in (8, 4, 2):
        value = np.interp(PERIOD / share, time, end) / full
        case.metric(
            f"u(T/{share}) / (2 P L / E A)",
            float(value),
            float(triangle(np.array(PERIOD / share))),
            0.01,
        )
    case.metric("period / (4 L/c)", float(time[np.argmin(end)] * 2.0 / PERIOD), 1.0, 0.02)
    energy = read_history(case.folder / "deck_energy.csv")
    error = float(abs(energy["closure"]).max() / abs(energy["load"]).max())
    case.below("ledger, error / largest work", error, 1e-10)
    fig, ax = case.figure()
    ax.plot(1e6 * time, triangle(time) * full, "-", label="exact")
    ax.plot(1e6 * time[::4], end[::4], "o", ms=4, label="Talus")
    ax.set(xlabel="time [µs]", ylabel="end displacement [mm]")
    ax.legend()
    case.save(fig)
