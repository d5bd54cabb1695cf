"""`talus pack`: containers of the benchmark, lattices, clouds, tiles, conversion, editing."""

import argparse
from pathlib import Path

import numpy as np

from talus import generate, measure
from talus.arguments import counting, natural, number, positive
from talus.column_stamp import is_column
from talus.commands import pack_clump, pack_column, pack_join, pack_tile
from talus.commands.pack_cloud import (
    axes_option,
    cloud_of,
    cloud_options,
    finish,
    form_options,
    grains_of,
    sub_command,
)
from talus.faults import FaultError
from talus.packing import FIXED, FREE, TEXT_ENDINGS, Packing, read_packing


def register(commands: argparse._SubParsersAction) -> None:
    """Add `pack` and its own sub-commands."""
    pack = commands.add_parser("pack", help="make or change a packing").add_subparsers(
        required=True
    )
    new = sub_command(pack, "penetration", penetration, "container and grains of the benchmark")
    new.add_argument("--container", choices=sorted(generate.GRID), default="small")
    new.add_argument("--seed", type=natural, default=1)
    new.add_argument("--layers", type=counting, default=40)
    new.add_argument(
        "--guard-rows", type=natural, default=0, help="more rows of fixed spheres above the walls"
    )
    new = sub_command(pack, "lattice", lattice, "grains on a lattice")
    new.add_argument("--kind", choices=sorted(generate.LATTICES), default="sc")
    new.add_argument("--cells", type=counting, nargs=3, default=(5, 5, 5), metavar="N")
    new.add_argument("--pitch", type=positive, required=True, help="edge of the cell [m]")
    axes_option(new, "--axes", "semi-axes [m]", required=True)
    form_options(new)
    new.add_argument("--periodic", action="store_true", help="in a periodic cell")
    new = sub_command(pack, "cloud", cloud, "random grains that do not overlap")
    axes_option(new, "--box", "edges of the box [m]", required=True)
    cloud_options(new)
    new.add_argument("--periodic", action="store_true", help="the box is a periodic cell")
    new.add_argument(
        "--clumps", type=Path, metavar="FILE",
        help="templates of clumps of spheres in place of --axes, see talus pack clump",
    )  # fmt: skip
    new.add_argument(
        "--polyhedra",
        nargs="+",
        metavar="BODY",
        help="convex polyhedra with rounded edges in place of --axes: cube:EDGE [m], tetrahedron:, "
        "octahedron:, dodecahedron:EDGE, brick:AxBxC, or the hull of an STL or OBJ file",
    )
    new.add_argument(
        "--rounding", type=positive, default=0.1, metavar="R",
        help="radius of edges over that of the sphere of the body's volume",
    )  # fmt: skip
    pack_clump.register(
        sub_command(pack, "clump", pack_clump.clump, "spheres that fill a body, as a template")
    )
    pack_tile.register(
        sub_command(pack, "tile", pack_tile.tile, "periodic cell at rest under a stress")
    )
    pack_column.register_column(
        sub_command(pack, "column", pack_column.column, "bed of a tile at rest under gravity")
    )
    pack_join.register(
        sub_command(pack, "join", pack_join.join, "two tiles of one making in one periodic cell")
    )
    check = pack.add_parser("check-tile", help="what a tile or column is, and whether it holds")
    pack_column.register_check(check)
    check.set_defaults(run=pack_column.check)
    for name, text in (
        ("text2h5", "text form to packing.h5"),
        ("h52text", "packing.h5 to text form"),
    ):
        new = sub_command(pack, name, transfer, text)
        new.add_argument("source", type=Path)
        new.add_argument("--header", default="", help="a comment line for the text form")
    new = sub_command(
        pack, "edit", edit, "drop, stop, fix, move or join grains, add the penetrator"
    )
    new.add_argument("source", type=Path)
    new.add_argument("--drop-group", action="append", default=[], help="leave a group out")
    new.add_argument(
        "--drop-container-above", type=number, help="drop container grains above z [m]"
    )
    new.add_argument(
        "--keep-box", type=number, nargs=6, metavar="L",
        help="keep grains whose centre lies in the box: lower x y z, upper x y z [m]",
    )  # fmt: skip
    new.add_argument(
        "--level", type=number, metavar="Z",
        help="drop the free grains that reach above z [m]: an even surface to put a body on",
    )  # fmt: skip
    new.add_argument("--tool", action="store_true", help="add the penetrator")
    axes_option(new, "--tool-axes", "its semi-axes [m]", default=generate.TOOL_AXES)
    new.add_argument(
        "--tool-height", type=number, help="height of its centre [m]; default: just above the bed"
    )
    new.add_argument("--at-rest", action="store_true", help="set all velocities to zero")
    new.add_argument("--fix", action="store_true", help="all grains become fixed ones")
    new.add_argument(
        "--renumber", action="store_true", help="number the grains from 1 in their order"
    )
    new.add_argument(
        "--repeat", type=counting, nargs=3, metavar="N",
        help="lay a periodic cell side by side so many times along its edges",
    )  # fmt: skip
    new.add_argument(
        "--shift", type=number, nargs=3, metavar="L", help="move all grains and the cell [m]"
    )
    new.add_argument(
        "--join", type=Path, metavar="FILE",
        help="add the grains of another packing, numbered on; after all else",
    )  # fmt: skip


