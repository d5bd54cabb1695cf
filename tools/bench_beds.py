"""Beds for `make bench`: grains on a loose lattice, let down into a box of planes by talus-dem.

A bed is settled once and kept: FOLDER/<name>.h5 (packing), <name>.nml (deck that continues from it,
for timing) and <name>.json (what was found when it had settled). Material, step and damping are
those of CASE below for every code.

Usage: bench_beds.py [--bin build/bin] [--out build/bench/beds] [--threads N] [--cases NAME ...]
"""

import argparse
import json
import os
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "prepost"))

from talus.forms import Forms, bounding_radii, volumes  # noqa: E402
from talus.generate import random_quaternions  # noqa: E402
from talus.packing import make_packing, read_packing, write_packing_file  # noqa: E402

DENSITY, YOUNG, POISSON = 2650.0, 1.0e7, 0.25  # kg/m3, Pa; soft, so that settling is cheap
FRICTION, DAMPING_RATIO = 0.5, 0.3
DENSE = 0.35  # friction during deposition: a coordination of 5.8 instead of 5.2
DT = 2.0e-5  # s; 0.28 of the Rayleigh time of the smallest sphere
GRAVITY = 9.81  # m/s2
SPHERE, SPREAD = 1.0e-3, 0.2  # mean radius [m], +- share
ELLIPSOID = (2.5e-3, 2.0e-3, 1.5e-3)
SKEW = 0.3  # of poly-ellipsoids, uniform from -SKEW to SKEW a semi-axis: halves up to 1.9 to 1
EXPONENTS = (2.5, 5.0)  # of superquadrics, uniform; semi-axes shrink to the ellipsoid's volume
GAP = 0.02e-3  # m, between the largest grains on the lattice
STEPS = 1000  # of the deck for timing


@dataclass(frozen=True)
class Bed:
    """A bed: shape, grains, grains a row of the lattice, settling."""

    name: str
    shape: str
    grains: int
    columns: int
    fall: float  # s of deposition, with the damping that follows
    damping: float  # 1/s
    friction: float = FRICTION  # during deposition; less makes a denser bed
    source: str = ""  # bed of which this one is copies side by side
    copies: tuple[int, int] = (1, 1)
    beside: str = ""  # bed of ellipsoids of the same box, number and volumes

    @property
    def pitch(self) -> float:
        """Distance of lattice sites of spheres or ellipsoids [m]."""
        largest = SPHERE * (1.0 + SPREAD) if self.shape == "spheres" else ELLIPSOID[0]
        return 2.0 * largest + GAP

    @property
    def edge(self) -> float:
        """Edge of the box, of one of its copies [m]."""
        return self.columns * self.pitch

    @property
    def box(self) -> tuple[float, float]:
        """Edges of the box in the plane [m]."""
        return self.edge * self.copies[0], self.edge * self.copies[1]


def other_shape(name: str, shape: str) -> Bed:
    """Return the bed of ellipsoids of that name with its shapes exchanged."""
    bed = BEDS[name]
    return replace(bed, name=f"{shape}_{bed.grains}", shape=shape, beside=name)


BEDS = {
    bed.name: bed
    for bed in (
        Bed("spheres_2000", "spheres", 2000, 12, 0.15, 30.0),
        Bed("spheres_10000", "spheres", 10000, 20, 0.25, 30.0),
        Bed("spheres_20000", "spheres", 20000, 27, 0.28, 28.0),
        Bed("spheres_50000", "spheres", 50000, 37, 0.30, 25.0),
        Bed("spheres_1000000", "spheres", 1000000, 27, 0.020, 200.0, FRICTION,
            "spheres_20000", (10, 5)),
        Bed("ellipsoids_2760", "ellipsoids", 2760, 14, 0.30, 25.0, DENSE),
        Bed("ellipsoids_20000", "ellipsoids", 20000, 27, 0.35, 15.0, 0.40),
        Bed("ellipsoids_1000000", "ellipsoids", 1000000, 27, 0.020, 200.0, FRICTION,
            "ellipsoids_20000", (10, 5)),
    )
}  # fmt: skip
BEDS |= {
    bed.name: bed
    for bed in (
        other_shape(name, shape)
        for name in ("ellipsoids_2760", "ellipsoids_20000")
        for shape in ("poly_ellipsoids", "superquadrics")
    )
}

