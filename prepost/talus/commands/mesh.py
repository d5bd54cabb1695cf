"""`talus mesh`: the block of the benchmark, boxes, conversion of gmsh files."""

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np

from talus import block as blocks
from talus import mesh as meshes
from talus.arguments import counting, number, positive
from talus.elements import KINDS
from talus.faults import FaultError
from talus.gmsh_file import from_gmsh
from talus.orders import FIRST, converted
from talus.surface import check_hanging

SIZES = {"coarse": 10.0e-3, "fine": 7.0e-3}  # edges of elements around the small container [m]


def size_of(text: str) -> float:
    """Return the edge of an element [m] from a number or a word."""
    return SIZES[text] if text in SIZES else positive(text)


def register(commands: argparse._SubParsersAction) -> None:
    """Add `mesh` and its own sub-commands."""
    mesh = commands.add_parser("mesh", help="make or convert a mesh").add_subparsers(required=True)
    new = mesh.add_parser("block", help="block with a box-shaped hole (gmsh)")
    defaults = blocks.Block()
    for name, text in (
        ("hole", "half-width of the hole"), ("outer", "half-width of the block"),
        ("bottom", "height of the hole's floor"), ("top", "height of the block's top"),
        ("floor", "thickness under the hole"),
    ):  # fmt: skip
        new.add_argument(
            f"--{name}", type=number, default=getattr(defaults, name), help=f"{text} [m]"
        )
    words = ", ".join(f"{word} = {value}" for word, value in SIZES.items())
    new.add_argument(
        "--size", type=size_of, default=defaults.size, help=f"edge of an element [m]; {words}"
    )
    _kind(new)
    _output(new, block)
    new = mesh.add_parser("box", help="structured box with groups x0 ... z1")
    new.add_argument("--lower", type=number, nargs=3, default=(0.0, 0.0, 0.0), metavar="X")
    new.add_argument("--upper", type=number, nargs=3, required=True, metavar="X")
    new.add_argument("--cells", type=counting, nargs=3, required=True, metavar="N")
    _kind(new)
    _output(new, box)
    new = mesh.add_parser("convert", help="any gmsh file with all its physical groups")
    new.add_argument("source", type=Path)
    _output(new, convert)


def _kind(parser: argparse.ArgumentParser) -> None:
    """Add the choice of elements."""
    text = "elements; wedges and tetrahedra are made by cutting hexahedra into 2 and 6"
    parser.add_argument("--kind", choices=KINDS, default="hex8", help=text)


def _output(parser: argparse.ArgumentParser, run: object) -> None:
    """Add the options that all share."""
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--json", action="store_true", help="say what was made as JSON")
    parser.set_defaults(run=run)


def finish(options: argparse.Namespace, mesh: meshes.Mesh) -> int:
    """Check and write the mesh, and say what it holds."""
    meshes.check_mesh(mesh)
    check_hanging(mesh)
    meshes.write_mesh(options.output, mesh)
    kinds = {"volumes": mesh.volumes, "facets": mesh.facets, "nodes": mesh.nodes}
    counts = {kind: {n: len(rows) for n, rows in groups.items()} for kind, groups in kinds.items()}
    counts["facets"] = {name: meshes.facet_count(group) for name, group in mesh.facets.items()}
    elements = {kind: len(cells) for kind, cells in mesh.cells.items()}
    facts = {"file": str(options.output), "nodes": len(mesh.x), "elements": elements}
    if options.json:
        print(json.dumps(facts | {"groups": counts}))
        return 0
    groups = ", ".join(f"{kind} {name}" for kind, names in counts.items() for name in names)
    made = ", ".join(f"{count} {kind}" for kind, count in elements.items())
    print(f"{options.output}: {len(mesh.x)} nodes, {made}; {groups}")
    return 0


def block(options: argparse.Namespace) -> int:
    """Make the block of the benchmark."""
    names = ("hole", "outer", "bottom", "top", "floor", "size")
    wanted = blocks.Block(**{name: getattr(options, name) for name in names})
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "block.msh"
        blocks.build_block(path, wanted)
        made = from_gmsh(path)
        if FIRST[options.kind] != "hex8":  # wedges and tetrahedra need hexahedra of one direction
            made = blocks.structured_block(wanted)
        return finish(options, converted(made, options.kind))


def box(options: argparse.Namespace) -> int:
    """Make a structured box."""
    if not (np.array(options.upper) > np.array(options.lower)).all():
        text = f"no box from {options.lower} to {options.upper} m"
        raise FaultError("E526", text, "every upper coordinate must be above the lower one")
    if np.prod(options.cells, dtype=float) > blocks.LARGEST:
        text = f"{' x '.join(map(str, options.cells))} elements are too many"
        raise FaultError("E526", text, f"at most {blocks.LARGEST}")
    made = meshes.box(np.array(options.lower), np.array(options.upper), tuple(options.cells))
    return finish(options, converted(made, options.kind))


def convert(options: argparse.Namespace) -> int:
    """Convert a gmsh file."""
    return finish(options, from_gmsh(options.source))
