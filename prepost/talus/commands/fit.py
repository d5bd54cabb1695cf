"""`talus fit`: constants of a law of solids from element tests."""

import argparse
import json
from pathlib import Path

from talus import fit as fits
from talus.faults import FaultError
from talus.files import write_text_file


def register(commands: argparse._SubParsersAction) -> None:
    """Add `fit`."""
    new = commands.add_parser("fit", help="constants of a law from element tests")
    new.add_argument("deck", type=Path, help="deck of talus-fem; its &material is the start")
    text = "*_cell.csv or *_point.csv, with constants of this test alone"
    new.add_argument("tests", nargs="+", metavar="TEST.csv[:NAME=VALUE,...]", help=text)
    new.add_argument("--free", nargs="+", required=True, metavar="NAME", help="constants to fit")
    new.add_argument("--out", type=Path, help="write the fit as JSON")
    new.add_argument("--deck", dest="fitted", metavar="NEW.nml", type=Path,
                     help="write the deck with the fitted constants")  # fmt: skip
    new.set_defaults(run=run)


def split_test(text: str) -> fits.Test:
    """Read a test and its own constants."""
    name, _, rest = text.partition(":")
    own = {}
    for part in filter(None, rest.split(",")):
        key, _, value = part.partition("=")
        try:
            own[key.strip()] = float(value)
        except ValueError as fault:
            hint = "TEST.csv:void_ratio=0.8"
            raise FaultError("E560", f"'{part}' is no constant of a test", hint) from fault
    return fits.read_test(Path(name), own)


def run(options: argparse.Namespace) -> int:
    """Fit, print constants with standard deviations, write them and a deck with them."""
    if options.fitted and options.fitted.resolve() == options.deck.resolve():
        text = f"--deck {options.fitted} is the deck where the fit begins"
        raise FaultError("E636", text, "name another: the start is wanted again")
    material = fits.read_material(options.deck)
    start = {name: fits.start_value(material, name, options.deck) for name in options.free}
    tests = [split_test(text) for text in options.tests]
    found = fits.fit(material, start, tests)
    print(f"{'constant':24s} {'start':>12s} {'fit':>14s} {'deviation':>12s}")
    for name, value, spread in zip(found.names, found.values, found.deviations, strict=True):
        print(f"{name:24s} {start[name]:12.6g} {value:14.8g} {spread:12.4g}")
    print(f"residual {100 * found.residual:.4g} % of the largest stress, {found.points} stresses, "
          f"{found.steps} steps")  # fmt: skip
    constants = dict(zip(found.names, map(float, found.values), strict=True))
    if options.fitted:
        write_text_file(options.fitted, fits.fitted_deck(options.deck, constants))
    if options.out:
        facts = {
            "constants": constants,
            "deviations": dict(zip(found.names, map(float, found.deviations), strict=True)),
            "correlation": found.correlation.tolist(),
            "residual": found.residual,
            "points": found.points,
            "tests": [test.name for test in tests],
        }
        write_text_file(options.out, json.dumps(facts, indent=1) + "\n")
    return 0
