"""Momentum and energy of freely turning forms, with the inertia integrated by Gauss points."""

import numpy as np

from talus.compare import max_of
from talus.generate import random_quaternions
from talus.measure import rotations
from talus.packing import make_packing, write_h5
from talus.verification import Case, field_steps

AXES = np.array([[2.4e-3, 1.8e-3, 1.3e-3], [2.0e-3, 1.6e-3, 1.4e-3], [2.2e-3, 1.7e-3, 1.2e-3]])
SKEW = np.array([[0.35, -0.3, 0.25], [0.6, 0.5, -0.4], [0.0, 0.0, 0.0]])
EXPONENT = np.array([2.0, 2.0, 4.0])
POINTS = 40  # Gauss points an angle and octant


def inertia(axes: np.ndarray, skew: np.ndarray, exponent: float) -> np.ndarray:
    """Tensor (3, 3) per volume about the centre of mass, in the frame of the octants [m2].

    Over each octant by Gauss points in two angles; along a ray the powers of the radius integrate
    in closed form.
    """
    node, weight = np.polynomial.legendre.leggauss(POINTS)
    angle, weight = 0.25 * np.pi * (node + 1.0), 0.25 * np.pi * weight
    t, f = np.meshgrid(angle, angle, indexing="ij")
    part = (weight[:, None] * weight * np.sin(t)).ravel()
    n = np.stack([np.sin(t) * np.cos(f), np.sin(t) * np.sin(f), np.cos(t)], -1).reshape(-1, 3)
    second, first, volume = np.zeros((3, 3)), np.zeros(3), 0.0
    for signs in np.ndindex(2, 2, 2):
        side = 1.0 - 2.0 * np.array(signs)
        a = axes * (1.0 + side * skew)
        radius = ((n / a) ** exponent).sum(axis=1) ** (-1.0 / exponent)
        volume += (part * radius**3).sum() / 3.0
        first += (part * radius**4) @ (n * side) / 4.0
        second += np.einsum("k,ki,kj->ij", part * radius**5, n * side, n * side) / 5.0
    centre = first / volume
    second = second / volume - np.outer(centre, centre)
    return np.trace(second) * np.eye(3) - second


def run(case: Case) -> None:
    """Judge drifts of momentum and energy; plot them."""
    rng = np.random.default_rng(8)
    x = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]])
    omega = rng.normal(0.0, 800.0, (3, 3))
    packing = make_packing(x, AXES, random_quaternions(rng, 3), omega=omega)
    packing.skew, packing.exponent = SKEW, EXPONENT
    write_h5(case.folder / "pack.h5", packing)
    case.run("talus-dem", "deck.nml")
    steps = field_steps(case.folder / "deck.h5")
    time = np.array([step.time for step in steps])
    fig, ax = case.figure()
    for k in range(3):
        tensor = inertia(AXES[k], SKEW[k], EXPONENT[k])
        spin = np.array([step.grains["omega"][k] for step in steps])
        turn = rotations(np.array([step.grains["quat"][k] for step in steps]))
        body = np.einsum("nji,nj->ni", turn, spin)
        momentum = np.einsum("nij,jk,nk->ni", turn, tensor, body)
        energy = 0.5 * np.einsum("ni,ij,nj->n", body, tensor, body)
        drift = np.linalg.norm(momentum - momentum[0], axis=1) / np.linalg.norm(momentum[0])
        change = np.abs(energy / energy[0] - 1.0)
        wander = np.abs(body - body[0]).max() / np.linalg.norm(body[0])
        name = f"grain {k + 1}"
        case.below(f"{name}: drift of the angular momentum", float(drift.max()), 1e-9, "rounding")
        note = "second order in the step, bounded"
        case.below(f"{name}: change of the energy", float(change.max()), 1e-4, note)
        case.above(f"{name}: change of the spin in its frame", float(wander), 0.1, "it does tumble")
        ax.semilogy(time[1:], drift[1:], "-", label=f"{name}: angular momentum")
        ax.semilogy(time[1:], np.maximum(change[1:], 1e-16), "--", label=f"{name}: energy")
    moved = max_of(np.abs(step.grains["x"] - x).max() for step in steps)
    case.below("way of the centres of mass [m]", float(moved), 0.0)
    ax.set(xlabel="time [s]", ylabel="relative drift [-]")
    ax.legend(fontsize=8)
    case.save(fig)
