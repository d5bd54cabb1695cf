"""`talus mesh`: the block of the benchmark, boxes, conversion of gmsh files."""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from talus import block as blocks
from talus import mesh as meshes


def register(commands: argparse._SubParsersAction) -> None:
    """Add `mesh` and its own sub-commands."""
    mesh = commands.add_parser("mesh", help="make or convert a mesh").add_subparsers(required=True)
    new = mesh.add_parser("block", help="block with a box-shaped hole (gmsh)")
    defaults = blocks.Block()
    for name, text in (
        ("hole", "half-width of the hole"), ("outer", "half-width of the block"),
        ("bottom", "height of the hole's floor"), ("top", "height of the block's top"),
        ("floor", "thickness under the hole"), ("size", "edge of an element"),
    ):  # fmt: skip
        new.add_argument(
            f"--{name}", type=float, default=getattr(defaults, name), help=f"{text} [m]"
        )
    new.set_defaults(run=block)
    new.add_argument("-o", "--output", type=Path, required=True)
    new = mesh.add_parser("box", help="structured box with groups x0 ... z1")
    new.add_argument("--lower", type=float, nargs=3, default=(0.0, 0.0, 0.0))
    new.add_argument("--upper", type=float, nargs=3, required=True)
    new.add_argument("--cells", type=int, nargs=3, required=True)
    new.add_argument("-o", "--output", type=Path, required=True)
    new.set_defaults(run=box)
    new = mesh.add_parser("convert", help="any gmsh file with physical groups")
    new.add_argument("source", type=Path)
    new.add_argument("-o", "--output", type=Path, required=True)
    new.set_defaults(run=convert)


def finish(path: Path, mesh: meshes.Mesh) -> int:
    """Write the mesh and say what it holds."""
    meshes.write_mesh(path, mesh)
    groups = ", ".join(
        [f"volume {n}" for n in mesh.volumes]
        + [f"facets {n}" for n in mesh.facets]
        + [f"nodes {n}" for n in mesh.nodes]
    )
    print(f"{path}: {len(mesh.x)} nodes, {len(mesh.hex8)} hexahedra; {groups}")
    return 0


def block(options: argparse.Namespace) -> int:
    """Make the block of the benchmark."""
    names = ("hole", "outer", "bottom", "top", "floor", "size")
    wanted = blocks.Block(**{name: getattr(options, name) for name in names})
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "block.msh"
        blocks.build_block(path, wanted)
        return finish(options.output, meshes.from_gmsh(path))


def box(options: argparse.Namespace) -> int:
    """Make a structured box."""
    made = meshes.box(np.array(options.lower), np.array(options.upper), tuple(options.cells))
    return finish(options.output, made)


def convert(options: argparse.Namespace) -> int:
    """Convert a gmsh file."""
    return finish(options.output, meshes.from_gmsh(options.source))
