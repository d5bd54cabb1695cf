"""One self-contained HTML page on the runs of a folder."""

import base64
import html
import json
import tempfile
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from talus import gallery, inertia, lights, pictures, report_log, version, view, view_data
from talus.faults import FaultError
from talus.look import figure_bytes
from talus.progress import watch

STYLE = """
body{font:15px/1.5 system-ui,sans-serif;color:#1c2430;max-width:62rem;margin:2rem auto;
padding:0 1rem}
h1{font-size:1.6rem}h2{margin-top:2.2rem;border-bottom:1px solid #cfd6de}figure{margin:1.2rem 0}
table{border-collapse:collapse;margin:.6rem 1.5rem .6rem 0;font-size:.9em;display:inline-table;
vertical-align:top}td,th{border:1px solid #cfd6de;padding:.2rem .6rem;text-align:left}
th{background:#f3f1ec;font-weight:600}img{max-width:100%}figcaption{color:#5c6570;font-size:.9em}
.bad{color:#b00020;font-weight:700}.good{color:#1f6f3d;font-weight:700}footer{color:#7a828c;margin-top:3rem}
.light{display:flex;gap:.8rem;align-items:flex-start;margin:.6rem 0;padding:.5rem .8rem;
border-left:5px solid;background:#f7f8f9}.lamp{flex:none;width:1.1rem;height:1.1rem;
border-radius:50%;margin-top:.15rem}.green{border-color:#1f8f4d}.green .lamp{background:#1f8f4d}
.amber{border-color:#e0a100}.amber .lamp{background:#e0a100}.red{border-color:#c0182b}
.red .lamp{background:#c0182b}.do{color:#444c56}.whole{font-size:1.05rem}
summary{cursor:pointer;font-weight:600;margin:.5rem 0}
.log pre{font-size:.82em;line-height:1.35;overflow-x:auto;background:#f7f8f9;padding:.6rem}
.log .error{color:#b00020;font-weight:700}.log .warning{color:#8a6d00;font-weight:700}
.log .health{font-weight:700}.log span:target{background:#fff0b3}
iframe{width:100%;height:36rem;border:1px solid #cfd6de}
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

VIEW_LIMIT = 4_000_000  # bytes of a view in three dimensions within a report
VIEW_FRAMES = 20

COUPLE, GRAINS = "talus-couple", "talus-dem"


@dataclass
class Run:
    """A program of a run by its summary: name, facts, light."""

    name: str
    facts: dict
    light: lights.Light

    @property
    def program(self) -> str:
        """Name of the program."""
        return str(self.facts.get("program", ""))


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


def runs_of(folder: Path) -> list[Run]:
    """Return the programs of a folder that have a summary, in the order of their names."""
    if not folder.is_dir():
        raise FaultError("E553", f"no such folder: {folder}")
    ending = "_summary.json"
    pages = {path.name.removesuffix(ending): read_summary(path)
             for path in sorted(folder.glob(f"*{ending}"))}  # fmt: skip
    tests = inertia.tests_of(folder)
    coupled = [f for f in pages.values() if f.get("program") == COUPLE]
    grains = next((n for n, f in pages.items() if f.get("program") == GRAINS and coupled), None)
    found = []
    for name, facts in pages.items():
        ends = {f.get("time_s") for f in coupled if f is not facts}
        partner = facts.get("program") != COUPLE and facts.get("time_s") in ends
        source = grains if facts.get("program") == COUPLE else name
        deep = lights.pressed_when(folder / f"{source}_energy.csv")
        light = lights.light_of(facts, partner, deep)
        found.append(Run(name, facts, inertia.judged(light, tests.get(name))))
    return found


def tables(run: Run) -> str:
    """Return the tables of a summary, folded."""
    facts = run.facts
    parts = [table("run", {row: facts[row] for row in MAIN_ROWS if row in facts})]
    parts += [table(key, value) for key, value in facts.items() if isinstance(value, dict)]
    title = html.escape(f"{run.name}: {run.program}")
    return f"<details><summary>{title}</summary>{''.join(parts)}</details>"


def picture(data: bytes, caption: str) -> str:
    """Return a figure with the PNG inside the page."""
    text = base64.b64encode(data).decode()
    caption = html.escape(caption)
    return (
        f'<figure><img alt="{caption}" src="data:image/png;base64,{text}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def image_of(folder: Path) -> list[str]:
    """Return an image of grains and solid at the last step as HTML, if it can be drawn."""
    try:
        grains, solid = view.files_of(folder, None, latest=True)
        if grains is None:
            return []
        with tempfile.TemporaryDirectory() as place:
            path = Path(place) / "view3d.png"
            look = pictures.Look("displacement", (1100, 800))
            pictures.render(grains, solid, -1, path, look)
            return [picture(path.read_bytes(), f"{grains.name}, last step")]
    except FaultError as fault:
        if fault.code in (*gallery.QUIET, "E550", "E602"):
            return []
        return [f'<p class="bad">{html.escape(str(fault))}</p>']


def figures(folder: Path) -> list[str]:
    """Return the PNGs of a folder (or an image of its run), and figures without PNG, as HTML."""
    images = sorted(folder.glob("*.png"))
    drawn = {path.name for path in images}
    parts = [picture(path.read_bytes(), path.name) for path in images] or image_of(folder)
    for exhibit in watch(list(gallery.exhibits(folder)), "figures"):
        if exhibit.name in drawn:
            continue
        try:
            parts.append(picture(figure_bytes(exhibit.work()), exhibit.name))
        except FaultError as fault:
            if fault.code not in gallery.QUIET:
                parts.append(f'<p class="bad">{html.escape(str(fault))}</p>')
    return parts


def view_of(folder: Path) -> list[str]:
    """Return the view of a run in three dimensions as HTML, if it is small."""
    try:
        grains, solid = view.files_of(folder, None, latest=True)
        page = view.html_of(view_data.build(grains, solid, VIEW_FRAMES), folder.resolve().name)
    except FaultError:
        return []
    size = len(page.encode())
    if size > VIEW_LIMIT:
        text = (f"The view in three dimensions has {size / 1e6:.1f} MB and is not in this page "
                f"(limit {VIEW_LIMIT / 1e6:.0f} MB): talus view {folder}")  # fmt: skip
        return [f"<p>{html.escape(text)}</p>"]
    return [f'<details id="view"><summary>View in three dimensions ({size / 1e6:.1f} MB)</summary>'
            f'<iframe title="view" loading="lazy" srcdoc="{html.escape(page)}"></iframe></details>'
            ]  # fmt: skip


def build(folder: Path, title: str) -> str:
    """Return the page: pictures and plots, the light of each program, tables folded."""
    runs = runs_of(folder)
    shapes = figures(folder)
    if not runs and not shapes:
        raise FaultError(
            "E553", f"{folder} holds no results", "*_summary.json, *.png, *_energy.csv"
        )
    parts = []
    if runs:
        worst = lights.worst([run.light for run in runs])
        text = {"green": "All is well", "amber": "Look at the notes", "red": "Do not trust it yet"}
        parts.append(
            f'<div class="light whole {worst}"><span class="lamp"></span><div><b>{text[worst]}</b>'
            f' (<a href="#health">{worst}</a>)</div></div>'
        )
    parts += [f"<p>{html.escape(line)}</p>" for line in inertia.lines(inertia.tests_of(folder))]
    parts += shapes
    parts += view_of(folder)
    if runs:
        parts.append('<h2 id="health">Health</h2>')
        logs = {run.name: report_log.read(folder, run.name) for run in runs}
        parts += [lights.panel(run.name, run.program, run.light, report_log.links(logs[run.name]))
                  for run in runs]  # fmt: skip
        parts += ["<h2>Numbers</h2>", *map(tables, runs)]
        parts += report_log.section([log for log in logs.values() if log])
    return page_of(title or f"Results in {folder.resolve().name}", parts)


def page_of(title: str, parts: list[str]) -> str:
    """Return a whole page of HTML with its style, the date and the version."""
    date = datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z")
    head = html.escape(title)
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{head}</title>'
        f"<style>{STYLE}</style></head><body><h1>{head}</h1><p>{date}</p>\n"
        + "\n".join(parts)
        + f"\n<footer>Talus {version()}</footer></body></html>\n"
    )
