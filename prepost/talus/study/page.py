"""What is made of a study in the end: table, statistics, figures, one HTML page."""

import csv
import html
import io
import json
from pathlib import Path

from talus import version
from talus.faults import FaultError
from talus.files import make_folder, write_text_file
from talus.look import save_figure
from talus.reports import STYLE, picture, shown
from talus.study import figures
from talus.study.definition import Study
from talus.study.folders import Store
from talus.study.statistics import describe, repeated
from talus.study.table import FAILED, Table, collect, write_csv, write_h5

MANY = 500  # rows of the table on the page


def draw(study: Study, store: Store, table: Table, facts: dict) -> list[Path]:
    """Write every figure; return their names."""
    made: list[Path] = []
    folder = store.folder / "figures"
    make_folder(folder)

    def keep(fig: object, name: str) -> None:
        save_figure(fig, folder / f"{name}.png")
        made.append(folder / f"{name}.png")

    for curve in study.curves:
        keep(figures.band(store, table, curve), f"curve_{curve.name}")
    for k, one in enumerate(study.results):
        known = facts[one.name]
        if known.get("swing"):
            keep(figures.tornado(study, table, k, known["swing"]), f"tornado_{one.name}")
        if known.get("sensitivity"):
            keep(figures.bars(study, k, known["sensitivity"]), f"sensitivity_{one.name}")
        if known["summary"]["count"]:
            keep(figures.scatter(study, table, k), f"scatter_{one.name}")
    return made


def rows_of(head: list, rows: list[list]) -> str:
    """Return a table of HTML."""
    cells = "".join(f"<th>{html.escape(str(word))}</th>" for word in head)
    lines = ["".join(f"<td>{html.escape(shown(v))}</td>" for v in row) for row in rows]
    return f"<table><tr>{cells}</tr>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"


def sections(study: Study, table: Table, facts: dict) -> list[str]:
    """Return the tables of the page."""
    states = {s: table.count(s) for s in ("finished", FAILED, "waiting")}
    parts = [f"<p>{', '.join(f'{n} {s}' for s, n in states.items() if n)}; plan {study.plan}.</p>"]
    if facts:
        head = list(max((one["summary"] for one in facts.values()), key=len))
        parts.append("<h2>Results</h2>" + rows_of(["result", *head], [
            [name, *(one["summary"].get(word) for word in head)]
            for name, one in facts.items()]))  # fmt: skip
    for name, one in facts.items():
        if found := one.get("sensitivity"):
            head = list(next(iter(found.values())))
            rows = [[p, *row.values()] for p, row in found.items()]
            title = f"<h2>Sensitivity of {html.escape(name)}</h2>"
            parts.append(title + rows_of(["parameter", *head], rows))
    bad = [k for k, state in enumerate(table.state) if state == FAILED]
    if bad:
        parts.append("<h2>Points that failed</h2>" + rows_of(
            ["point", *table.values, "exit code", "message"],
            [[k + 1, *(x[k] for x in table.values.values()), table.exit_code[k], table.message[k]]
             for k in bad]))  # fmt: skip
    return parts


def means_of(study: Study, table: Table) -> list[dict]:
    """Return means over the parameters with `repeat`; none if there are none, or no others."""
    repeats = [p.name for p in study.parameters if p.repeat]
    if not repeats or len(repeats) == len(study.parameters):
        return []
    return repeated(table.values, table.results, repeats)


def write_means(path: Path, rows: list[dict]) -> None:
    """Write the means over repeated points as CSV."""
    out = io.StringIO()
    writer = csv.DictWriter(out, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_text_file(path, out.getvalue())


def points_table(table: Table) -> str:
    """Return the first rows of all points."""
    columns = [*table.values.values(), *table.results.values()]
    rows = [[k + 1, *(x[k] if isinstance(x[k], int | str) else float(x[k]) for x in columns),
             table.state[k]] for k in range(min(len(table.state), MANY))]  # fmt: skip
    return "<h2>Points</h2>" + rows_of(["point", *table.values, *table.results, "state"], rows)


def finish(study: Study, store: Store) -> tuple[Table, list[Path]]:
    """Collect what there is and write everything; return table and files."""
    table = collect(study, store)
    names = [store.folder / n for n in ("results.csv", "results.h5", "statistics.json")]
    write_csv(names[0], table)
    write_h5(names[1], table)
    facts = describe(study.plan, table.values, table.results)
    write_text_file(names[2], json.dumps(facts, indent=1))
    means = means_of(study, table)
    if means:
        names.append(store.folder / "means.csv")
        write_means(names[-1], means)
    if not table.count("finished"):
        return table, names
    try:
        made = draw(study, store, table, facts)
    except FaultError as fault:
        again = f"{names[0]} is written; with the file mended: talus study {study.path} --collect"
        hint = f"{fault.hint}; {again}" if fault.hint else again
        raise FaultError(fault.code, fault.message, hint, str(study.path)) from fault
    title = html.escape(study.title)
    parts = sections(study, table, facts)
    if means:
        over = ", ".join(p.name for p in study.parameters if p.repeat)
        rows = [list(row.values()) for row in means]
        parts.append(f"<h2>Means over {html.escape(over)}</h2>" + rows_of(list(means[0]), rows))
    parts += ["<h2>Figures</h2>", *(picture(path.read_bytes(), path.name) for path in made)]
    parts += [points_table(table), "<h2>Origin</h2>"]
    parts.append(rows_of(["what", "value"], [list(row) for row in table.provenance.items()]))
    page = store.folder / "study.html"
    write_text_file(page, f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
                          f"<title>{title}</title><style>{STYLE}</style></head><body>"
                          f"<h1>{title}</h1>{''.join(parts)}<footer>Talus {version()}</footer>"
                          "</body></html>\n")  # fmt: skip
    return table, [*names, *made, page]
