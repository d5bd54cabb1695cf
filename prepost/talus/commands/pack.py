"""`talus pack`: containers of the benchmark, lattices, clouds, conversion, editing."""

import argparse
import json
from pathlib import Path

import numpy as np

from talus import generate
from talus.arguments import counting, natural, number, positive, share
from talus.faults import FaultError
from talus.forms import LEAST_EXPONENT, TABLE, Forms, check_row, formed, read_table, table_rows
from talus.packing import FIXED, FREE, TEXT_ENDINGS, Packing, read_packing, write_packing_file
from talus.progress import watch


def register(commands: argparse._SubParsersAction) -> None:
    """Add `pack` and its own sub-commands."""
    pack = commands.add_parser("pack", help="make or change a packing").add_subparsers(
        required=True
    )
    new = _sub(pack, "penetration", penetration, "container and grains of the benchmark")
    new.add_argument("--container", choices=sorted(generate.GRID), default="small")
    new.add_argument("--seed", type=natural, default=1)
    new.add_argument("--layers", type=counting, default=40)
    new.add_argument(
        "--guard-rows", type=natural, default=0, help="more rows of fixed spheres above the walls"
    )
    new = _sub(pack, "lattice", lattice, "grains on a lattice")
    new.add_argument("--kind", choices=sorted(generate.LATTICES), default="sc")
    new.add_argument("--cells", type=counting, nargs=3, default=(5, 5, 5), metavar="N")
    new.add_argument("--pitch", type=positive, required=True, help="edge of the cell [m]")
    _axes(new, "--axes", "semi-axes [m]", required=True)
    _form(new)
    new.add_argument("--periodic", action="store_true", help="in a periodic cell")
    new = _sub(pack, "cloud", cloud, "random grains that do not overlap")
    new.add_argument("--count", type=counting, required=True)
    _axes(new, "--box", "edges of the box [m]", required=True)
    _axes(new, "--axes", "semi-axes [m]; with --gradation their ratios")
    _form(new)
    new.add_argument(
        "--shapes", type=Path, metavar="FILE",
        help=f"table of measured grains in place of --axes, a row each: {TABLE}; every grain "
        "of the cloud draws one at random by weight",
    )  # fmt: skip
    sizes = new.add_mutually_exclusive_group()
    sizes.add_argument("--spread", type=share, default=0.0, help="sizes 1 +- spread, by number")
    sizes.add_argument(
        "--gradation", nargs="+", metavar="OPENING:SHARE",
        help="sieve curve: opening [m] and share of the mass that passes, 2e-3:0 3e-3:0.4 5e-3:1; "
        "a grain passes by its middle axis",
    )  # fmt: skip
    sizes.add_argument(
        "--sieves", type=Path, metavar="FILE",
        help="the same from a file: a row a sieve, opening [m] and share of the mass that passes",
    )  # fmt: skip
    new.add_argument("--seed", type=natural, default=1)
    new.add_argument("--periodic", action="store_true", help="the box is a periodic cell")
    for name, text in (
        ("text2h5", "text form to packing.h5"),
        ("h52text", "packing.h5 to text form"),
    ):
        new = _sub(pack, name, transfer, text)
        new.add_argument("source", type=Path)
        new.add_argument("--header", default="", help="a comment line for the text form")
    new = _sub(pack, "edit", edit, "drop, stop, fix, move or join grains, add the penetrator")
    new.add_argument("source", type=Path)
    new.add_argument("--drop-group", action="append", default=[], help="leave a group out")
    new.add_argument(
        "--drop-container-above", type=number, help="drop container grains above z [m]"
    )
    new.add_argument(
        "--keep-box", type=number, nargs=6, metavar="L",
        help="keep grains whose centre lies in the box: lower x y z, upper x y z [m]",
    )  # fmt: skip
    new.add_argument("--tool", action="store_true", help="add the penetrator")
    _axes(new, "--tool-axes", "its semi-axes [m]", default=generate.TOOL_AXES)
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


def _sub(
    pack: argparse._SubParsersAction, name: str, run: object, text: str
) -> argparse.ArgumentParser:
    """Add one sub-command with the options that all share."""
    parser = pack.add_parser(name, help=text)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--json", action="store_true", help="say what was made as JSON")
    parser.set_defaults(run=run)
    return parser


def _axes(parser: argparse.ArgumentParser, name: str, text: str, **options: object) -> None:
    """Add an option of three lengths."""
    parser.add_argument(name, type=positive, nargs=3, metavar="L", help=text, **options)


