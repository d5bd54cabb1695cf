"""`talus pack column` and `talus pack check-tile`: beds under gravity of a tile; what tiles are."""

import argparse
import json
from pathlib import Path

from talus.arguments import number, positive
from talus.column import Bed, make_column
from talus.column_stamp import is_column, read_column_stamp, stamp_of, write_column
from talus.commands.pack_cloud import plain, print_facts, report
from talus.faults import FaultError
from talus.packing import read_packing
from talus.tile_check import column_facts, tile_facts
from talus.tile_stamp import read_stamp


def register_column(new: argparse.ArgumentParser) -> None:
    """Add the options of a column."""
    new.add_argument("tile", type=Path, help="a tile of talus pack tile")
    new.add_argument("--height", type=positive, required=True, help="of the free bed [m]")
    new.add_argument("--surcharge", type=number, default=0.0, help="on the surface [Pa]")
    new.add_argument("--gravity", type=positive, default=9.81, help="downwards [m/s2]")
    new.add_argument(
        "--work", type=Path, metavar="FOLDER",
        help="folder of the stages, beside the column by default; what has finished is kept",
    )  # fmt: skip


def register_check(new: argparse.ArgumentParser) -> None:
    """Add the options of a check."""
    new.add_argument("source", type=Path, help="a tile or a column")
    new.add_argument("--json", action="store_true", help="say it as JSON")


def column(options: argparse.Namespace) -> int:
    """Make a column and say what it is."""
    if options.surcharge < 0.0:
        raise FaultError("E500", f"--surcharge {options.surcharge:g} is below 0")
    if options.output.suffix != ".h5":
        raise FaultError("E516", f"{options.output}: a column holds contacts", "name it NAME.h5")
    tile, stamp = read_packing(options.tile), read_stamp(options.tile)
    bed = Bed(options.height, options.surcharge, options.gravity)
    work = options.work or options.output.with_name(f"{options.output.stem}_stages")
    say = (lambda text: None) if options.json else (lambda text: print(text, flush=True))
    made = make_column(tile, stamp, bed, work, say)
    new = stamp_of(made, stamp, tile.count, bed)
    write_column(options.output, made.packing, new)
    return report(options, made.packing, column_facts(made.packing, new))


def check(options: argparse.Namespace) -> int:
    """Say what a tile or a column is, from its grains and a run of one step."""
    packing = read_packing(options.source)
    if is_column(options.source):
        facts = column_facts(packing, read_column_stamp(options.source))
    else:
        facts = tile_facts(packing, read_stamp(options.source))
    if options.json:
        print(json.dumps({"file": str(options.source), "grains": packing.count} | plain(facts)))
    else:
        print(f"{options.source}: {packing.count} grains")
        print_facts(facts)
    return 0
