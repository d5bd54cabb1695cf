"""What a user should know of a tile or column; a run of one step tells the forces of contacts."""

import tempfile
from pathlib import Path

import numpy as np

from talus.column import DECK, SURCHARGE
from talus.column_measure import bearing, inner_rows, weight_stress
from talus.column_stamp import ColumnStamp
from talus.faults import FaultError
from talus.forms import volumes
from talus.packing import FREE, Packing, write_h5
from talus.tile import CHECK, run_deck
from talus.tile_stamp import (
    STRESS_ERROR,
    Forces,
    Stamp,
    anisotropy_of,
    check_images,
    forces_of,
    listed,
    rows_of,
    solid_fraction,
)
from talus.verification import field_steps

ONE_STEP = 1.0e-12  # [s]


def forces_now(packing: Packing, stamp: Stamp | ColumnStamp) -> Forces:
    """Return the forces of the contacts of a packing, from a run of one step (E519)."""
    load, gravity = "", 0.0
    if isinstance(stamp, ColumnStamp):
        gravity = stamp.gravity
        load = SURCHARGE.format(stress=float(stamp.surcharge)) if stamp.surcharge else ""
    text = DECK.format(
        name="check", t_end=ONE_STEP, every=ONE_STEP, source="packing.h5", stage=load + CHECK,
        density=float(stamp.density), young=float(stamp.young), poisson=float(stamp.poisson),
        friction=float(stamp.friction), down=-float(gravity),
        periodic="periodic = 'a', 'b' " if gravity else "",
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        write_h5(Path(folder) / "packing.h5", packing)
        run_deck(Path(folder), "check", text)
        return forces_of(packing, field_steps(Path(folder) / "check.h5")[0].contacts)


def tile_facts(tile: Packing, stamp: Stamp) -> dict[str, object]:
    """Return what a tile is; one that does not bear what its stamp tells is a fault (E519)."""
    check_images(tile)
    forces = forces_now(tile, stamp)
    stress = np.einsum("ki,kj->ij", forces.force, forces.branch) / np.linalg.det(tile.cell)
    mean = np.trace(stress) / 3.0
    if np.abs(stress - stamp.stress).max() > STRESS_ERROR * mean:
        text = f"the contacts bear the normal stresses {listed(np.diag(stress))} Pa, the stamp"
        text += f" tells {listed(np.diag(stamp.stress))}"
        raise FaultError("E519", text, "make the tile again: talus pack tile")
    return {
        "solid fraction": solid_fraction(tile),
        "mean diameter [m]": stamp.mean_diameter,
        "edges [m]": np.linalg.norm(tile.cell, axis=1),
        "mean stress [Pa]": mean,
        "normal stresses over the mean": np.diag(stress) / mean,
        "shear stresses xy, xz, yz over the mean": stress[[0, 0, 1], [1, 2, 2]] / mean,
        "anisotropy of the stress": anisotropy_of(stress),
    } | contact_facts(tile, forces, 0.0)


def contact_facts(packing: Packing, forces: Forces, weight: float) -> dict[str, object]:
    """Return what contacts tell; weight of the grains [N/m3]."""
    rows = rows_of(packing, packing.pairs)
    size = packing.axes.min(axis=1)[rows].min(axis=1)
    fabric = np.einsum("ki,kj->ij", forces.normal, forces.normal) / len(forces.normal)
    part = 7.5 * (fabric - np.eye(3) / 3.0)  # of the density (1 + a:nn)/(4 pi) of normals
    free, inner = packing.kind == FREE, bearing(packing)
    number = np.bincount(rows.ravel(), minlength=packing.count)
    along = np.abs((forces.force * forces.normal).sum(axis=1))
    return {
        "coordination number": number[free].mean(),
        "of grains that bear": number[inner].mean(),
        "grains that bear nothing": 1.0 - inner.sum() / free.sum(),
        "fabric xx, yy, zz": np.diag(fabric),
        "anisotropy of the fabric": np.sqrt(1.5 * (part * part).sum()),
        "largest overlap over the least semi-axis": (forces.overlap / size).max(),
        "mean normal force [N]": along.mean(),
        "unbalanced over mean contact force": unbalanced(packing, forces, weight),
    }


def unbalanced(packing: Packing, forces: Forces, weight: float) -> float:
    """Mean force left on a free grain over the mean force of contacts; weight [N/m3]."""
    rows = rows_of(packing, packing.pairs)
    left = np.zeros((packing.count, 3))
    np.add.at(left, rows[:, 1], forces.force)
    np.add.at(left, rows[:, 0], -forces.force)
    left[:, 2] -= weight_of(packing, weight) + packing.surcharge
    size = np.linalg.norm(left[packing.kind == FREE], axis=1).mean()
    return float(size / np.linalg.norm(forces.force, axis=1).mean())


def weight_of(packing: Packing, weight: float) -> np.ndarray:
    """Weight of each grain [N], of weight [N/m3]."""
    return weight * volumes(packing.axes, packing.skew, packing.exponent)


def column_facts(column: Packing, stamp: ColumnStamp) -> dict[str, object]:
    """Return what a column is, lists from the lowest slice up."""
    forces = forces_now(column, stamp)
    weight = stamp.density * stamp.gravity
    vertical = stamp.stress[:, 2, 2]
    middle = 0.5 * (stamp.z[1:] + stamp.z[:-1])
    balance = weight_stress(column, stamp.z, weight, stamp.surcharge)
    even = stamp.surcharge + weight * stamp.solid_fraction * (stamp.height - middle)
    inner = inner_rows(column, stamp.height)
    return {
        "layers": stamp.layers,
        "grains of the tile": stamp.rows,
        "bearing grains": len(inner),
        "95 of 100 inner grains moved less than [d]": stamp.way,
        "slices, middle [m]": middle,
        "vertical stress [Pa]": vertical,
        "over density x depth + surcharge": vertical / even,
        "over the weight above + surcharge": vertical / balance,
        "lateral over vertical stress": stamp.stress[:, [0, 1], [0, 1]].mean(axis=1) / vertical,
        "of the replays, at borders of layers": stamp.replayed[:, :2].mean(axis=1)
        / stamp.replayed[:, 2],
    } | contact_facts(column, forces, weight)
