"""`talus convert`: field files to VTU or a scene of ParaView; packings of other codes."""

import argparse
from pathlib import Path

import numpy as np

from talus.arguments import number, positive
from talus.exchange import SPHERES, read_ellip3d, read_lammps, write_lammps
from talus.faults import FaultError
from talus.fields import convert_to_vtu
from talus.packing import Packing, read_packing, write_packing_file
from talus.paraview_scene import write_scene
from talus.progress import watch
from talus.vtkhdf import write_vtkhdf

READERS = {"packing": read_packing, "ellip3d": read_ellip3d, "lammps": read_lammps}
TARGETS = ("vtu", "vtkhdf", "paraview", "packing", "lammps", "liggghts")


def register(commands: argparse._SubParsersAction) -> None:
    """Add `convert`."""
    new = commands.add_parser("convert", help="field file to VTU series, packings of other codes")
    new.add_argument("source", type=Path, help="field file (grains.h5, solid.h5), or a packing")
    new.add_argument(
        "-o", "--output", type=Path, required=True,
        help="VTU: folder, or name ending in .vtu; ParaView: name ending in .py; VTKHDF: in "
        ".vtkhdf; else a file",
    )  # fmt: skip
    new.add_argument("--to", choices=TARGETS, help="default: vtu, or with --from a packing")
    new.add_argument(
        "--from", dest="kind", choices=sorted(READERS), default="packing",
        help="what a packing is read from: packing.h5 or .txt (default), a particle file of "
        "ELLIP3D, a data file of LAMMPS or LIGGGHTS (atom_style sphere)",
    )  # fmt: skip
    new.add_argument(
        "--density", type=positive, default=2650.0, help="of the grains [kg/m3], for LAMMPS"
    )
    new.add_argument(
        "--spheres", choices=SPHERES, default="refuse",
        help="grains that are no spheres: refuse them, or take the sphere around them or the "
        "one of their volume",
    )  # fmt: skip
    new.add_argument(
        "--box", type=number, nargs=6, metavar="L", help="xlo xhi ylo yhi zlo zhi [m], for LAMMPS"
    )
    new.add_argument(
        "--surfaces", action="store_true", help="VTU: grains as triangles of their surfaces"
    )
    new.add_argument(
        "--solid", type=Path, help="for ParaView: field file of a solid shown with the grains"
    )
    new.set_defaults(run=convert)


def convert(options: argparse.Namespace) -> int:
    """Write what is wanted and say what was written."""
    target = options.to or ("vtu" if options.kind == "packing" else "packing")
    if target in ("vtu", "vtkhdf", "paraview") and options.kind != "packing":
        raise FaultError("E500", f"--to={target} requires field files, not --from={options.kind}")
    if target == "paraview":
        sources = [options.source, *([options.solid] if options.solid else [])]
        write_scene(sources, options.output)
        print(f"{options.output}: open it with paraview --script={options.output}")
        return 0
    if target == "vtkhdf":
        count = write_vtkhdf(options.source, options.output, watch)
        print(f"{options.output}: {count} steps")
        return 0
    if target == "vtu":
        written = convert_to_vtu(options.source, options.output, watch, options.surfaces)
        print(f"{written[-1]}: {len(written) - 1} steps")
        return 0
    packing: Packing = READERS[options.kind](options.source)
    if target == "packing":
        write_packing_file(options.output, packing)
    else:
        box = None if options.box is None else np.array(options.box)
        write_lammps(options.output, packing, options.density, options.spheres, box)
    print(f"{options.output}: {packing.count} grains for {target}")
    return 0
