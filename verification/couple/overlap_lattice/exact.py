"""Weights that a coupled run took, judged by residuals that are computed apart from Talus."""

import json

import h5py
import numpy as np
from overlap_cell import BAR, HAT, TILDE, Overlap, Pack, find_contacts

from talus.compare import max_of
from talus.mesh import box, write_mesh
from talus.verification import Case, write_packing

DIAMETER, STIFFNESS, WIDE, MANY = 1.0e-3, 1.0e5, 5, 3
A = DIAMETER * (1 - 1.0e-4)  # spacing
H = MANY * A
LONG = 1.25  # of the ellipsoids
SHIFT = np.array([0.31, 0.23, 0.17]) * A


def write_input(case: Case) -> np.ndarray:
    """Write lattice and block; return the centres of all sites (m), those outside too."""
    at = np.arange(MANY * WIDE)
    sites = np.stack(np.meshgrid(at, at, at, indexing="ij"), -1).reshape(-1, 3) * A + SHIFT
    inside = ((sites > H) & (sites < (WIDE - 1) * H)).all(1)
    x = sites[inside]
    write_packing(case.folder / "pack.h5", x, np.full(x.shape, 0.5 * DIAMETER))
    mesh = box(np.zeros(3), np.full(3, WIDE * H), (WIDE, WIDE, WIDE))
    region = regions(mesh.x[mesh.cells["hex8"]].mean(1))
    mesh.volumes.update(free=np.flatnonzero(region == HAT), ghosts=np.flatnonzero(region == TILDE))
    write_mesh(case.folder / "block.h5", mesh)
    return sites


def regions(middle: np.ndarray) -> np.ndarray:
    """Regions of elements by their middles: one of free grains, ghosts around, elements beyond."""
    layer = np.rint(np.abs(middle / H - 0.5 * WIDE).max(1)).astype(int)
    return np.select([layer == 0, layer == 1], [HAT, TILDE], BAR)


def judge(case: Case, sites: np.ndarray, element: str, partition: str) -> dict[str, float]:
    """Run; return the residuals of the weights in the checkpoint."""
    values = {"young": f"{STIFFNESS / A:.17g}", "element": element, "partition": partition}
    for name in ("grains", "solid", "coupled"):
        text = (case.folder / f"{name}.nml").read_text()
        for key, value in values.items():
            text = text.replace(f"@{key}@", value)
        (case.folder / f"{partition}_{name}.nml").write_text(
            text.replace("'grains.nml'", f"'{partition}_grains.nml'").replace(
                "'solid.nml'", f"'{partition}_solid.nml'"
            )
        )
    case.run("talus-couple", f"{partition}_coupled.nml")
    length = np.full(3, WIDE * H)
    radius = np.full(len(sites), 0.5 * DIAMETER)
    pack = Pack(length, sites, radius, *find_contacts(sites, radius, length), STIFFNESS, STIFFNESS)
    index = np.stack(np.meshgrid(*3 * [np.arange(WIDE)], indexing="ij"), -1)
    region = regions((index.reshape(-1, 3) + 0.5) * H).reshape(3 * [WIDE])
    ov = Overlap(pack, np.full(3, H), region, False, pack.moduli())
    with h5py.File(case.folder / f"{partition}_coupled.x20.chk.h5") as file:
        ids, w = file["weights/ids"][...] - 1, file["weights/contacts"][...]
        beta = file["weights/points"][...]
    weight = {tuple(sorted(pair)): value for pair, value in zip(ids.tolist(), w, strict=True)}
    mesh_order = np.argsort(np.lexsort(ov.origin.T))  # the mesh counts x first
    beta = beta.reshape(-1, 8)[mesh_order].ravel()
    found = [weight.get(tuple(sorted(pair)), 1.0) for pair in ov.pair.tolist()]
    ov.weights(np.array(found), beta)
    return ov.residual()