def _form(parser: argparse.ArgumentParser) -> None:
    """Add what makes grains other than ellipsoids."""
    parser.add_argument(
        "--skew", type=number, nargs=3, metavar="S", default=(0.0, 0.0, 0.0),
        help="poly-ellipsoids: semi-axes (1 + S) on the positive and (1 - S) on the negative sides",
    )  # fmt: skip
    parser.add_argument(
        "--exponent", type=number, default=2.0, help="superquadrics: 2 is an ellipsoid, 10 a box"
    )


def finish(
    options: argparse.Namespace, packing: Packing, header: str = "", facts: dict | None = None
) -> int:
    """Write the packing and say what it holds, with further facts."""
    write_packing_file(options.output, packing, header)
    names = ("free", "fixed", "driven")
    further = facts or {}
    facts = {"file": str(options.output), "grains": packing.count}
    facts |= {name: int((packing.kind == k).sum()) for k, name in enumerate(names)}
    facts["groups"] = {name: len(ids) for name, ids in packing.groups.items()}
    if options.json:
        print(json.dumps(facts | further))
    else:
        parts = ", ".join(f"{facts[name]} {name}" for name in names)
        print(f"{options.output}: {packing.count} grains ({parts})")
        for name, value in further.items():
            print(f"{name}: {value:.3g}")
    return 0


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
    forms = forms_of(options)
    curve = None
    if options.gradation or options.sieves:
        curve = (
            read_gradation(options.gradation) if options.gradation else read_sieves(options.sieves)
        )
        # a grain of size 1 has the middle axis 1 m: it passes an opening of its size
        forms.axes = forms.axes / (2.0 * np.median(forms.axes, axis=1, keepdims=True))
        sizes = generate.sieved_sizes(options.count, *curve)
    else:
        rng = np.random.default_rng(options.seed + 1)
        sizes = generate.uniform_sizes(options.count, options.spread, rng)
    box = np.array(options.box)
    plain = len(forms.axes) == 1 and not formed(forms.skew, forms.exponent).any()
    made = generate.cloud(
        sizes, box, forms.axes[0], options.seed, watch=watch, periodic=options.periodic,
        forms=None if plain else forms,
    )  # fmt: skip
    if curve is None:
        return finish(options, made)
    error = generate.check_gradation(made, *curve)
    return finish(options, made, facts={"sieve curve, largest error of the mass": error})


def forms_of(options: argparse.Namespace) -> Forms:
    """Return the forms that a cloud is made of: those of a table, or one of the options."""
    if (options.axes is None) == (options.shapes is None):
        raise FaultError("E507", "a cloud requires --axes or --shapes, one of the two")
    if options.shapes is not None:
        if options.exponent != LEAST_EXPONENT or any(options.skew):
            raise FaultError("E507", "--skew and --exponent belong in the table of --shapes")
        return read_table(options.shapes)
    axes, skew = np.array(options.axes), np.array(options.skew)
    check_row(np.concatenate([axes * (1.0 + skew), axes * (1.0 - skew), [options.exponent]]), "")
    return Forms(axes[None], skew[None], np.array([options.exponent]))


def read_gradation(texts: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return openings [m] and shares of the mass from words OPENING:SHARE."""
    try:
        pairs = [[float(part) for part in text.split(":")] for text in texts]
        openings, passing = np.array(pairs, float).reshape(len(texts), 2).T
    except ValueError as fault:
        hint = "OPENING:SHARE, as 2e-3:0 3e-3:0.4 5e-3:1"
        raise FaultError("E514", f"'{' '.join(texts)}' is no sieve curve", hint) from fault
    return openings, passing


def read_sieves(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return openings [m] and shares of the mass of a file, a row a sieve; '#' is a comment."""
    rows = []
    for number_, words in table_rows(path):
        try:
            opening, passes = (float(word) for word in words)
        except ValueError as fault:
            hint = "a row is: opening [m] and share of the mass that passes, as 3e-3 0.4"
            place = f"{path}:{number_}"
            raise FaultError("E514", f"'{' '.join(words)}' is no sieve", hint, place) from fault
        rows.append((opening, passes))
    if not rows:
        raise FaultError("E514", f"{path} holds no sieves", "a row is: opening [m] and share")
    openings, passing = np.array(rows).T
    return openings, passing


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
