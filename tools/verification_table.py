"""All cases of verification with their last results: a table, counts, and a badge as SVG."""

import html
import json
import math
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
AREAS = ("dem", "fem", "couple")
VALIDATION = "validation"  # experiments: their bands may be missed, so that no badge counts them
BADGE = "verification.svg"
STATES = ("pass", "fail", "not run")
GOOD, BAD, PART = "#1f8f4d", "#c0182b", "#8a6d00"
LETTER = 6.6  # width of a letter of the badge [px]


def all_cases(root: Path = ROOT) -> list[dict]:
    """Return the facts of every case.toml, with area and folder, in the order of the chapter."""
    found = []
    for area in (*AREAS, VALIDATION):
        for path in sorted((root / "verification" / area).glob("*/case.toml")):
            facts = tomllib.loads(path.read_text(encoding="utf-8"))
            found.append(facts | {"area": area, "folder": path.parent})
    return found


def results(folder: Path) -> tuple[dict[str, dict], str]:
    """Return the last results by the id of their case, and the version that gave them."""
    path = folder / "summary.json"
    if not path.exists():
        return {}, ""
    data = json.loads(path.read_text(encoding="utf-8"))
    return {case["id"]: case for case in data["cases"]}, data.get("version", "?")


def state_of(result: dict | None) -> str:
    """Return whether a case passed, failed or was not run."""
    if result is None:
        return "not run"
    return "pass" if result["pass"] else "fail"


def counted(facts: list[dict], found: dict[str, dict]) -> dict[str, int]:
    """Return how many cases of verification passed, failed and were not run."""
    states = [state_of(found.get(f["id"])) for f in facts if f["area"] != VALIDATION]
    return {state: states.count(state) for state in STATES}


def used(metric: dict) -> float:
    """Return the part of its limit that a metric uses; above 1 it fails.

    With an expected value that is |value - expected| / limit, else value / limit below a limit and
    limit / value above one. A limit of zero that is met is not used at all.
    """
    value, limit, expected = metric["value"], metric["limit"], metric.get("expected")
    if value is None:
        return math.inf
    if expected is not None:
        value = abs(value - expected)
    below = (value <= limit) == bool(metric["pass"])
    high, low = (value, limit) if below == (limit >= 0.0) else (limit, value)
    if high * low > 0.0:
        return high / low
    return 0.0 if metric["pass"] else math.inf


def worst(metrics: list[dict]) -> dict | None:
    """Return the metric that fails, or else is nearest to its limit; the first of equal ones."""
    return max(metrics, key=lambda m: (not m["pass"], used(m)), default=None)


def number(value: float | None) -> str:
    """Return a number with three digits."""
    return "nan" if value is None else f"{value:.3g}"


def result_text(metric: dict) -> str:
    """Return value and limit of a metric, as `1.2e-3 / 5e-3`, with the sign of the comparison."""
    value, expected = metric["value"], metric.get("expected")
    if value is not None and expected is not None:
        return f"{number(abs(value - expected))} / {number(metric['limit'])}"
    below = value is None or (value <= metric["limit"]) == bool(metric["pass"])
    return f"{number(value)} / {'' if below else '≥ '}{number(metric['limit'])}"


def cell(text: str) -> str:
    """Return text as one cell of a Markdown table."""
    return " ".join(text.split()).replace("|", "\\|")


def row(facts: dict, result: dict | None) -> str:
    """Return the line of a case: title, area, worst metric, value / limit, state."""
    state = state_of(result)
    metric = worst(result["metrics"]) if result else None
    name, value = ("", "") if metric is None else (metric["metric"], result_text(metric))
    if result and result.get("error"):
        name, value = result["error"], ""
    title = f"[{cell(facts['title'])}](#case-{facts['id']})"
    style = "" if state == "not run" else f" class='{state}'"
    cells = [title, facts["area"], cell(name), value, f"<span{style}>{state}</span>"]
    return "| " + " | ".join(cells) + " |"


def table(facts: list[dict], found: dict[str, dict]) -> list[str]:
    """Return one table with one line for each case of verification."""
    head = "| case | area | metric nearest to its limit | value / limit | |"
    lines = [head, "|---|---|---|---|---|"]
    return lines + [row(f, found.get(f["id"])) for f in facts if f["area"] != VALIDATION]


def counts_text(counts: dict[str, int]) -> str:
    """Return the counts in words."""
    parts = [f"{counts['pass']} of {sum(counts.values())} pass"]
    parts += [f"{counts['fail']} fail"] if counts["fail"] else []
    parts += [f"{counts['not run']} not run"] if counts["not run"] else []
    return ", ".join(parts)


def badge(counts: dict[str, int], version: str) -> str:
    """Return the badge: green where all cases pass, red where one fails, amber where some wait."""
    text = counts_text(counts)
    colour = BAD if counts["fail"] else (PART if counts["not run"] else GOOD)
    left, right = (round(LETTER * len(part) + 14) for part in ("verification", text))
    title = html.escape(f"verification of Talus {version or '?'}: {text}")
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{left + right}" height="20" role="img" '
        f'aria-label="{title}"><title>{title}</title>'
        f'<rect width="{left + right}" height="20" rx="3" fill="#4a5563"/>'
        f'<path d="M{left} 0h{right - 3}a3 3 0 0 1 3 3v14a3 3 0 0 1-3 3h-{right - 3}z" '
        f'fill="{colour}"/><g fill="#fff" font-family="Verdana,DejaVu Sans,sans-serif" '
        f'font-size="11" text-anchor="middle"><text x="{left / 2:g}" y="14">verification</text>'
        f'<text x="{left + right / 2:g}" y="14">{html.escape(text)}</text></g></svg>\n'
    )


def write_badge(path: Path, folder: Path) -> None:
    """Write the badge of the results in a folder."""
    found, version = results(folder)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(badge(counted(all_cases(), found), version), encoding="utf-8")
