"""`talus render`: an image of grains as ellipsoids with the block around them cut away."""

import argparse
from pathlib import Path

from talus import network, picture_series, pictures, sets_picture
from talus.arguments import counting


def pixels(text: str) -> int:
    """Return a width or height that an image can have."""
    value = int(text)
    if not 50 <= value <= 8000:
        raise argparse.ArgumentTypeError(f"{text} is not from 50 to 8000 pixels")
    return value


def register(commands: argparse._SubParsersAction) -> None:
    """Add `render`."""
    new = commands.add_parser("render", help="image of grains and solid (needs pyvista)")
    new.add_argument("grains", type=Path, help="field file of the grains")
    new.add_argument("--solid", type=Path, help="field file of the solid")
    new.add_argument("--network", action="store_true", help="contacts as tubes, by their force")
    new.add_argument(
        "--sets", type=Path, help="*_sets.h5 of a run with overlap: colours by set (needs --solid)"
    )
    new.add_argument("--step", type=int, default=-1, help="step, negative from the end")
    new.add_argument(
        "--every", type=counting, metavar="N", help="every Nth step: numbered PNGs, or one .gif"
    )
    new.add_argument("--color", choices=sorted(pictures.COLOURS_OF), default="displacement")
    new.add_argument(
        "--size", type=pixels, nargs=2, default=(1400, 1050), help="width and height [pixels]"
    )
    new.add_argument("-o", "--output", type=Path, default=Path("view3d.png"))
    new.set_defaults(run=render)


def render(options: argparse.Namespace) -> int:
    """Write the image and print its name."""
    if options.network:
        network.render(options.grains, options.step, options.output, tuple(options.size))
        print(options.output)
        return 0
    if options.sets:
        sets_picture.render(
            options.grains, options.solid, options.sets, options.step, options.output,
            tuple(options.size),
        )  # fmt: skip
        print(options.output)
        return 0
    look = pictures.Look(options.color, tuple(options.size))
    if options.every:
        for path in picture_series.write(
            options.grains, options.solid, options.every, options.output, look
        ):
            print(path)
        return 0
    pictures.render(options.grains, options.solid, options.step, options.output, look)
    print(options.output)
    return 0
