"""`talus pack`: containers of the benchmark, lattices, clouds, conversion, editing."""

import argparse
import json
from pathlib import Path

import numpy as np

from talus import generate
from talus.faults import FaultError
from talus.packing import FREE, Packing, read_packing, write_packing_file


def register(commands: argparse._SubParsersAction) -> None:
    """Add `pack` and its own sub-commands."""
    pack = commands.add_parser("pack", help="make or change a packing").add_subparsers(
        required=True
    )
    new = _sub(pack, "penetration", penetration, "container and grains of the benchmark")
    new.add_argument("--container", choices=sorted(generate.GRID), default="small")
    new.add_argument("--seed", type=int, default=1)
    new.add_argument("--layers", type=int, default=40)
    new.add_argument(
        "--guard-rows", type=int, default=0, help="more rows of fixed spheres above the walls"
    )
    new = _sub(pack, "lattice", lattice, "grains on a lattice")
    new.add_argument("--kind", choices=sorted(generate.LATTICES), default="sc")
    new.add_argument("--cells", type=int, nargs=3, default=(5, 5, 5))
    new.add_argument("--pitch", type=float, required=True, help="edge of the cubic cell [m]")
    new.add_argument("--axes", type=float, nargs=3, required=True, help="semi-axes [m]")
    new = _sub(pack, "cloud", cloud, "random grains that do not overlap")
    new.add_argument("--count", type=int, required=True)
    new.add_argument("--box", type=float, nargs=3, required=True, help="edges of the box [m]")
    new.add_argument("--axes", type=float, nargs=3, required=True, help="semi-axes [m]")
    new.add_argument("--spread", type=float, default=0.0, help="sizes 1 +- spread")
    new.add_argument("--seed", type=int, default=1)
    for name, text in (
        ("text2h5", "text form to packing.h5"),
        ("h52text", "packing.h5 to text form"),
    ):
        new = _sub(pack, name, transfer, text)
        new.add_argument("source", type=Path)
        new.add_argument("--header", default="", help="a comment line for the text form")
    new = _sub(pack, "edit", edit, "drop grains, renumber, add the penetrator, stop all motion")
    new.add_argument("source", type=Path)
    new.add_argument("--drop-group", action="append", default=[], help="leave a group out")
    new.add_argument("--drop-container-above", type=float, help="drop container grains above z [m]")
    new.add_argument("--tool", action="store_true", help="add the penetrator")
    new.add_argument("--tool-axes", type=float, nargs=3, default=generate.TOOL_AXES)
    new.add_argument(
        "--tool-height", type=float, help="height of its centre [m]; default: just above the bed"
    )
    new.add_argument("--at-rest", action="store_true", help="set all velocities to zero")


def _sub(
    pack: argparse._SubParsersAction, name: str, run: object, text: str
) -> argparse.ArgumentParser:
    """Add one sub-command with the options that all share."""
    parser = pack.add_parser(name, help=text)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--json", action="store_true", help="say what was made as JSON")
    parser.set_defaults(run=run)
    return parser


def finish(options: argparse.Namespace, packing: Packing, header: str = "") -> int:
    """Write the packing and say what it holds."""
    write_packing_file(options.output, packing, header)
    names = ("free", "fixed", "driven")
    facts = {"file": str(options.output), "grains": packing.count}
    facts |= {name: int((packing.kind == k).sum()) for k, name in enumerate(names)}
    facts["groups"] = {name: len(ids) for name, ids in packing.groups.items()}
    if options.json:
        print(json.dumps(facts))
    else:
        parts = ", ".join(f"{facts[name]} {name}" for name in names)
        print(f"{options.output}: {packing.count} grains ({parts})")
    return 0


def penetration(options: argparse.Namespace) -> int:
    """Make a container of the benchmark."""
    made = generate.penetration(options.container, options.seed, options.layers, options.guard_rows)
    return finish(options, made)


def lattice(options: argparse.Namespace) -> int:
    """Make a lattice."""
    return finish(
        options,
        generate.lattice(options.kind, tuple(options.cells), options.pitch, np.array(options.axes)),
    )


def cloud(options: argparse.Namespace) -> int:
    """Make a random cloud."""
    made = generate.cloud(
        options.count, np.array(options.box), np.array(options.axes), options.seed, options.spread
    )
    return finish(options, made)


def transfer(options: argparse.Namespace) -> int:
    """Convert between packing.h5 and the text form (by the names' endings)."""
    return finish(options, read_packing(options.source), options.header)


def edit(options: argparse.Namespace) -> int:
    """Drop, add, stop."""
    packing = read_packing(options.source)
    keep = np.ones(packing.count, bool)
    for name in options.drop_group:
        keep &= ~np.isin(packing.id, group_ids(packing, name))
    if options.drop_container_above is not None:
        inside = np.isin(packing.id, group_ids(packing, "container"))
        keep &= ~(inside & (packing.x[:, 2] > options.drop_container_above))
    packing = packing.take(keep)
    packing.groups = {name: ids for name, ids in packing.groups.items() if ids.size}
    if options.at_rest:
        packing.v[:], packing.omega[:] = 0.0, 0.0
    if options.tool:
        if not (packing.kind == FREE).any():
            raise FaultError("E511", f"{options.source} has no free grains to push into")
        packing = generate.add_tool(packing, tuple(options.tool_axes), options.tool_height)
    return finish(options, packing)


def group_ids(packing: Packing, name: str) -> np.ndarray:
    """Ids of a group, or a fault that names the groups there are."""
    if name not in packing.groups:
        raise FaultError(
            "E513",
            f"the packing has no group '{name}'",
            f"it has: {', '.join(packing.groups) or 'none'}",
        )
    return packing.groups[name]
