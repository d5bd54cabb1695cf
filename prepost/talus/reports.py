"""One self-contained HTML page on the runs of a folder."""

import base64
import html
import json
from datetime import datetime
from pathlib import Path

from talus import gallery, version
from talus.faults import FaultError
from talus.look import figure_bytes

STYLE = """
body{font:15px/1.5 system-ui,sans-serif;color:#1c2430;max-width:62rem;margin:2rem auto;
padding:0 1rem}
h1{font-size:1.6rem}h2{margin-top:2.2rem;border-bottom:1px solid #cfd6de}figure{margin:1.2rem 0}
table{border-collapse:collapse;margin:.6rem 1.5rem .6rem 0;font-size:.9em;display:inline-table;
vertical-align:top}td,th{border:1px solid #cfd6de;padding:.2rem .6rem;text-align:left}
th{background:#f3f1ec;font-weight:600}img{max-width:100%}figcaption{color:#5c6570;font-size:.9em}
.bad{color:#b00020;font-weight:700}.good{color:#1f6f3d;font-weight:700}footer{color:#7a828c;margin-top:3rem}
"""
MAIN_ROWS = (
    "version",
    "git",
    "deck",
    "exit_code",
    "wall_time_s",
    "steps",
    "time_s",
    "grain_steps_per_s",
)
ENDS = {0: "finished", 1: "fault of the input", 2: "numerical fault", 3: "stopped early",
        4: "fault of the system", 5: "bug"}  # fmt: skip


def read_summary(path: Path) -> dict:
    """Read one *_summary.json."""
    try:
        facts = json.loads(path.read_text())
        faults = facts.get("errors", []) if isinstance(facts, dict) else [None]
        if not isinstance(faults, list) or not all(isinstance(fault, dict) for fault in faults):
            raise ValueError("it is no summary of a run")
        return facts
    except (OSError, ValueError) as fault:
        raise FaultError("E552", f"{path} cannot be read: {fault}") from fault


def shown(value: object) -> str:
    """Return a value of a summary as text."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return ", ".join(shown(item) for item in value)
    return "-" if value is None else str(value)


def table(title: str, rows: dict[str, object]) -> str:
    """Return a table with two columns and a title."""
    body = "".join(
        f"<tr><td>{html.escape(name.replace('_', ' '))}</td>"
        f"<td>{html.escape(shown(value))}</td></tr>"
        for name, value in rows.items()
    )
    return f'<table><tr><th colspan="2">{html.escape(title)}</th></tr>{body}</table>'


def run_section(path: Path) -> str:
    """Return the part of the page on one run."""
    facts = read_summary(path)
    code = facts.get("exit_code")
    kind = "good" if code == 0 else "bad"
    end = ENDS.get(code, "unknown end") if isinstance(code, int) else "unknown end"
    name = path.name.removesuffix("_summary.json")
    program = html.escape(str(facts.get("program", "")))
    parts = [
        f'<h2>{html.escape(name)}: {program}, <span class="{kind}">{html.escape(end)}</span></h2>'
    ]
    parts.append(table("run", {row: facts[row] for row in MAIN_ROWS if row in facts}))
    parts += [table(key, value) for key, value in facts.items() if isinstance(value, dict)]
    for error in facts.get("errors", []):
        code, message, place, hint = (error.get(k) for k in ("code", "message", "place", "hint"))
        text = f"{code}: {message} ({place}) {hint}"
        parts.append(f'<p class="bad">{html.escape(text)}</p>')
    return "\n".join(parts)


def picture(data: bytes, caption: str) -> str:
    """Return a figure with the PNG inside the page."""
    text = base64.b64encode(data).decode()
    caption = html.escape(caption)
    return (
        f'<figure><img alt="{caption}" src="data:image/png;base64,{text}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def build(folder: Path, title: str) -> str:
    """Return the page: summaries, the folder's PNGs, and figures that have no PNG yet."""
    if not folder.is_dir():
        raise FaultError("E553", f"no such folder: {folder}")
    summaries = sorted(folder.glob("*_summary.json"))
    images = sorted(folder.glob("*.png"))
    drawn = {path.name for path in images}
    missing = [one for one in gallery.exhibits(folder) if one.name not in drawn]
    if not summaries and not images and not missing:
        raise FaultError(
            "E553", f"{folder} holds no results", "*_summary.json, *.png, *_energy.csv"
        )
    parts = [run_section(path) for path in summaries]
    if images or missing:
        parts.append("<h2>Figures</h2>")
    parts += [picture(path.read_bytes(), path.name) for path in images]
    for exhibit in missing:
        try:
            parts.append(picture(figure_bytes(exhibit.work()), exhibit.name))
        except FaultError as fault:
            if fault.code not in gallery.QUIET:
                parts.append(f'<p class="bad">{html.escape(str(fault))}</p>')
    date = datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z")
    head = html.escape(title or f"Results in {folder.resolve().name}")
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{head}</title>'
        f"<style>{STYLE}</style></head><body><h1>{head}</h1><p>{date}</p>\n"
        + "\n".join(parts)
        + f"\n<footer>Talus {version()}</footer></body></html>\n"
    )
