"""What the sub-commands of `talus pack` share: options of grains, and the end of each."""

import argparse
import json
from pathlib import Path

import numpy as np

from talus import generate
from talus.arguments import counting, natural, number, positive, share
from talus.faults import FaultError
from talus.forms import LEAST_EXPONENT, TABLE, Forms, check_row, formed, read_table, table_rows
from talus.gradations import LAWS, law_curve, quarters
from talus.packing import Packing, write_packing_file
from talus.progress import watch


def sub_command(
    pack: argparse._SubParsersAction, name: str, run: object, text: str
) -> argparse.ArgumentParser:
    """Add one sub-command with the options that all share."""
    parser = pack.add_parser(name, help=text)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--json", action="store_true", help="say what was made as JSON")
    parser.set_defaults(run=run)
    return parser


def axes_option(parser: argparse.ArgumentParser, name: str, text: str, **options: object) -> None:
    """Add an option of three lengths."""
    parser.add_argument(name, type=positive, nargs=3, metavar="L", help=text, **options)


def form_options(parser: argparse.ArgumentParser) -> None:
    """Add what makes grains other than ellipsoids."""
    parser.add_argument(
        "--skew", type=number, nargs=3, metavar="S", default=(0.0, 0.0, 0.0),
        help="poly-ellipsoids: semi-axes (1 + S) on the positive and (1 - S) on the negative sides",
    )  # fmt: skip
    parser.add_argument(
        "--exponent", type=number, default=2.0, help="superquadrics: 2 is an ellipsoid, 10 a box"
    )


def cloud_options(new: argparse.ArgumentParser) -> None:
    """Add what a cloud of grains is made of."""
    new.add_argument("--count", type=counting, required=True)
    axes_option(new, "--axes", "semi-axes [m]; with a sieve curve or a law their ratios")
    form_options(new)
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
    sizes.add_argument(
        "--distribution", nargs=5, metavar=("LAW", "FIRST", "SECOND", "LEAST", "LARGEST"),
        help="sizes of the middle axes by a law of the mass between two limits [m]; "
        + "; ".join(f"{law}: {text}" for law, text in LAWS.items()).replace("%", "%%"),
    )  # fmt: skip
    new.add_argument("--seed", type=natural, default=1)


def grains_of(options: argparse.Namespace) -> tuple[Forms, np.ndarray, tuple | None]:
    """Return forms, sizes (count) and, where it is asked, the sieve curve of a cloud."""
    forms = forms_of(options)
    if not (options.gradation or options.sieves or options.distribution):
        rng = np.random.default_rng(options.seed + 1)
        return forms, generate.uniform_sizes(options.count, options.spread, rng), None
    curve, whole = curve_of(options)
    # a grain of size 1 has the middle axis 1 m: it passes an opening of its size
    forms.axes = forms.axes / (2.0 * np.median(forms.axes, axis=1, keepdims=True))
    return forms, generate.sieved_sizes(options.count, *whole), curve


def curve_of(options: argparse.Namespace) -> tuple[tuple, tuple]:
    """Return the sieve curve that grains are checked by, and all of it that they are made by."""
    if options.distribution:
        whole = law_curve(options.distribution)
        return quarters(*whole), whole
    read = read_gradation(options.gradation) if options.gradation else read_sieves(options.sieves)
    return read, read


def cloud_of(
    options: argparse.Namespace, forms: Forms, sizes: np.ndarray, box: np.ndarray, periodic: bool
) -> Packing:
    """Return a cloud of these forms and sizes in a box [m]."""
    plain = len(forms.axes) == 1 and not formed(forms.skew, forms.exponent).any()
    return generate.cloud(
        sizes, box, forms.axes[0], options.seed, watch=watch, periodic=periodic,
        forms=None if plain else forms,
    )  # fmt: skip


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


def finish(
    options: argparse.Namespace, packing: Packing, header: str = "", facts: dict | None = None
) -> int:
    """Write the packing and say what it holds, with further facts."""
    write_packing_file(options.output, packing, header)
    return report(options, packing, facts)


def report(options: argparse.Namespace, packing: Packing, facts: dict | None = None) -> int:
    """Say what a packing that was written holds, with further facts."""
    names = ("free", "fixed", "driven")
    further = facts or {}
    facts = {"file": str(options.output), "grains": packing.count}
    facts |= {name: int((packing.kind == k).sum()) for k, name in enumerate(names)}
    facts["groups"] = {name: len(ids) for name, ids in packing.groups.items()}
    if options.json:
        print(json.dumps(facts | plain(further)))
    else:
        parts = ", ".join(f"{facts[name]} {name}" for name in names)
        print(f"{options.output}: {packing.count} grains ({parts})")
        print_facts(further)
    return 0


def plain(facts: dict) -> dict:
    """Return facts as JSON takes them."""
    return {name: np.asarray(value).tolist() for name, value in facts.items()}


def print_facts(facts: dict) -> None:
    """Print a line a fact, numbers with four digits."""
    for name, value in facts.items():
        print(f"{name}: {', '.join(f'{part:.4g}' for part in np.ravel(value))}")
