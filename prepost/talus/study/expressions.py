"""Expressions of one line over named numbers: arithmetic, comparisons and functions of math."""

import ast
import math
from collections.abc import Mapping

from talus.faults import FaultError
from talus.study.faults import nearest

NAMES = (
    "sqrt", "exp", "log", "log10", "sin", "cos", "tan", "asin", "acos", "atan", "atan2",
    "degrees", "radians", "hypot", "floor", "ceil",
)  # fmt: skip
FUNCTIONS = {name: getattr(math, name) for name in NAMES} | {"abs": abs, "min": min, "max": max}
NUMBERS = {"pi": math.pi, "e": math.e}
ALLOWED = (ast.Expression, ast.BinOp, ast.UnaryOp, ast.Call, ast.Name, ast.Load, ast.Constant,
           ast.Compare, ast.IfExp, ast.BoolOp, ast.operator, ast.unaryop, ast.cmpop,
           ast.boolop)  # fmt: skip


def check_expression(text: str, known: list[str], place: str) -> None:
    """Refuse (E591) what is no expression or has a name that is not known."""
    try:
        tree = ast.parse(text, mode="eval")
    except (SyntaxError, ValueError) as fault:
        raise FaultError("E591", f"'{text}' is no expression", str(fault), place) from fault
    names = [*known, *FUNCTIONS, *NUMBERS]
    for node in ast.walk(tree):
        if not isinstance(node, ALLOWED):
            kind = type(node).__name__
            raise FaultError("E591", f"'{text}': {kind} is not allowed", "arithmetic only", place)
        if isinstance(node, ast.Name) and node.id not in names:
            hint = nearest(node.id, [*known, *FUNCTIONS])
            raise FaultError("E591", f"'{text}' has an unknown name '{node.id}'", hint, place)
        if isinstance(node, ast.Call) and not (
            isinstance(node.func, ast.Name) and node.func.id in FUNCTIONS and not node.keywords
        ):
            hint = ", ".join(FUNCTIONS)
            raise FaultError("E591", f"'{text}' calls what is no function", hint, place)


def evaluate(text: str, numbers: Mapping[str, object]) -> float:
    """Return the value of a checked expression; E590 where it has none at this point."""
    known = {"__builtins__": {}} | FUNCTIONS | NUMBERS | dict(numbers)
    try:
        return float(eval(compile(text, "study", "eval"), known))
    except (ArithmeticError, ValueError, TypeError) as fault:
        raise FaultError("E590", f"'{text}' has no value: {fault}") from fault
