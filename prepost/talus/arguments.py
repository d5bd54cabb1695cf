"""Words of the command line: numbers with bounds, and faults in the form of all others."""

import argparse
import difflib
import math
import re
from typing import NoReturn

from talus.faults import FaultError


class Parser(argparse.ArgumentParser):
    """A parser whose faults are E500 with exit code 1 and name the nearest word."""

    def error(self, message: str) -> NoReturn:
        """Raise the fault that argparse found."""
        hint = f"see {self.prog} --help"
        wrong = re.search(r"invalid choice: '([^']*)' \(choose from (.*)\)", message)
        known = None
        if wrong:
            known = (wrong.group(1), re.findall(r"[\w.-]+", wrong.group(2)))
        elif unknown := re.search(r"unrecognized arguments: (-\S+)", message):
            known = (unknown.group(1), options_of(self))
        if known and (near := difflib.get_close_matches(*known, 1)):
            hint = f"did you mean '{near[0]}'?"
        raise FaultError("E500", message, hint, self.prog)


def options_of(parser: argparse.ArgumentParser) -> list[str]:
    """Return the options of a parser and of all its sub-commands."""
    found = list(parser._option_string_actions)
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for one in action.choices.values():
                found += options_of(one)
    return found


def number(text: str) -> float:
    """Return a finite number."""
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text} is not finite")
    return value


def positive(text: str) -> float:
    """Return a finite number above 0."""
    value = number(text)
    if value <= 0.0:
        raise argparse.ArgumentTypeError(f"{text} must be above 0")
    return value


def share(text: str) -> float:
    """Return a number from 0 to less than 1."""
    value = number(text)
    if not 0.0 <= value < 1.0:
        raise argparse.ArgumentTypeError(f"{text} must be from 0 to less than 1")
    return value


def natural(text: str) -> int:
    """Return a whole number from 0."""
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} must not be negative")
    return value


def counting(text: str) -> int:
    """Return a whole number from 1."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} must be at least 1")
    return value
