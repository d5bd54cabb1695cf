"""`talus fit`: constants of a law of solids from element tests."""

import argparse
import json
import re
from pathlib import Path

import numpy as np

from talus import fit as fits
from talus import fit_breakage, fit_decks
from talus.faults import FaultError
from talus.files import write_text_file
from talus.fit_tests import Test, parse_test

CLOSE = 0.95  # correlation of constants that is printed
PER_CENT = 100.0
SIZES = ("grain_size_max", "grain_size_min", "fractal_dimension")  # grading_index excludes them
FRACTAL = 2.6  # fractal_dimension of the deck if left out


def register(commands: argparse._SubParsersAction) -> None:
    """Add `fit`."""
    new = commands.add_parser("fit", help="constants of a law from element tests")
    new.add_argument("deck", type=Path, help="deck of talus-fem; its &material is the start")
    text = "*_cell.csv or *_point.csv, with constants of this test alone"
    metavar = "TEST.csv[:NAME=VALUE,...]"
    new.add_argument("tests", nargs="+", metavar=metavar, help=text)
    new.add_argument("--free", nargs="+", required=True, metavar="NAME[=START]",
                     help="constants to fit, or labels that tests give constants")  # fmt: skip
    new.add_argument("--bounds", nargs="+", default=[], metavar="NAME=LOW:HIGH",
                     help="between which constants stay; either end may be empty")  # fmt: skip
    new.add_argument("--left-out", nargs="+", default=[], metavar=metavar,
                     help="tests that are not fitted, but judged with what was found")  # fmt: skip
    new.add_argument("--grading", type=Path, metavar="GRADING.csv",
                     help="of the first test: what it tells of law 'breakage'")  # fmt: skip
    new.add_argument("--out", type=Path, help="write the fit as JSON")
    new.add_argument("--points", type=Path, metavar="FOLDER",
                     help="write what the law does along each test, TEST_point.csv")  # fmt: skip
    new.add_argument("--deck", dest="fitted", metavar="NEW.nml", type=Path,
                     help="write the deck with the fitted constants")  # fmt: skip
    new.set_defaults(run=run)


def starts_of(words: list[str], material: str, deck: Path) -> dict[str, float]:
    """Return the free constants and where they begin: given, or in the deck."""
    found = {}
    for word in words:
        name, equals, value = word.partition("=")
        if equals:
            found[name] = number(value, f"--free {word}")
        else:
            found[name] = fit_decks.start_value(material, name, deck)
    return found


def name_apart(tests: list[Test], texts: list[str]) -> None:
    """Give tests of one name that of their folder, too; refuse a test given twice."""
    names = [test.name for test in tests]
    for test, text in zip(tests, texts, strict=True):
        if names.count(test.name) > 1:
            test.name = f"{Path(text.partition(':')[0]).resolve().parent.name}_{test.name}"
    names = [test.name for test in tests]
    for name in names:
        if names.count(name) > 1:
            hint = "name each file once, either fitted or left out"
            raise FaultError("E641", f"the test '{name}' is given twice", hint)


def number(text: str, place: str) -> float:
    """Return a number of the command."""
    try:
        return float(text)
    except ValueError as fault:
        raise FaultError("E560", f"{place}: '{text}' is no number") from fault


def begun_by_grading(material: str, deck: Path, test: Test, grading: Path) -> str:
    """Return the material with what a grading and a compression tell of `breakage`; print it."""
    if "breakage" not in re.findall(r"law\s*=\s*'(\w+)'", material):
        hint = "leave --grading out, or take law = 'breakage'"
        raise FaultError("E642", "gradings tell of no other law than breakage", hint, str(deck))
    known = {"fractal_dimension": FRACTAL}
    for name in ("poisson", "critical_slope", "grain_size_min", "fractal_dimension"):
        value = fit_decks.constant_of(material, name)
        known[name] = known.get(name) if value is None else value
        if known[name] is None:
            fit_decks.start_value(material, name, deck)
    found = fit_breakage.find(test, grading, known)
    print(f"grading: x_M = {found.largest:.4g} m, theta = {found.index:.4g}; yield at p = "
          f"{found.pressure:.4g} Pa: young = {found.young:.4g} Pa, E_c = {found.energy:.4g} Pa, "
          f"omega = {found.angle_deg:.4g} deg")  # fmt: skip
    return fit_decks.with_constants(fit_decks.without_constants(material, SIZES), found.constants())


