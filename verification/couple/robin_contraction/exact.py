"""Settling of the exchange where contacts are much stiffer than the facet they press on."""

import json
from pathlib import Path

import numpy as np
from coupled import audit_of, write_box, write_deck

from talus.mesh import read_mesh
from talus.verification import Case, field_steps, write_packing

RADIUS, SQUEEZE, RATIO = 5.0e-3, 2.0e-5, 50.0
WAY, TOUCH, EXCHANGES = 1.0e-7, 10, 260  # of the lid in an exchange [m], when it touches, end
ACROSS = 0.02  # half-axes of the flat ghost in the plane [m]


def run(case: Case) -> None:
    """Measure the facet's stiffness, couple with every interface, compare with the equilibrium."""
    write_box(case.folder / "block.h5", [-0.03, -0.03, -0.02], [0.03, 0.03, 0.0], (3, 3, 2))
    case.run("talus-fem", "probe.nml")
    with_load = field_steps(case.folder / "probe.h5")[-1].solid["u"][:, 2]
    facet = -1.0 / np.mean(with_load[middle_of_top(case.folder / "block.h5")])
    series = RATIO * facet
    x = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2 * RADIUS - SQUEEZE / 2]])
    axes = np.array([[ACROSS, ACROSS, RADIUS], [RADIUS] * 3])
    write_packing(
        case.folder / "pack.h5", x, axes, kind=np.array([1, 0]), groups={"ghosts": np.array([1])}
    )
    lid = 3 * RADIUS - SQUEEZE
    write_deck(case, "grains_at_work.nml", "grains.nml", stiffness=2 * series, lid=lid, motion="")
    mass = 2650.0 * 4 / 3 * np.pi * RADIUS**3
    exchange = 400.0 * 0.3 * np.sqrt(mass / series)  # the sphere comes to rest in each
    exact = SQUEEZE * series / (facet + series)
    fig, ax = case.figure()
    for name, scheme, more in (
        ("springs", "average", ""),
        ("aitken", "iterated", ", theta = 0.02"),
        ("theta", "average", ", theta = 0.02"),
        ("none", "average", ""),
        ("aitken", "average", ""),
    ):
        values = {
            "grains": "grains_at_work",
            "interface": name,
            "scheme": scheme,
            "pieces": 1,
            "exchange": exchange,
            "end": 60 * exchange,
            "more": more,
        }
        stem = f"{name}_{scheme}"
        case.run("talus-couple", write_deck(case, f"{stem}.nml", "coupled.nml", **values))
        audit = audit_of(case, stem)
        moved = audit["largest_ghost_displacement"]
        health = json.loads((case.folder / f"{stem}_summary.json").read_text())["health"]
        if (name, scheme) == ("aitken", "average"):
            told = "limit cycle" in (case.folder / f"{stem}.log").read_text()
            case.metric("aitken, average: the limit cycle is told", float(told), 1.0, 0.0, "log")
            case.above("aitken, average: force lag", health["force_lag"], 0.1, "summary")
            continue
        if name == "none":
            swing = np.ptp(moved[-20:]) / exact
            case.above("none: swing of the last 20 exchanges", swing, 0.5, "does not settle")
        else:
            case.metric(
                f"{name}: displacement / exact", moved[-1] / exact, 1.0, 1e-3, "60 exchanges"
            )
            stalls = health["windows_not_settled"]
            case.metric(f"{name}: windows that did not settle", stalls, 0, 0, "no false alarm")
        ax.plot(np.arange(1, len(moved) + 1), moved / exact, "o", label=f"Talus, {name}, {scheme}")
    ax.axhline(1.0, label="exact")
    ax.set(xlabel="exchange [-]", ylabel="displacement / exact [-]", ylim=(0.0, 3.0))
    ax.legend()
    case.save(fig)
    growing(case, series, facet, exchange)


def growing(case: Case, series: float, facet: float, exchange: float) -> None:
    """Let the lid come with a steady speed and press, with and without pieces."""
    write_deck(case, "grains_pressed.nml", "grains.nml", stiffness=2 * series,
               lid=3 * RADIUS + TOUCH * WAY,
               motion=f", velocity = 0.0, 0.0, {-WAY / exchange:.9g}")  # fmt: skip
    way = WAY * np.maximum(np.arange(1, EXCHANGES + 1) - TOUCH, 0.0)
    exact = way * series / (facet + series)
    after = np.arange(EXCHANGES) >= EXCHANGES // 2
    fig, (left, right) = case.figure(ncols=2)
    ran = {}
    for pieces in (1, 10):
        stem = f"pieces_{pieces}"
        values = {"grains": "grains_pressed", "interface": "springs", "scheme": "average",
                  "exchange": exchange, "end": EXCHANGES * exchange, "more": "",
                  "pieces": pieces}  # fmt: skip
        case.run("talus-couple", write_deck(case, f"{stem}.nml", "coupled.nml", **values))
        audit = audit_of(case, stem)
        off = (audit["largest_ghost_displacement"] - exact) / WAY
        lag = audit["force_lag"][after].mean()
        ran[pieces] = (lag, abs(off[after]).mean(), audit["pieces"].sum())
        left.semilogy(audit["force_lag"], label=f"Talus, pieces = {pieces}")
        right.plot(off, label=f"Talus, pieces = {pieces}")
    health = json.loads((case.folder / "pieces_10_summary.json").read_text())["health"]
    case.above("no pieces: mean force lag", ran[1][0], 0.1, "springs 50 times the facet")
    case.below("pieces: mean force lag", ran[10][0], 0.02, "the limit")
    case.metric("pieces: windows that did not settle", health["windows_not_settled"], 0, 0, "log")
    case.below("pieces: error of displacement / without", ran[10][1] / ran[1][1], 0.25, "exact")
    case.below("pieces: solutions / ten times the exchanges", ran[10][2] / (10.0 * EXCHANGES), 0.9,
               "pieces are made where they are due")  # fmt: skip
    left.axhline(0.02, color="0.5", label="limit")
    left.set(xlabel="exchange [-]", ylabel="force lag [-]", ylim=(1e-5, 2.0))
    right.set(xlabel="exchange [-]", ylabel="displacement - exact, in ways of an exchange [-]")
    left.legend()
    case.save(fig, "pieces.png")


def middle_of_top(path: Path) -> np.ndarray:
    """Nodes of the facet in the middle of the upper face."""
    x = read_mesh(path).x
    return np.flatnonzero((np.abs(x[:, :2]) < 0.011).all(axis=1) & (x[:, 2] > -1e-9))
