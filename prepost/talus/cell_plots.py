"""Figure of a strained cell: stress against strain, and its volume."""

from pathlib import Path

import numpy as np

from talus import histories
from talus.faults import FaultError
from talus.look import new_figure

KILO = 1.0e3
ENDING = "_cell"
NINE = [a + b for a in "xyz" for b in "xyz"]
STILL = 1.0e-3  # distortion below which volume is the strain


def tensors(rows: dict[str, np.ndarray], name: str) -> np.ndarray:
    """Return the rows of a tensor (n, 3, 3)."""
    return np.stack([rows[f"{name}_{part}"] for part in NINE], axis=-1).reshape(-1, 3, 3)


def distortion(deform: np.ndarray) -> np.ndarray:
    """Return the length of the path of shear, sum of sqrt(2 D:D) dt, from deformations (n, 3, 3).

    D is the deviatoric rate; in simple shear it is the shear.
    """
    steps = np.diff(deform, axis=0) @ np.linalg.inv(0.5 * (deform[1:] + deform[:-1]))
    rate = 0.5 * (steps + steps.transpose(0, 2, 1))
    rate -= np.trace(rate, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3.0
    return np.concatenate([[0.0], np.cumsum(np.sqrt(2.0 * (rate**2).sum(axis=(1, 2))))])


def figure(path: Path) -> object:
    """Pressure, shear stress and volume of a cell against its distortion, or against its volume."""
    rows = histories.read(path)
    if not rows["time"].size:
        raise FaultError("E545", f"{path} has no rows yet", "the run has written nothing")
    stress = tensors(rows, "stress")
    pressure = -np.trace(stress, axis1=1, axis2=2) / 3.0
    rest = 0.5 * (stress + stress.transpose(0, 2, 1)) + pressure[:, None, None] * np.eye(3)
    shear = np.sqrt(0.5 * (rest**2).sum(axis=(1, 2)))
    volume = np.log(rows["volume"] / rows["volume"][0])
    strain, label = distortion(tensors(rows, "deform")), "shear, path of the deviator [-]"
    if strain[-1] < STILL:
        strain, label = -volume, "compression, -ln V/V0 [-]"
    fig, axes = new_figure(ncols=2, figsize=(10.0, 4.2))
    axes[0].plot(strain, pressure / KILO, label="pressure")
    axes[0].plot(strain, shear / KILO, label=r"shear stress $\sqrt{s:s/2}$")
    axes[0].set(xlabel=label, ylabel="stress [kPa]")
    axes[0].legend(fontsize=8)
    axes[1].plot(rows["time"] if label.startswith("comp") else strain, 100.0 * volume)
    axes[1].set(xlabel="time [s]" if label.startswith("comp") else label)
    axes[1].set(ylabel="volume strain ln V/V0 [%]")
    fig.suptitle(f"Cell, {path.stem.removesuffix(ENDING)}")
    return fig
