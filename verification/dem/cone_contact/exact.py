"""Overlap and force of grains on a cone penetrometer against closed forms and a search."""

import numpy as np

from talus.measure import rotations
from talus.verification import Case, field_steps, read_history, write_packing

RADIUS, HALF, GRAIN, DEPTH = 0.01, np.pi / 6.0, 2.0e-3, 4.0e-6
HEIGHT = RADIUS / np.tan(HALF)
E_STAR = 1.0 / ((1 - 0.25**2) / 29.0e9 + (1 - 0.3**2) / 210.0e9)
AXES = np.array([2.5e-3, 2.0e-3, 1.5e-3])


def around(angle: float) -> np.ndarray:
    """Return the direction from the axis at an angle."""
    return np.array([np.cos(angle), np.sin(angle), 0.0])


def spheres() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return centres (n, 3), distances of the contacts from the axis and |normal across axis|."""
    x, wide, across = [], [], []
    reach = GRAIN - DEPTH
    for angle, along in ((0.3, 0.25), (1.4, 0.5), (2.5, 0.9)):  # flank, parts of its height
        e = around(angle)
        n = np.cos(HALF) * e - np.sin(HALF) * np.array([0.0, 0.0, 1.0])
        foot = along * HEIGHT * (np.tan(HALF) * e + [0.0, 0.0, 1.0])
        x.append(foot + reach * n)
        wide.append(along * RADIUS)
        across.append(np.cos(HALF))
    for angle, tilt in ((3.6, 0.2), (4.4, 0.45)):  # shoulder
        e = around(angle)
        n = np.cos(tilt) * e - np.sin(tilt) * np.array([0.0, 0.0, 1.0])
        x.append(RADIUS * e + [0.0, 0.0, HEIGHT] + reach * n)
        wide.append(RADIUS)
        across.append(np.cos(tilt))
    for angle, z in ((0.0, 0.01), (2.0, 0.02)):  # shaft
        x.append((RADIUS + reach) * around(angle) + [0.0, 0.0, HEIGHT + z])
        wide.append(RADIUS)
        across.append(1.0)
    n = np.array([0.3, 0.1, -0.95]) / np.linalg.norm([0.3, 0.1, -0.95])  # tip
    x.append(reach * n)
    wide.append(0.0)
    across.append(np.hypot(n[0], n[1]))
    return np.array(x), np.array(wide), np.array(across)


def support(shape: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the supports of an ellipsoid (shape matrix) along normals (n, 3)."""
    return np.sqrt(np.einsum("ni,ij,nj->n", normals, shape, normals))


def searched(x: np.ndarray, shape: np.ndarray, sine: float, base: np.ndarray, less: float) -> float:
    """Return the largest r.n - less - h(n) over normals on a circle, by ever finer search."""
    low, high = 0.0, 2.0 * np.pi
    for _ in range(12):
        angle = np.linspace(low, high, 2001)
        n = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], -1)
        n = np.sqrt(1.0 - sine**2) * n - sine * np.array([0.0, 0.0, 1.0])
        value = n @ (x - base) - less - support(shape, n)
        best = angle[np.argmax(value)]
        low, high = best - (high - low) / 200.0, best + (high - low) / 200.0
    return float(value.max())


def judge_spheres(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Judge forces of spheres on all parts; return distances from the axis and relative errors."""
    x, wide, across = spheres()
    write_packing(case.folder / "pack.h5", x, np.full((len(x), 3), GRAIN))
    case.run("talus-dem", "deck.nml")
    force = field_steps(case.folder / "deck.h5")[0].grains["force"]
    effective = 1.0 / (1.0 / GRAIN + 0.5 * across / np.maximum(wide, GRAIN))
    exact = 4.0 / 3.0 * E_STAR * np.sqrt(effective) * DEPTH**1.5
    error = np.linalg.norm(force, axis=1) / exact - 1.0
    for name, rows in {"cone": [0, 1, 2], "shoulder": [3, 4], "shaft": [5, 6], "tip": [7]}.items():
        case.below(f"sphere on the {name}: force off Hertz", np.abs(error[rows]).max(), 1e-9)
    rows = read_history(case.folder / "deck_surfaces.csv")
    parts = np.stack([rows[f"force_{c}"][:3] for c in "xyz"], -1)
    wanted = [-force[7:].sum(0), -force[:5].sum(0), -force[5:7].sum(0)]
    off = np.linalg.norm(parts - wanted) / np.linalg.norm(wanted)
    case.below("forces of tip, cone and shaft off the grains'", off, 1e-14)
    moment = np.stack([rows[f"moment_{c}"][:3] for c in "xyz"], -1).sum(0)
    torque = np.abs(moment[2]) / np.linalg.norm(parts, axis=1).sum() / RADIUS
    case.below("moment about the axis / (force x radius)", torque, 1e-14)
    return np.array(wide), error


def judge_ellipsoids(case: Case) -> np.ndarray:
    """Judge the overlaps of turned ellipsoids on cone and shaft against a search [m]."""
    rng = np.random.default_rng(3)
    count = 24
    quat = rng.normal(size=(count, 4))
    quat /= np.linalg.norm(quat, axis=1)[:, None]
    turn = rotations(quat)
    shape = np.einsum("nij,j,nkj->nik", turn, AXES**2, turn)
    x, wanted = [], []
    for k in range(count):
        e = around(2.0 * np.pi * (k % 8) / 8.0 + 0.1)
        flank = k < 8
        sine = np.sin(HALF) if flank else 0.0
        less = 0.0 if flank else RADIUS
        z = 0.55 * HEIGHT if flank else HEIGHT + 8.0e-3 + 8.0e-3 * (k // 8)
        n = np.sqrt(1.0 - sine**2) * e - sine * np.array([0.0, 0.0, 1.0])
        place = (z * np.tan(HALF) if flank else RADIUS) * e + [0.0, 0.0, z]
        place = place + n * (support(shape[k], n[None])[0])
        gap = searched(place, shape[k], sine, np.zeros(3), less)
        place = place - n * (gap + 5.0e-6)
        x.append(place)
        wanted.append(-searched(place, shape[k], sine, np.zeros(3), less))
    write_packing(case.folder / "pack.h5", np.array(x), np.tile(AXES, (count, 1)), quat=quat)
    case.run("talus-dem", "deck.nml")
    step = field_steps(case.folder / "deck.h5")[0]
    overlap = np.zeros(count)
    tool = step.contacts["ids"][:, 0] < 0
    overlap[step.contacts["ids"][tool, 1] - 1] = step.contacts["overlap"][tool]
    case.metric("contacts of ellipsoids with the tool", float(tool.sum()), float(count), 0.0)
    error = overlap - np.array(wanted)
    case.below("ellipsoids: overlap off the search / size", np.abs(error).max() / AXES[0], 1e-12)
    return error


def run(case: Case) -> None:
    """Judge spheres and ellipsoids; plot the errors of both."""
    wide, error = judge_spheres(case)
    off = judge_ellipsoids(case)
    fig, axes = case.figure(ncols=2, figsize=(9.0, 3.6))
    axes[0].plot(1e3 * wide, error, "o")
    axes[0].set(xlabel="distance of the contact from the axis [mm]", ylabel="force / exact - 1 [-]")
    axes[1].plot(np.arange(1, len(off) + 1), off / AXES[0], "o")
    axes[1].set(xlabel="ellipsoid [-]", ylabel="overlap off the search / size [-]")
    case.save(fig)
