"""Write the grains and the mesh of the column: a pulse that runs down, built into the start."""

import sys
from pathlib import Path

import numpy as np

from talus.mesh import box, write_mesh
from talus.packing import make_packing, write_packing_file

DIAMETER = 0.01  # [m]
PRESSED = 2.0e-4  # strain by which layers are pressed together, so that contacts carry the wave
PITCH = DIAMETER * (1 - PRESSED)  # along the column [m]
SIDE = 1.0005 * DIAMETER  # across: columns side by side that do not touch [m]
ACROSS, ABOVE, N = 6, 60, 3  # grains across; layers above the mesh; grains an element
FREE, GHOSTS, REST = 4, 1, 16  # layers of elements: under free grains, under ghosts, alone
SPEED = np.sqrt(1.0e5 / DIAMETER / 1308.0)  # of the wave [m/s]
CENTRE, WIDTH, STRAIN = 0.32, 0.08, 1.0e-4  # of the pulse [m], its compression


def main() -> int:
    """Write grains_start.h5 and column.h5 into the folder that is named."""
    out = Path(sys.argv[1])
    layers = ABOVE + N * (FREE + GHOSTS)
    z = PITCH * (np.arange(layers) + 0.5 - N * (FREE + GHOSTS))
    line = SIDE * (np.arange(ACROSS) - 0.5 * (ACROSS - 1))
    x = np.array([(a, b, c) for c in z for a in line for b in line])
    # velocity -c e and displacement with du/dz = -e run down alone
    steps = np.linspace(-2.0, 2.0, 8001)
    strain = STRAIN * np.exp(-(((steps - CENTRE) / WIDTH) ** 2))
    shift = np.cumsum(strain[::-1])[::-1] * (steps[1] - steps[0])
    v = np.zeros_like(x)
    v[:, 2] = -SPEED * np.interp(x[:, 2], steps, strain)
    start = x.copy()
    start[:, 2] += np.interp(x[:, 2], steps, shift) - shift[0]  # the lower end stays
    kind = np.where(x[:, 2] > z[-1] - 0.5 * PITCH, 1, 0)
    v[kind == 1] = 0.0
    radius = np.full(x.shape, 0.5 * DIAMETER)
    write_packing_file(out / "grains_start.h5", make_packing(start, radius, kind=kind, v=v))
    half, length = 0.5 * ACROSS * SIDE, N * PITCH
    count = FREE + GHOSTS + REST
    lower, upper = np.array([-half, -half, -count * length]), np.array([half, half, 0.0])
    mesh = box(lower, upper, (ACROSS // N, ACROSS // N, count))
    middle = -mesh.x[mesh.hex8].mean(axis=1)[:, 2] / length
    free = middle < FREE
    mesh.volumes["free"] = np.flatnonzero(free)
    mesh.volumes["ghosts"] = np.flatnonzero(~free & (middle < FREE + GHOSTS))
    write_mesh(out / "column.h5", mesh)
    return 0


if __name__ == "__main__":
    sys.exit(main())
