"""The solid of `make bench`: a static solve of a cube beside CalculiX; the port's exchange."""

import os
import shutil
import statistics
import subprocess
import time
from pathlib import Path

SOLID_DECK = """&run title = 'Bench: cube', gravity = 3.0, 0.0, -9.81 /
&mesh file = 'cube.h5' /
&material id = 'steel', law = 'linear_elastic', density = 7800.0, young = 210.0e9, poisson = 0.3 /
&section group = 'all', material = 'steel', element = 'hex8_full' /
&support group = 'z0', fix = 'x', 'y', 'z' /
&analysis kind = 'static' /
"""


def run(command: list[str], folder: Path, threads: int = 1) -> float:
    """Run a command in a folder; return wall seconds."""
    start = time.monotonic()
    environment = dict(os.environ, OMP_NUM_THREADS=str(threads))
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(
            f"bench: {' '.join(command)} ended with {done.returncode}\n"
            f"{done.stdout[-2000:]}{done.stderr}"
        )
    return time.monotonic() - start


def write_cube(path: Path, n: int) -> None:
    """Write a unit cube of n^3 hex8 with the node group z0."""
    import numpy as np

    from talus.verification import write_hex_mesh

    s = np.linspace(0.0, 1.0, n + 1)
    z, y, x = np.meshgrid(s, s, s, indexing="ij")
    nodes = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    k, j, i = (
        a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), np.arange(n), indexing="ij")
    )
    m = n + 1

    def node(di: int, dj: int, dk: int) -> "np.ndarray":
        return ((k + dk) * m + j + dj) * m + i + di

    corners = [
        (0, 0, 0),
        (1, 0, 0),
        (1, 1, 0),
        (0, 1, 0),
        (0, 0, 1),
        (1, 0, 1),
        (1, 1, 1),
        (0, 1, 1),
    ]
    hex8 = np.column_stack([node(*c) for c in corners])
    write_hex_mesh(path, nodes, hex8, nodes={"z0": np.flatnonzero(nodes[:, 2] == 0.0)},
                   volumes={"all": np.arange(len(hex8))})  # fmt: skip


def calculix_deck(path: Path, mesh: Path) -> None:
    """Write the same cube for CalculiX (SPOOLES)."""
    import h5py

    with h5py.File(mesh) as file:
        x, hex8, base = file["nodes/x"][:], file["cells/hex8"][:] + 1, file["node_groups/z0"][:] + 1
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{k + 1},{p[0]:.12g},{p[1]:.12g},{p[2]:.12g}" for k, p in enumerate(x)]
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=CUBE"]
    lines += [f"{k + 1}," + ",".join(map(str, e)) for k, e in enumerate(hex8)]
    lines += ["*NSET, NSET=BASE", *[f"{k}," for k in base]]
    lines += [
        "*MATERIAL, NAME=M",
        "*ELASTIC",
        "210e9,0.3",
        "*DENSITY",
        "7800.",
        "*SOLID SECTION, ELSET=CUBE, MATERIAL=M",
    ]
    lines += ["*BOUNDARY", "BASE,1,3", "*STEP", "*STATIC, SOLVER=SPOOLES", "*DLOAD"]
    lines += [
        "CUBE,GRAV,10.258464798, 0.2924414270, 0., -0.9562834663",
        "*NODE FILE",
        "U",
        "*END STEP",
        "",
    ]
    path.write_text("\n".join(lines))


def bench_solid(binaries: Path, out: Path, repeats: int, size: int) -> dict:
    """Return seconds of a static solve of a cube of hex8, talus-fem and (if installed) CalculiX."""
    folder = out / "solid"
    folder.mkdir(parents=True, exist_ok=True)
    write_cube(folder / "cube.h5", size)
    (folder / "cube.nml").write_text(SOLID_DECK)
    calculix = shutil.which("ccx")
    if calculix:
        calculix_deck(folder / "ccx.inp", folder / "cube.h5")
    ours, theirs = [], []
    for _ in range(repeats):
        ours.append(run([str(binaries / "talus-fem"), "cube.nml"], folder))
        if calculix:
            theirs.append(run([calculix, "ccx"], folder))
    result = {"elements": size**3, "talus_s": statistics.median(ours)}
    if theirs:
        result |= {"calculix_s": statistics.median(theirs)}
        result["ratio"] = result["calculix_s"] / result["talus_s"]
    return result


def bench_port(units: Path) -> dict:
    """Return what the port's own test prints about an exchange of 1000 ghosts."""
    test = units / "test_talus_port"
    if not test.exists():
        return {}
    done = subprocess.run([str(test)], capture_output=True, text=True)
    return {"lines": [line for line in done.stdout.splitlines() if " us" in line]}
