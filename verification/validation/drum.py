"""A slice of a drum between smooth ends, axis y: beads, ribs, the surface that they keep."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from talus.packing import make_packing, write_h5
from talus.verification import Step

PITCH = 1.05  # of the first lattice, in diameters
FULL = 0.3  # solid fraction at the surface, half of that of the bed


@dataclass
class Drum:
    """Radius [m], diameter of the beads [m], number of beads, slope at the start [deg]."""

    radius: float
    bead: float
    count: int
    tilt: float
    rib: float = 0.5  # height of the ribs, in beads

    @property
    def width(self) -> float:
        """Width of the slice [m]."""
        return 4.0 * PITCH * self.bead

    def fill(self, path: Path, spread: float) -> None:
        """Write beads on a loose lattice below a tilted surface; spread is that of their radii."""
        rng = np.random.default_rng(11)
        pitch, inner = PITCH * self.bead, self.radius - (self.rib + 0.53) * self.bead
        side = np.arange(-self.radius, self.radius, pitch)
        x, y, z = np.meshgrid(side, pitch * (np.arange(4) + 0.5), side, indexing="ij")
        place = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
        place = place[np.hypot(place[:, 0], place[:, 2]) < inner]
        tilt = np.radians(self.tilt)
        height = place @ np.array([np.sin(tilt), 0.0, np.cos(tilt)])
        place = place[np.argsort(height, kind="stable")[: self.count]]
        radius = 0.5 * self.bead * rng.uniform(1.0 - spread, 1.0 + spread, self.count)
        beads = make_packing(place, np.repeat(radius[:, None], 3, axis=1))
        beads.v[:] = rng.uniform(-0.1, 0.1, (self.count, 3))
        write_h5(path, beads)

    def write_ribs(self, path: Path) -> None:
        """Write radial ribs inside the drum, one every two beads, as an STL; they pass the ends."""
        number = round(np.pi * self.radius / self.bead)
        near = np.array([0.0, -0.2 * self.width, 0.0])
        along = np.array([0.0, 1.4 * self.width, 0.0])
        lines = ["solid ribs"]
        for angle in 2.0 * np.pi * np.arange(number) / number:
            out = np.array([np.sin(angle), 0.0, np.cos(angle)])
            foot = near + self.radius * out
            top = near + (self.radius - self.rib * self.bead) * out
            for corners in ((foot, top, top + along), (foot, top + along, foot + along)):
                lines += ["facet normal 0 0 0", "outer loop"]
                lines += ["vertex " + " ".join(f"{value:.9g}" for value in x) for x in corners]
                lines += ["endloop", "endfacet"]
        path.write_text("\n".join([*lines, "endsolid ribs", ""]))

    def surface(self, steps: list[Step], part: float) -> tuple[np.ndarray, np.ndarray]:
        """Places across the drum and heights of the surface [m], over a part of the radius.

        The surface is where the mean solid fraction of columns one bead wide falls to FULL.
        """
        edges = np.arange(-self.radius, self.radius + 0.5 * self.bead, self.bead)
        fraction = np.zeros((len(edges) - 1, len(edges) - 1))
        for step in steps:
            x, radius = step.grains["x"], step.grains["axes"][:, 0]
            fraction += np.histogram2d(x[:, 0], x[:, 2], (edges, edges),
                                       weights=4.0 / 3.0 * np.pi * radius**3)[0]  # fmt: skip
        fraction /= len(steps) * self.bead**2 * self.width
        middle = 0.5 * (edges[1:] + edges[:-1])
        across, height = [], []
        for k in np.flatnonzero(np.abs(middle) < part * self.radius):
            full = np.flatnonzero(fraction[k] > FULL)
            if len(full) and full[-1] + 1 < len(middle):
                low, high = fraction[k, full[-1]], fraction[k, full[-1] + 1]
                across.append(middle[k])
                height.append(middle[full[-1]] + (low - FULL) / (low - high) * self.bead)
        return np.array(across), np.array(height)

    def slope(self, steps: list[Step]) -> tuple[float, float]:
        """Slope [deg] of the surface in its middle half, and its distance from the axis [m]."""
        line = np.polyfit(*self.surface(steps, 0.5), 1)
        return float(np.degrees(np.arctan(-line[0]))), float(-line[1] / np.hypot(1.0, line[0]))
