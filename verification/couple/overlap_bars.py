"""Bars of grains, of elements, and of both: input of the cases of waves through an overlap."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from talus.mesh import box, write_mesh
from talus.verification import write_packing

DIAMETER, DENSITY, YOUNG = 0.4, 1309.0, 1.0e8
STRAIN = 5.0e-3  # by which the grains are pressed together along the bar
A = DIAMETER * (1 - STRAIN)  # spacing along the bar
SIDE = 1.002 * DIAMETER  # spacing across: chains side by side that do not touch
ACROSS = 2
SPEED = np.sqrt(YOUNG / DENSITY)
MASS = DENSITY * SIDE**2 * A
STIFFNESS = YOUNG * SIDE**2 / A
CUT_OFF = 2 * np.sqrt(STIFFNESS / MASS)


@dataclass
class Bar:
    """Layers of grains left of the mesh, elements of n layers each: free grains, ghosts, rest."""

    grains: int
    free: int
    ghosts: int
    rest: int
    n: int = 4
    pressed: float = STRAIN  # strain by which the grains are pressed together, spacing kept

    @property
    def h(self) -> float:
        """Length of an element [m]."""
        return self.n * A

    @property
    def start(self) -> float:
        """Where the mesh begins; the first, fixed grain is at 0 [m]."""
        return self.grains * A

    @property
    def radius(self) -> float:
        """Radius of a grain [m]."""
        return 0.5 * A / (1 - self.pressed)

    @property
    def density(self) -> float:
        """Density of the grains, for MASS [kg/m3]."""
        return MASS / (4 / 3 * np.pi * self.radius**3)

    def write(self, folder: Path, speed: object, alone: bool = False, shift: object = None) -> None:
        """Write pack.h5 and bar.h5; speed(z): velocity at the start, z from the mesh on [m/s].

        shift(z): displacement of the grains at the start [m].
        alone: grains over the whole length, a mesh as long as both with node groups 0, 1, ...
        """
        elements = self.free + self.ghosts
        layers = self.grains + self.n * (elements + (self.rest if alone else 0))
        z = A * (np.arange(layers) + 0.5)
        line = SIDE * (np.arange(ACROSS) - 0.5 * (ACROSS - 1))
        x = np.array([(a, b, c) for c in z for a in line for b in line])
        v = np.zeros_like(x)
        v[:, 2] = speed(x[:, 2] - self.start)
        kind = np.where(x[:, 2] < z[0] + 0.5 * A, 1, 0)
        v[kind == 1] = 0.0
        if alone:
            kind[x[:, 2] > z[-1] - 0.5 * A] = 1
        if shift is not None:
            x[:, 2] += shift(x[:, 2] - self.start)
        radius = np.full(x.shape, self.radius)
        write_packing(folder / "pack.h5", x, radius, kind=kind, v=v)
        low, half = self.start, 0.5 * ACROSS * SIDE
        count = elements + self.rest
        if alone:
            low, count = 0.0, count + self.grains // self.n
        top = self.start + self.h * (elements + self.rest)
        lower, upper = np.array([-half, -half, low]), np.array([half, half, top])
        mesh = box(lower, upper, (1, 1, count))
        mesh.volumes.update(free=np.arange(self.free), ghosts=np.arange(self.free, elements))
        if alone:
            level = np.rint((mesh.x[:, 2] - low) / self.h).astype(int)
            mesh.nodes.update({str(k): np.flatnonzero(level == k) for k in range(count + 1)})
        write_mesh(folder / "bar.h5", mesh)


def deck_values(dt: float, steps: int, exchanges: int, **more: object) -> dict[str, object]:
    """Values for the places of the decks; output at the end."""
    exchange = steps * dt
    density = MASS / (np.pi / 6 * DIAMETER**3)
    end = f"{exchanges * exchange:.17g}"
    values = {"end": end, "output": end, "exchange": f"{exchange:.17g}", "dt": f"{dt:.17g}"}
    values |= {"density": f"{density:.17g}", "stiffness": f"{STIFFNESS:.17g}"}
    return values | more