def penetration(options: argparse.Namespace) -> int:
    """Make a container of the benchmark."""
    made = generate.penetration(options.container, options.seed, options.layers, options.guard_rows)
    return finish(options, made)


def lattice(options: argparse.Namespace) -> int:
    """Make a lattice."""
    made = generate.lattice(
        options.kind, tuple(options.cells), options.pitch, np.array(options.axes), options.periodic
    )
    made.skew[:], made.exponent[:] = options.skew, options.exponent
    return finish(options, made)


def cloud(options: argparse.Namespace) -> int:
    """Make a random cloud."""
    if options.polyhedra is not None:
        made = pack_clump.cloud_of_polyhedra(options)
        return finish(options, made, facts={"polyhedra": len(made.clumps.first)})
    if options.clumps is not None:
        made = pack_clump.cloud_of_clumps(options)
        return finish(options, made, facts={"clumps": len(made.clumps.first)})
    forms, sizes, curve = grains_of(options)
    made = cloud_of(options, forms, sizes, np.array(options.box), options.periodic)
    if curve is None:
        return finish(options, made)
    error = generate.check_gradation(made, *curve)
    return finish(options, made, facts={"sieve curve, largest error of the mass": error})


def transfer(options: argparse.Namespace) -> int:
    """Convert between packing.h5 and the text form (by the names' endings)."""
    packing = read_packing(options.source)
    if options.output.suffix in TEXT_ENDINGS and (packing.v.any() or packing.omega.any()):
        print(f"{options.source}: the text form holds no velocities, they are left out")
    if options.output.suffix in TEXT_ENDINGS and packing.cell is not None:
        print(f"{options.source}: the text form holds no cell, it is left out")
    if options.output.suffix in TEXT_ENDINGS and len(packing.pairs):
        print(f"{options.source}: the text form holds no contacts, they are left out")
    return finish(options, packing, options.header)


def edit(options: argparse.Namespace) -> int:
    """Drop, stop, move, add."""
    packing = read_packing(options.source)
    keep = np.ones(packing.count, bool)
    for name in options.drop_group:
        keep &= ~np.isin(packing.id, group_ids(packing, name))
    if options.drop_container_above is not None:
        inside = np.isin(packing.id, group_ids(packing, "container"))
        keep &= ~(inside & (packing.x[:, 2] > options.drop_container_above))
    if options.keep_box is not None:
        lower, upper = np.reshape(options.keep_box, (2, 3))
        keep &= np.all((packing.x >= lower) & (packing.x <= upper), axis=1)
    if options.level is not None:
        keep &= (packing.kind != FREE) | (measure.tops(packing) <= options.level)
    if not keep.any():
        raise FaultError("E511", f"{options.source}: no grain is left", "check the limits given")
    packing = packing.take(keep)
    packing.groups = {name: ids for name, ids in packing.groups.items() if ids.size}
    if options.at_rest:
        packing.v[:], packing.omega[:] = 0.0, 0.0
    if options.fix:
        packing.kind[:] = FIXED
    if options.renumber:
        packing = packing.renumbered(0)
    if options.repeat is not None:
        if options.repeat[2] > 1 and is_column(options.source):
            text = f"{options.source} is a column, which is not periodic along z"
            raise FaultError("E538", text, "--repeat NX NY 1; a higher bed: talus pack column")
        packing = packing.repeated(tuple(options.repeat))
    if options.shift is not None:
        packing.x += np.array(options.shift)
        packing.corner = packing.corner + np.array(options.shift)
    if options.tool:
        if not (packing.kind == FREE).any():
            raise FaultError("E511", f"{options.source} has no free grains to push into")
        if "tool" in packing.groups:
            hint = "leave the old one out: --drop-group tool"
            raise FaultError("E511", f"{options.source} has a penetrator already", hint)
        packing = generate.add_tool(packing, tuple(options.tool_axes), options.tool_height)
    if options.join is not None:
        packing = packing.join(read_packing(options.join).renumbered(int(packing.id.max())))
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