def write_turned(case: Case) -> None:
    """Write a lattice stretched along y, of ellipsoids long along their own x, turned about z."""
    many, stretch = MANY + 1, np.array([1.0, LONG, 1.0])
    h = many * A
    at = np.arange(many * WIDE)
    x = np.stack(np.meshgrid(at, at, at, indexing="ij"), -1).reshape(-1, 3) * A + SHIFT
    x = x[((x > h) & (x < (WIDE - 1) * h)).all(1)]
    axes = np.tile(0.5 * DIAMETER * np.array([LONG, 1.0, 1.0]), (len(x), 1))
    quat = np.tile(np.sqrt(0.5) * np.array([1.0, 0.0, 0.0, 1.0]), (len(x), 1))
    write_packing(case.folder / "turned_pack.h5", x * stretch, axes, quat)
    mesh = box(np.zeros(3), np.full(3, WIDE * h), (WIDE, WIDE, WIDE))
    region = regions(mesh.x[mesh.cells["hex8"]].mean(1) * MANY / many)
    mesh.volumes.update(free=np.flatnonzero(region == HAT), ghosts=np.flatnonzero(region == TILDE))
    mesh.x *= stretch
    write_mesh(case.folder / "turned_block.h5", mesh)


def turned_ellipsoids(case: Case) -> tuple[float, float]:
    """Run the lattice of ellipsoids; return motion of ghosts and overlap, over the diameter."""
    write_turned(case)
    values = {"young": f"{STIFFNESS / A:.17g}", "element": "hex8_full", "partition": "ramp"}
    for name in ("grains", "solid", "coupled"):
        text = (case.folder / f"{name}.nml").read_text()
        for key, value in values.items():
            text = text.replace(f"@{key}@", value)
        for old in ("pack.h5", "block.h5", "grains.nml", "solid.nml"):
            text = text.replace(f"'{old}'", f"'turned_{old}'")
        (case.folder / f"turned_{name}.nml").write_text(text)
    case.run("talus-couple", "turned_coupled.nml")
    health = json.loads((case.folder / "turned_coupled_summary.json").read_text())["health"]
    log = (case.folder / "turned_coupled.log").read_text()
    moved = float(log.split("ghosts moved by")[1].split()[0])
    return moved / DIAMETER, float(health["max_overlap"])


def run(case: Case) -> None:
    """Judge fit and wrong weights, and that nothing moves."""
    sites = write_input(case)
    table = {}
    for element, partition in (("hex8_full", "auto"), ("hex8_bbar", "ramp"),
                               ("hex8_full", "twice")):  # fmt: skip
        table[partition] = judge(case, sites, element, partition)
    log = (case.folder / "auto_coupled.log").read_text()
    line = next(text for text in log.splitlines() if "energy shared by" in text)
    case.above("auto takes the fit", float(line.split()[3] == "fit"), 1.0)
    worst = max_of(table["auto"].values())
    case.below("auto: largest of F, M, D", worst, 1e-12, "apart from Talus")
    case.above("ramp: largest of F, D", max_of(table["ramp"].values()), 0.1)
    case.above("twice: largest of F, D", max_of(table["twice"].values()), 10.0)
    moved = float(log.split("ghosts moved by")[1].split()[0])
    case.below("ghosts moved / diameter", moved / DIAMETER, 1e-12)
    moved, overlap = turned_ellipsoids(case)
    case.below("turned ellipsoids: ghosts moved / diameter", moved, 1e-12)
    case.metric("turned ellipsoids: largest overlap / diameter", overlap / 2.0, LONG * 1e-4, 1e-9,
                "as in the packing: ghosts keep their orientation")  # fmt: skip
    fig, ax = case.figure()
    for mark, what in zip("osD", "FMD", strict=True):
        ax.semilogy(range(3), [max(t[what], 1e-17) for t in table.values()], mark, label=what)
    ax.axhline(1e-12, color="k", lw=0.8)
    ax.set_xticks(range(3), list(table))
    ax.set(xlabel="partition [-]", ylabel="largest residual / contact force [-]")
    ax.legend()
    case.save(fig)
