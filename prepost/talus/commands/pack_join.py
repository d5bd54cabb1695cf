"""`talus pack join`: two tiles of one making in one periodic cell, with mosaics where they meet."""

import argparse
from pathlib import Path

import numpy as np

from talus.arguments import positive
from talus.commands.pack_cloud import report
from talus.faults import FaultError
from talus.packing import read_packing
from talus.tile_join import BAND, join_tiles
from talus.tile_stamp import read_stamp, write_tile


def register(new: argparse.ArgumentParser) -> None:
    """Add the options of a seam."""
    new.add_argument("first", type=Path, help="a tile of talus pack tile")
    new.add_argument("second", type=Path, help="another one of the same material and stress")
    new.add_argument("--axis", choices=("x", "y", "z"), default="x", help="along which they lie")
    new.add_argument(
        "--band", type=positive, default=BAND, metavar="D",
        help=f"width in which grains of both are chosen, in mean diameters ({BAND:g})",
    )  # fmt: skip
    new.add_argument(
        "--work", type=Path, metavar="FOLDER",
        help="folder of the stages, beside the tile by default; what has finished there is kept",
    )  # fmt: skip


def join(options: argparse.Namespace) -> int:
    """Join two tiles and say what became of them."""
    if options.output.suffix != ".h5":
        raise FaultError("E516", f"{options.output}: a tile holds contacts", "name it NAME.h5")
    paths = options.first, options.second
    tiles, stamps = (tuple(read(path) for path in paths) for read in (read_packing, read_stamp))
    work = options.work or options.output.with_name(f"{options.output.stem}_stages")
    say = (lambda text: None) if options.json else (lambda text: print(text, flush=True))
    axis = "xyz".index(options.axis)
    made = join_tiles(tiles, stamps, axis, options.band, work, say)
    write_tile(options.output, made.packing, made.stamp)
    parts = [float(stamp.coordination) for stamp in stamps]
    mean = np.average(parts, weights=[tile.count for tile in tiles])
    facts = {
        "volume of the grains that stay / of both": made.volume,
        "solid fraction": made.stamp.solid_fraction,
        "coordination number / mean of both": made.stamp.coordination / mean,
        "energy lost / elastic": made.loss,
        "strain of the edges": made.strain,
        "mean stress [Pa]": float(np.trace(made.stamp.stress) / 3.0),
        "edges [m]": made.packing.cell.diagonal(),
    }
    return report(options, made.packing, facts)