DECK = """&run title = '{title}', t_end = {t_end:.6g}, gravity = 0.0, 0.0, -{gravity} /
&material id = 'grain', density = {density}, young = {young}, poisson = {poisson} /
&contact between = 'grain', 'grain', law = 'hertz_mindlin', friction = {friction},
         damping_ratio = {ratio} /
&particles file = '{file}', material = 'grain' /
&wall id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'grain' /
&wall id = 'x0', point = 0.0, 0.0, 0.0, normal = 1.0, 0.0, 0.0, material = 'grain' /
&wall id = 'x1', point = {x1:.9g}, 0.0, 0.0, normal = -1.0, 0.0, 0.0, material = 'grain' /
&wall id = 'y0', point = 0.0, 0.0, 0.0, normal = 0.0, 1.0, 0.0, material = 'grain' /
&wall id = 'y1', point = 0.0, {y1:.9g}, 0.0, normal = 0.0, -1.0, 0.0, material = 'grain' /
&dynamics dt = {dt}, damping = {damping} /
"""
OUTPUT = "&output every_time = {t_end:.6g}, packing = '{file}' /\n"


def deck(
    bed: Bed, file: str, t_end: float, damping: float = 0.0, friction: float = FRICTION
) -> str:
    """Return the deck of a bed; the timing deck has no background damping."""
    return DECK.format(
        title=bed.name, t_end=t_end, gravity=GRAVITY, density=DENSITY, young=YOUNG,
        poisson=POISSON, friction=friction, ratio=DAMPING_RATIO, file=file, x1=bed.box[0],
        y1=bed.box[1], dt=DT, damping=damping,
    )  # fmt: skip


def forms(bed: Bed, rng: np.random.Generator) -> Forms:
    """Return the forms of a bed that has no spheres; all have the ellipsoid's volume."""
    shapes = Forms(np.tile(ELLIPSOID, (bed.grains, 1)), np.zeros((bed.grains, 3)),
                   np.full(bed.grains, 2.0))  # fmt: skip
    if bed.shape == "poly_ellipsoids":
        shapes.skew = rng.uniform(-SKEW, SKEW, shapes.skew.shape)
    if bed.shape == "superquadrics":
        shapes.exponent = rng.uniform(*EXPONENTS, bed.grains)
        wanted = 4.0 / 3.0 * np.pi * np.prod(ELLIPSOID)
        volume = volumes(shapes.axes, shapes.skew, shapes.exponent)
        shapes.axes *= np.cbrt(wanted / volume)[:, None]
    return shapes


