"""Named results of a point: read from histories and JSON files, or made of others."""

import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from talus import histories
from talus.faults import FaultError
from talus.study.expressions import check_expression, evaluate
from talus.study.faults import check_words, nearest, take

TAKES = ("end", "mean", "min", "max", "first")
WORDS = {
    "column": ("file", "column", "take", "over", "from", "to", "where"),
    "json": ("file", "json"),
    "expression": ("expression",),
}


@dataclass
class Result:
    """A result: its name and label, and the words of its kind."""

    name: str
    label: str
    kind: str
    words: dict


@dataclass
class Curve:
    """A curve of every point: file, its columns of abscissa and ordinate."""

    name: str
    file: str
    x: str
    y: str


def read_result(entry: dict, known: list[str], place: str) -> Result:
    """Return a result of the study file; `known` are the names an expression may use."""
    name = take(entry, "name", str, place)
    place = f"{place} ({name})"
    kinds = [kind for kind in WORDS if kind in entry]
    if len(kinds) != 1:
        hint = "file and column; file and json; expression"
        raise FaultError("E580", "a result is a column, a json key or an expression", hint, place)
    kind = kinds[0]
    check_words(entry, ("name", "label", "unit", *WORDS[kind]), place)
    if kind == "expression":
        check_expression(take(entry, "expression", str, place), known, place)
    else:
        take(entry, "file", str, place)
        take(entry, kind, str, place)
    for value in take(entry, "where", dict, place, {}).values():
        if not isinstance(value, int | float):
            raise FaultError("E580", f"where: {value!r} is no number", "{ wall = 1 }", place)
    how = take(entry, "take", str, place, "end")
    if how not in TAKES:
        raise FaultError("E580", f"take = '{how}'", nearest(how, TAKES), place)
    low = take(entry, "from", (int, float), place, -math.inf)
    high = take(entry, "to", (int, float), place, math.inf)
    if low >= high:
        raise FaultError("E580", f"the window from {low:g} to {high:g} is empty", "", place)
    label, unit = take(entry, "label", str, place, name), take(entry, "unit", str, place, "")
    return Result(name, f"{label} [{unit}]" if unit else label, kind, entry)


def read_curve(entry: dict, place: str) -> Curve:
    """Return a curve of the study file."""
    check_words(entry, ("name", "file", "x", "y"), place)
    return Curve(*(take(entry, word, str, place) for word in ("name", "file", "x", "y")))


def read_history(path: Path) -> histories.History:
    """Return a history of a point, or raise E590."""
    if not path.is_file():
        names = sorted(p.name for p in path.parent.glob("*.csv"))
        raise FaultError("E590", f"the point has no file '{path.name}'", nearest(path.name, names))
    try:
        return histories.read(path)
    except FaultError as fault:
        raise FaultError("E590", f"{path.name}: {fault.message}", fault.hint) from fault


def column_of(history: histories.History, name: str) -> np.ndarray:
    """Return a column by its name, or raise E590 with the nearest one."""
    if name not in history.columns:
        hint = nearest(name, history.columns)
        raise FaultError("E590", f"{history.path.name} has no column '{name}'", hint)
    return history.columns[name]


def of_column(folder: Path, words: dict) -> float:
    """Return the end, mean, ... of a column, over a window of another one (default the first)."""
    history = read_history(folder / words["file"])
    values = column_of(history, words["column"])
    over = column_of(history, words.get("over", next(iter(history.columns))))
    inside = (over >= words.get("from", -math.inf)) & (over <= words.get("to", math.inf))
    for name, value in words.get("where", {}).items():
        inside &= column_of(history, name) == value
    if not inside.any():
        seen = f"{over.min():g} to {over.max():g}" if over.size else "no row"
        text = f"{words['file']} has no row in the window or none that 'where' asks for"
        raise FaultError("E590", text, f"it has {seen}")
    values, how = values[inside], words.get("take", "end")
    if how in ("end", "first"):
        return float(values[-1 if how == "end" else 0])
    return float({"mean": np.mean, "min": np.min, "max": np.max}[how](values))


def of_json(folder: Path, words: dict) -> float:
    """Return a number of a JSON file; dots go into tables and lists."""
    path = folder / words["file"]
    try:
        value = json.loads(path.read_text())
    except (OSError, ValueError) as fault:
        raise FaultError("E590", f"{path.name} cannot be read: {fault}") from fault
    for word in words["json"].split("."):
        if isinstance(value, list) and word.isdigit() and int(word) < len(value):
            value = value[int(word)]
        elif isinstance(value, dict) and word in value:
            value = value[word]
        else:
            known = value if isinstance(value, dict) else []
            text = f"{path.name} has no '{word}' of '{words['json']}'"
            raise FaultError("E590", text, nearest(word, known))
    if not isinstance(value, int | float):
        raise FaultError("E590", f"'{words['json']}' of {path.name} is no number: {value!r}")
    return float(value)


def collect_point(folder: Path, results: list[Result], values: dict) -> dict[str, float]:
    """Return every result of a finished point by name."""
    numbers: dict[str, object] = dict(values)
    for one in results:
        if one.kind == "expression":
            numbers[one.name] = evaluate(one.words["expression"], numbers)
        else:
            work = of_column if one.kind == "column" else of_json
            numbers[one.name] = work(folder, one.words)
        if not math.isfinite(numbers[one.name]):
            raise FaultError("E590", f"result '{one.name}' is {numbers[one.name]}")
    return {one.name: numbers[one.name] for one in results}
