"""A grain rebounds from a plate that another program moves: contact and spring in series."""

import sys
import tomllib

import numpy as np
from coupled import audit_of, write_deck

from talus.verification import Case, write_packing

RADIUS, SPEED, CONTACT = 5.0e-3, 1.0, 1.0e5
MASS = 2650.0 * 4 / 3 * np.pi * RADIUS**3
EXCHANGES = (8.0e-6, 4.0e-6)


def run(case: Case) -> None:
    """Compare force, time of contact and rebound with the closed form."""
    spring = tomllib.loads((case.folder / "plate.toml").read_text())["stiffness"]
    series = CONTACT * spring / (CONTACT + spring)
    omega = np.sqrt(series / MASS)
    start = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2 * RADIUS + 2.0e-5]])
    write_packing(
        case.folder / "pack.h5", start, np.full((2, 3), RADIUS), kind=np.array([1, 0]),
        v=np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -SPEED]]), groups={"ghost": np.array([1])},
    )  # fmt: skip
    force, energy = [], []
    fig, ax = case.figure()
    for exchange in EXCHANGES:
        name = f"coupled_{1e6 * exchange:.0f}"
        command = f"{sys.executable} partner.py"
        deck = write_deck(case, f"{name}.nml", "coupled.nml", command=command, exchange=exchange)
        case.run("talus-couple", deck)
        audit = audit_of(case, name)
        push = -audit["force_on_solid_z"]
        force.append(push.max() / (SPEED * np.sqrt(MASS * series)))
        energy.append(audit["grains_kinetic"][-1] / (0.5 * MASS * SPEED**2))
        ax.plot(1e6 * audit["time"], push, ".", label=f"Talus, exchange {1e6 * exchange:.0f} µs")
    t = np.linspace(0.0, 6.0e-4, 400)
    phase = omega * (t - 2.0e-5 / SPEED)
    exact = SPEED * np.sqrt(MASS * series) * np.sin(np.clip(phase, 0.0, np.pi))
    ax.plot(1e6 * t, exact, "k-", label="exact")
    ax.set(xlabel="time [µs]", ylabel="force on the plate [N]")
    ax.legend()
    case.save(fig)
    # the plate follows the mean force of an exchange, tau = exchange/2 late: a sine of force loses
    # thereby pi omega tau k'/K of its energy, and half as much of its amplitude
    loss = 0.5 * np.pi * omega * np.array(EXCHANGES) * series / spring
    second = (omega * np.array(EXCHANGES)) ** 2 * series / spring
    for k, exchange in enumerate(EXCHANGES):
        label = f"exchange {1e6 * exchange:.0f} µs: "
        case.metric(f"{label}energy after the contact", energy[k], 1.0 - loss[k], second[k],
                    "second order of the lag")  # fmt: skip
        case.metric(f"{label}largest force over v √(m k')", force[k], 1.0, 0.5 * loss[k],
                    "the amplitude's share of the loss")  # fmt: skip
    order = np.log2((1.0 - energy[0]) / (1.0 - energy[1]))
    case.metric("observed order of the loss", order, 1.0, 0.1, "first order in the exchange")
    log = (case.folder / f"{name}.log").read_text()
    noted = float("warning: plate" in log and "has version 1.0 of another make" in log)
    case.metric("version of the plate in a warning", noted, 1.0, 0.0, "it is no fault")
