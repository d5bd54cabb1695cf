"""A stream of grains that fall freely from a source to a sink: mass, momentum, energy."""

import numpy as np

from talus.compare import extent
from talus.verification import Case, field_steps, read_history

RATE, SPEED, ASIDE, GRAVITY = 0.02, 1.5, 0.2, 9.81  # [kg/s], [m/s], [m/s], [m/s2]
SPIN, DENSITY = 50.0, 2500.0  # [rad/s], [kg/m3]
AXES = np.array([1.2e-3, 1.0e-3, 0.8e-3])
HEIGHT, DEPTH = 0.505, 0.01  # mean height of entry over the sink, depth of the source [m]
INTERVALS = (4.0e-3, 2.0e-3)  # of source and sink [s]
FLIGHT = (np.sqrt(SPEED**2 + 2.0 * GRAVITY * HEIGHT) - SPEED) / GRAVITY


def run(case: Case) -> None:
    """Run with two intervals; judge the finer one against the stream, both against each other."""
    found = [stream(case, every) for every in INTERVALS]
    mass = RATE * FLIGHT
    grain = DENSITY * 4.0 / 3.0 * np.pi * AXES.prod() * 1.3**3
    fine = found[-1]
    # a grain may be due or not, and leaves up to an interval late: half of one in the mean
    late = RATE * INTERVALS[-1]
    case.metric("mass aloft [kg]", fine["aloft"], mass + 0.5 * late, grain + 0.5 * late)
    case.metric("mass that has entered / rate x time", fine["entered"] / RATE, 1.0, grain / RATE)
    case.metric("speed of what leaves / that of free fall", fine["speed"], 1.0, 0.005,
                "half an interval late, gravity adds 0.003")  # fmt: skip
    case.metric("momentum aside of what leaves / mass", fine["aside"], ASIDE, 1e-12)
    case.below("entered, gravity's work, left and kinetic energy, relative", fine["booked"], 1e-7,
               "the steps' own error of spinning ellipsoids")  # fmt: skip
    case.below("mass entered less left less aloft, relative", fine["balance"], 1e-12)
    case.below("closure of the ledger, relative", fine["closure"], 1e-8,
               "the steps' own error of spinning ellipsoids")  # fmt: skip
    early = [item["aloft"] - mass for item in found]
    case.metric("mass aloft too much, interval doubled", early[0] / early[1], 2.0, 0.8)
    draw(case, found)


def stream(case: Case, every: float) -> dict:
    """Run with an interval of source and sink; return what is judged."""
    text = (case.folder / "stream.nml").read_text().replace("EVERY", f"{every:.1e}")
    name = f"stream_{1e3 * every:.0f}ms"
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-dem", f"{name}.nml", "--threads=1")
    fed = read_history(case.folder / f"{name}_sources.csv")
    gone = read_history(case.folder / f"{name}_sinks.csv")
    energy = read_history(case.folder / f"{name}_energy.csv")
    last = field_steps(case.folder / f"{name}.h5")[-1].grains
    steady = fed["time"] > 2.0 * FLIGHT
    first = int(np.argmax(gone["time"] > 2.0 * FLIGHT))
    passed = gone["mass"][-1] - gone["mass"][first]
    down = -(gone["momentum_z"][-1] - gone["momentum_z"][first]) / passed
    aloft = fed["mass"] - gone["mass"]
    own = DENSITY * 4.0 / 3.0 * np.pi * last["axes"].prod(1).sum()
    # each grain brings m/2 v2 and I/2 w2 about its own axes, turned at random
    booked = max(extent(energy["entered"] - fed["energy"]), extent(energy["left"] - gone["energy"]))
    stored = energy["entered"] + energy["gravity"] - energy["left"] - energy["kinetic"]
    scale = energy["entered"][-1]
    return {
        "every": every, "time": fed["time"], "curve": aloft, "gone": gone["mass"],
        "aloft": float(aloft[steady].mean()), "entered": float(fed["mass"][-1] / fed["time"][-1]),
        "speed": float(down / np.sqrt(SPEED**2 + 2.0 * GRAVITY * HEIGHT)),
        "aside": float(gone["momentum_x"][-1] / gone["mass"][-1]),
        "booked": max(booked, extent(stored)) / scale,
        "balance": abs(aloft[-1] - own) / own,
        "closure": extent(energy["closure_error"]) / scale,
    }  # fmt: skip


def draw(case: Case, found: list[dict]) -> None:
    """Mass aloft and what has left over time."""
    fig, (ax, ax2) = case.figure(ncols=2, figsize=(9.5, 4.2))
    t = np.linspace(0.0, 1.0, 200)
    ax.plot(t, 1e3 * RATE * np.minimum(t, FLIGHT), "k", lw=1.0, label="rate x time of flight")
    ax2.plot(t, 1e3 * RATE * np.maximum(t - FLIGHT, 0.0), "k", lw=1.0, label="steady stream")
    for k, item in enumerate(found):
        label = f"every {1e3 * item['every']:.0f} ms"
        ax.plot(item["time"], 1e3 * item["curve"], "os"[k], ms=3, mfc="none", label=label)
        ax2.plot(item["time"], 1e3 * item["gone"], "os"[k], ms=3, mfc="none", label=label)
    ax.set(xlabel="time [s]", ylabel="mass aloft [g]")
    ax2.set(xlabel="time [s]", ylabel="mass that has left [g]")
    ax.legend(fontsize=8)
    ax2.legend(fontsize=8)
    case.save(fig)
