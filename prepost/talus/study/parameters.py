"""Parameters of a study: where they go, and which value belongs to a share of 0 to 1."""

import math
import re
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from talus.faults import FaultError
from talus.study.faults import check_words, nearest, take

WORDS = {
    "uniform": ("low", "high"),
    "log_uniform": ("low", "high"),
    "integer": ("low", "high"),
    "normal": ("mean", "deviation"),
    "log_normal": ("median", "factor"),
}
OPTIONAL = {"normal": ("low", "high"), "log_normal": ("low", "high")}
COMMON = ("name", "deck", "key", "values", "distribution", "base", "label", "unit", "repeat")
NAME = re.compile(r"[A-Za-z_]\w*$")
KEY = re.compile(r"&?(\w+)(?:\[([^\]]+)\])?\.(\w+)(?:\((\d+)\))?$")
SMALL = 1.0e-12  # of a share, away from the ends of a distribution without ends


@dataclass
class Target:
    """A key of a deck: group, which of them, key, which component (from 1; 0: all)."""

    deck: str
    group: str
    which: str
    key: str
    component: int


@dataclass
class Parameter:
    """A parameter: its name, the keys it is written to (none: a word of commands), its values."""

    name: str
    label: str
    targets: list[Target]
    values: list
    distribution: str
    numbers: dict[str, float]
    base: object
    repeat: bool = False  # over whose values results are averaged

    @property
    def is_list(self) -> bool:
        """Whether it has a list of values."""
        return bool(self.values)

    def at(self, share: float) -> object:
        """Return the value at a share from 0 to 1 of its distribution."""
        if self.values:
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        n = self.numbers
        if self.distribution == "uniform":
            return n["low"] + share * (n["high"] - n["low"])
        if self.distribution == "log_uniform":
            return n["low"] * (n["high"] / n["low"]) ** share
        if self.distribution == "integer":
            return min(int(n["low"] + math.floor(share * (n["high"] - n["low"] + 1))), n["high"])
        return self.bell(share)

    def bell(self, share: float) -> float:
        """Return the value of a normal or log-normal distribution, cut at low and high."""
        n, log = self.numbers, self.distribution == "log_normal"
        change = math.log if log else float
        bell = NormalDist(math.log(n["median"]), math.log(n["factor"])) if log else NormalDist(
            n["mean"], n["deviation"])  # fmt: skip
        low = bell.cdf(change(n["low"])) if "low" in n else 0.0
        high = bell.cdf(change(n["high"])) if "high" in n else 1.0
        share = min(max(low + share * (high - low), SMALL), 1.0 - SMALL)
        value = math.exp(bell.inv_cdf(share)) if log else bell.inv_cdf(share)
        return min(max(value, n.get("low", -math.inf)), n.get("high", math.inf))

    def middle(self) -> object:
        """Return the value about which one parameter at a time is changed."""
        return self.at(0.5) if self.base is None else self.base

    def levels(self, count: int) -> list:
        """Return the values of a grid: the list, or `count` from the lower to the upper end."""
        if self.values:
            return list(self.values)
        ends = self.distribution in ("uniform", "log_uniform", "integer")
        shares = np.linspace(0.0, 1.0, count) if ends else (np.arange(count) + 0.5) / count
        if self.distribution == "integer":
            found = np.linspace(self.numbers["low"], self.numbers["high"], count)
            return list(dict.fromkeys(int(round(value)) for value in found))
        return [self.at(float(share)) for share in shares]


def read_targets(entry: dict, place: str) -> list[Target]:
    """Return the keys that a parameter is written to."""
    keys = entry.get("key", [])
    keys = [keys] if isinstance(keys, str) else keys
    if keys and not isinstance(entry.get("deck"), str):
        raise FaultError("E580", "a key needs the name of its deck", "deck = 'grains.nml'", place)
    if "deck" in entry and not keys:
        raise FaultError("E580", "a deck needs a key", "key = 'contact.friction'", place)
    targets = []
    for text in keys:
        found = KEY.match(text.strip()) if isinstance(text, str) else None
        if not found:
            hint = "group.key, group[2].key, group[id].key, group.key(3)"
            raise FaultError("E581", f"'{text}' is no key of a deck", hint, place)
        group, which, key, component = found.groups()
        targets.append(Target(entry["deck"], group.lower(), (which or "").strip("'\" "),
                              key.lower(), int(component or 0)))  # fmt: skip
    return targets


def check_numbers(kind: str, numbers: dict, place: str) -> None:
    """Refuse (E584) bounds and widths that make no distribution."""
    low, high = numbers.get("low", -math.inf), numbers.get("high", math.inf)
    if not all(math.isfinite(value) for value in numbers.values()):
        raise FaultError("E584", "a number of the distribution is not finite", "", place)
    if low >= high:
        raise FaultError("E584", f"low = {low:g} is not below high = {high:g}", "", place)
    if kind == "log_uniform" and low <= 0.0:
        raise FaultError("E584", f"log_uniform needs low above 0, not {low:g}", "", place)
    if kind == "integer" and (low != int(low) or high != int(high)):
        raise FaultError("E584", "integer needs whole low and high", "", place)
    if kind == "normal" and numbers["deviation"] <= 0.0:
        raise FaultError("E584", "deviation must be above 0", "", place)
    if kind == "log_normal" and (numbers["median"] <= 0.0 or numbers["factor"] <= 1.0 or low == 0):
        hint = "factor: of one standard deviation"
        raise FaultError("E584", "median and low must be above 0, factor above 1", hint, place)


def read_parameter(entry: dict, place: str) -> Parameter:
    """Return a parameter of the study file."""
    name = take(entry, "name", str, place)
    place = f"{place} ({name})"
    if not NAME.match(name):
        raise FaultError("E580", f"'{name}' is no name", "letters, digits, _", place)
    kind = take(entry, "distribution", str, place, "uniform")
    if kind not in WORDS:
        raise FaultError("E584", f"unknown distribution '{kind}'", nearest(kind, WORDS), place)
    values = take(entry, "values", list, place, [])
    wanted = () if values else WORDS[kind]
    check_words(entry, (*COMMON, *wanted, *(() if values else OPTIONAL.get(kind, ()))), place)
    if "values" in entry and not values:
        raise FaultError("E584", "the list of values is empty", "", place)
    if any(isinstance(value, dict | list) for value in values):
        raise FaultError("E584", "values are numbers, words, true or false", "", place)
    if len(set(map(repr, values))) < len(values):
        raise FaultError("E584", "a value is there twice", "", place)
    if values and "distribution" in entry:
        raise FaultError("E584", "values and distribution exclude each other", "", place)
    both = wanted + (() if values else OPTIONAL.get(kind, ()))
    numbers = {word: take(entry, word, (int, float), place)
               for word in both if word in entry or word in wanted}  # fmt: skip
    if not values:
        check_numbers(kind, numbers, place)
    label = take(entry, "label", str, place, name)
    unit = take(entry, "unit", str, place, "")
    return Parameter(name, f"{label} [{unit}]" if unit else label, read_targets(entry, place),
                     values, kind, numbers, entry.get("base"),
                     take(entry, "repeat", bool, place, False))  # fmt: skip