def bounds_of(words: list[str], start: dict[str, float]) -> dict[str, tuple[float, float]]:
    """Return the bounds of constants, within which they must begin."""
    found = {}
    for word in words:
        name, _, ends = word.partition("=")
        low, colon, high = ends.partition(":")
        if not colon or name not in start:
            hint = f"--bounds NAME=LOW:HIGH of one of {', '.join(start)}"
            raise FaultError("E640", f"--bounds {word} bounds no free constant", hint)
        found[name] = (number(low or "-inf", f"--bounds {word}"),
                       number(high or "inf", f"--bounds {word}"))  # fmt: skip
        if not found[name][0] <= start[name] <= found[name][1] or found[name][0] == found[name][1]:
            text = f"{name} begins at {start[name]:g}, outside of {low}:{high}"
            raise FaultError("E640", text, f"begin within the bounds: --free {name}=START")
    return found


def told(found: fits.Fit, start: dict[str, float]) -> list[str]:
    """Return lines on the constants: values, deviations, and what the tests do not tell."""
    lines = [f"{'constant':24s} {'start':>12s} {'fit':>14s} {'deviation':>12s}"]
    for name, value, spread in zip(found.names, found.values, found.deviations, strict=True):
        last = "at its bound" if np.isnan(spread) else f"{spread:12.4g}"
        lines.append(f"{name:24s} {start[name]:12.6g} {value:14.8g} {last}")
    lines += [f"{name} is not determined: its deviation is larger than itself"
              for name in found.loose()]  # fmt: skip
    lines += [f"{one} and {other} are hardly told apart: correlation {share:.3f}"
              for one, other, share in found.pairs(CLOSE)]  # fmt: skip
    if not found.converged:
        lines.append(f"NOT CONVERGED in {found.steps} steps: hold some constants, or begin nearer")
    lines.append(f"residual {PER_CENT * found.residual:.4g} % of the largest stress, "
                 f"{found.points} stresses, {found.steps} steps")  # fmt: skip
    return lines


def told_tests(misfits: dict[str, float], left_out: dict[str, float]) -> list[str]:
    """Return lines on the misfit of each test."""
    lines = [f"{'test':40s} rms misfit over rms stress"]
    for title, group in (("", misfits), (", left out of the fit", left_out)):
        for name, value in group.items():
            text = "the law fails" if np.isnan(value) else f"{PER_CENT * value:.4g} %"
            lines.append(f"{name + title:40s} {text}")
    return lines


def facts_of(found: fits.Fit, tests: list[Test], left_out: dict[str, float]) -> dict:
    """Return the fit for JSON; what is not known is null."""
    plain = [None if np.isnan(v) else float(v) for v in found.deviations]
    rows = [[None if np.isnan(v) else float(v) for v in row] for row in found.correlation]
    return {
        "constants": dict(zip(found.names, map(float, found.values), strict=True)),
        "deviations": dict(zip(found.names, plain, strict=True)),
        "correlation": rows,
        "converged": found.converged,
        "at_bound": found.at_bound,
        "not_determined": found.loose(),
        "residual": found.residual,
        "points": found.points,
        "tests": [test.name for test in tests],
        "misfit": known(found.misfits),
        "misfit_left_out": known(left_out),
    }


def known(values: dict[str, float]) -> dict[str, float | None]:
    """Return numbers for JSON, null where there is none."""
    return {name: None if np.isnan(value) else value for name, value in values.items()}


def write_deck(options: argparse.Namespace, material: str, found: fits.Fit) -> None:
    """Write the deck with what was fitted, and what the grading told."""
    values = dict(zip(found.names, map(float, found.values), strict=True))
    constants = {n: v for n, v in values.items() if fit_decks.constant_of(material, n) is not None}
    drop = ()
    if options.grading:
        told_by = ("young", "breakage_energy", "breakage_angle_deg", "grading_index")
        constants = {n: fit_decks.constant_of(material, n) for n in told_by} | constants
        drop = SIZES
    write_text_file(options.fitted, fit_decks.fitted_deck(options.deck, constants, drop))


def run(options: argparse.Namespace) -> int:
    """Fit, print constants with standard deviations, write them and a deck with them."""
    if options.fitted and options.fitted.resolve() == options.deck.resolve():
        text = f"--deck {options.fitted} is the deck where the fit begins"
        raise FaultError("E636", text, "name another: the start is wanted again")
    material = fit_decks.read_material(options.deck)
    tests, others = ([parse_test(t) for t in texts] for texts in (options.tests, options.left_out))
    if options.grading:
        material = begun_by_grading(material, options.deck, tests[0], options.grading)
    start = starts_of(options.free, material, options.deck)
    bounds = bounds_of(options.bounds, start)
    name_apart([*tests, *others], [*options.tests, *options.left_out])
    found = fits.fit(material, start, tests, bounds)
    if options.points:
        fits.judge(material, found, tests, options.points)
    left_out = fits.judge(material, found, others, options.points)
    print("\n".join(told(found, start) + told_tests(found.misfits, left_out)))
    if options.fitted:
        write_deck(options, material, found)
    if options.out:
        facts = json.dumps(facts_of(found, tests, left_out), indent=1)
        write_text_file(options.out, facts + "\n")
    return 0