def sites(bed: Bed, pitch: float) -> np.ndarray:
    """Return places on a lattice above the floor that fits into the box."""
    columns = int(bed.edge / pitch + 1.0e-9)
    pitch = bed.edge / columns
    k = np.arange(bed.grains)
    site = np.column_stack([k % columns, k // columns % columns, k // columns**2])
    return (site + 0.5) * pitch


def loose(bed: Bed, seed: int = 1):  # noqa: ANN201 (a Packing; imported late)
    """Return the grains on their lattice, with small velocities."""
    rng = np.random.default_rng(seed)
    if bed.shape == "spheres":
        x = sites(bed, bed.pitch)
        radius = SPHERE * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD, bed.grains)
        axes = np.repeat(radius[:, None], 3, axis=1)
        x += rng.uniform(-1.0, 1.0, x.shape) * (0.5 * bed.pitch - radius[:, None])
        return make_packing(x, axes, v=0.05 * rng.normal(size=x.shape))
    quat = random_quaternions(rng, bed.grains)
    v = 0.05 * rng.normal(size=(bed.grains, 3))
    shapes = forms(bed, rng)
    largest = 0.5 * bed.pitch
    if bed.beside:
        largest = bounding_radii(shapes).max() + 0.5 * GAP
    packing = make_packing(sites(bed, 2.0 * largest), shapes.axes, quat, v=v)
    packing.skew, packing.exponent = shapes.skew, shapes.exponent
    return packing


def replicate(bed: Bed, source: Path):  # noqa: ANN201 (a Packing)
    """Return copies of a settled bed side by side, each the mirror image of its neighbours.

    Grains at a wall then lean against their images, so that taking the walls out changes little.
    """
    block = read_packing(source)
    places, turns = [], []
    for i in range(bed.copies[0]):
        for j in range(bed.copies[1]):
            x, quat = block.x.copy(), block.quat.copy()
            for axis, count in ((0, i), (1, j)):
                if count % 2:
                    x[:, axis] = bed.edge - x[:, axis]
                    # axes of rotation are pseudo-vectors: the parts along the mirror change sign
                    quat[:, [1 + k for k in range(3) if k != axis]] *= -1.0
            places.append(x + np.array([i, j, 0]) * bed.edge)
            turns.append(quat)
    axes = np.tile(block.axes, (len(places), 1))
    return make_packing(np.concatenate(places), axes, np.concatenate(turns))


def settle(binary: Path, folder: Path, bed: Bed, threads: int) -> dict:
    """Settle a bed, unless it is kept already; return what was found."""
    record = folder / f"{bed.name}.json"
    if record.exists() and (folder / f"{bed.name}.h5").exists():
        return json.loads(record.read_text())
    folder.mkdir(parents=True, exist_ok=True)
    stem = f"{bed.name}_settle"
    if bed.source:
        settle(binary, folder, BEDS[bed.source], threads)
        start = replicate(bed, folder / f"{bed.source}.h5")
    else:
        start = loose(bed)
    write_packing_file(folder / f"{stem}0.h5", start)
    file = f"{stem}0.h5"
    stages = [(bed.fall, bed.damping, bed.friction)]
    if not bed.source:
        stages += [(0.06, 200.0, bed.friction), (0.1, 200.0, FRICTION)]
    if bed.beside:  # grains of these shapes roll on for longer
        stages += [(0.3, 50.0, FRICTION), (0.15, 200.0, FRICTION)]
    for number, (duration, damping, friction) in enumerate(stages, 1):
        name, made = f"{stem}{number}", f"{stem}{number}_packing.h5"
        text = deck(bed, file, duration, damping, friction) + OUTPUT.format(
            t_end=duration, file=made
        )
        (folder / f"{name}.nml").write_text(text)
        summary = run(binary, folder, name, threads)
        file = made
    settled = read_packing(folder / file)
    contacts, energy = summary["contacts"], summary["energy"]
    touches = coordination(folder / f"{name}.h5")  # contacts with walls count once
    found = {
        "case": bed.name,
        "grains": settled.count,
        "contacts": contacts,
        "wall_contacts": 2 * contacts - touches,
        "coordination": touches / settled.count,
        "kinetic_over_elastic": energy["kinetic_J"] / energy["elastic_J"],
        "largest_speed_m_s": float(np.linalg.norm(settled.v, axis=1).max()),
        "height_m": float(settled.x[:, 2].max()),
        "max_overlap": summary["health"]["max_overlap"],
    }
    (folder / file).replace(folder / f"{bed.name}.h5")
    (folder / f"{bed.name}.nml").write_text(deck(bed, f"{bed.name}.h5", STEPS * DT))
    record.write_text(json.dumps(found, indent=2) + "\n")
    for path in folder.glob(f"{stem}*"):
        if path.suffix != ".nml":
            path.unlink()
    return found


def coordination(fields: Path) -> int:
    """Return the sum of all grains' coordination numbers in the last step of a field file."""
    import h5py

    with h5py.File(fields) as file:
        last = sorted(file["steps"])[-1]
        return int(file[f"steps/{last}/grains/coordination"][...].sum())


def run(binary: Path, folder: Path, name: str, threads: int) -> dict:
    """Run talus-dem on a deck of the folder and return its summary."""
    environment = dict(os.environ, OMP_NUM_THREADS=str(threads), OMP_WAIT_POLICY="passive")
    command = [str(binary), f"{name}.nml", f"--threads={threads}"]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"bench: {folder / name}.nml ended with {done.returncode}\n{done.stderr}")
    return json.loads((folder / f"{name}_summary.json").read_text())


def say(found: dict) -> str:
    """Return a line on a settled bed."""
    return (
        f"{found['case']}: {found['grains']} grains, Z {found['coordination']:.2f}, "
        f"kinetic/elastic {found['kinetic_over_elastic']:.1e}, "
        f"fastest grain {found['largest_speed_m_s']:.1e} m/s, "
        f"largest overlap {100.0 * found['max_overlap']:.2f} %"
    )


def main() -> int:
    """Settle the requested beds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", type=Path, default=ROOT / "build/bin")
    parser.add_argument("--out", type=Path, default=ROOT / "build/bench/beds")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--cases", nargs="+", choices=sorted(BEDS), default=list(BEDS))
    options = parser.parse_args()
    for name in options.cases:
        binary = options.bin.resolve() / "talus-dem"
        print(say(settle(binary, options.out.resolve(), BEDS[name], options.threads)), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
