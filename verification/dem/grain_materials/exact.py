"""Spheres of several materials at rest on a plane, against Hertz."""

import numpy as np

from talus.packing import make_packing, read_packing, write_h5
from talus.verification import Case

RADIUS, G = 5.0e-3, 9.81
MATERIALS = {"usual": (2650.0, 1.0e6, 0.25), "heavy": (7800.0, 1.0e6, 0.25),
             "soft": (2650.0, 2.0e5, 0.4), "light": (300.0, 1.0e6, 0.0)}  # fmt: skip
#: Group 'some' has grains 2 to 4, the region 4 and 5, the ids 5 and 6: the last one counts.
EXPECTED = ["usual", "heavy", "heavy", "soft", "light", "light"]


def depth(name: str) -> float:
    """Return how deep a sphere of a material sinks into a plane of the usual one [m]."""
    density, *own = MATERIALS[name]
    weight = density * 4.0 / 3.0 * np.pi * RADIUS**3 * G
    compliance = sum((1.0 - nu**2) / young for young, nu in (own, MATERIALS["usual"][1:]))
    return float((0.75 * weight * compliance / np.sqrt(RADIUS)) ** (2.0 / 3.0))


def run(case: Case) -> None:
    """Let the spheres come to rest and compare how deep they are."""
    x = np.zeros((6, 3))
    x[:, 0] = 0.01 + 0.011 * np.arange(6)
    x[:, 2] = RADIUS - 1.0e-6
    row = make_packing(x, np.full((6, 3), RADIUS))
    row.groups = {"some": row.id[1:4]}
    write_h5(case.folder / "row.h5", row)
    case.run("talus-dem", "deck.nml", "--threads=1")
    made = read_packing(case.folder / "rest.h5")
    found = RADIUS - made.x[:, 2]
    exact = np.array([depth(name) for name in EXPECTED])
    for k, name in enumerate(EXPECTED):
        case.metric(f"overlap of grain {k + 1} ({name}) / Hertz", float(found[k] / exact[k]), 1.0,
                    1.0e-6, "unbalanced force at rest")  # fmt: skip
    fig, ax = case.figure()
    ax.bar(np.arange(1, 7), 1e6 * found, color="0.75", label="talus-dem")
    ax.plot(np.arange(1, 7), 1e6 * exact, "kx", label="Hertz")
    ax.set(xlabel="grain", ylabel="overlap [µm]")
    ax.set_xticks(range(1, 7), [f"{k + 1} {name}" for k, name in enumerate(EXPECTED)], rotation=30)
    ax.legend()
    case.save(fig)
