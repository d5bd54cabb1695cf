"""Build the manual as HTML: pages in Markdown, plus what the sources and the runs generate.

Usage: manual.py [--out build/manual] [--verification build/verification]
Pages are manual/*.md in the order of manual_page.PARTS; the deck reference comes from the deck.toml
files, the error chapter from the errors.toml files, the chapters of verification and validation
from the summary of the last `make verification` (or of the quick cases that `make test` ran) and
what the tests noticed of faults put in (`make mutants ACCEPT=1`).
Formulas between $...$ and $$...$$ become MathML; a label behind the latter, {D.12}, goes to the
margin.
"""

import argparse
import csv
import html
import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import bench_table
import manual_api
import manual_domains
import manual_links
import manual_page
import manual_search
import markdown
import verification_index
import verification_table
from latex2mathml.converter import convert as latex_to_mathml
from verification_table import VALIDATION, cell

ROOT = Path(__file__).resolve().parent.parent
# a displayed formula and its label, as in $$ a = b $$ {D.12}
DISPLAYED = re.compile(r"\$\$(.+?)\$\$(?: \{([A-Z]\.\d+)\})?", flags=re.S)


def math_to_mathml(text: str) -> tuple[str, list[str]]:
    """Replace formulas by marks that Markdown leaves alone; return text and MathML pieces."""
    pieces: list[str] = []

    def keep(source: str, display: str, label: str | None = None) -> str:
        # the converter knows no aligned, and would leave its marks in the formula
        text = source.strip().replace("{aligned}", "{align*}")
        piece = latex_to_mathml(text, display=display)
        if label:
            piece = f"<span class='equation' id='{label}'>{piece}<span>({label})</span></span>"
        pieces.append(piece)
        return f"@formula{len(pieces) - 1}@"

    blocks = re.split(r"(```.*?```|`[^`\n]*`)", text, flags=re.S)
    for k in range(0, len(blocks), 2):
        blocks[k] = DISPLAYED.sub(lambda m: keep(m[1], "block", m[2]), blocks[k])
        blocks[k] = re.sub(r"(?<!\\)\$([^$\n]+?)\$", lambda m: keep(m[1], "inline"), blocks[k])
    return "".join(blocks), pieces


def page_html(source: str) -> str:
    """Turn one Markdown page into the HTML of its body."""
    text, pieces = math_to_mathml(source)
    body = markdown.markdown(text, extensions=["tables", "fenced_code", "toc", "sane_lists"])
    return re.sub(r"@formula(\d+)@", lambda m: pieces[int(m[1])], body)


def title_of(source: str, name: str) -> str:
    """Return the first heading of a page."""
    found = re.search(r"^# (.+)$", source, flags=re.M)
    return found[1] if found else name


def errors_page() -> str:
    """Return the chapter of error codes from */errors.toml."""
    lines = [
        "# Error codes",
        "",
        "The letter gives the exit code: W (warning) 0, D (deck) and I (input data) 1,",
    ]
    lines += [
        "N (numerical) 2, S (system) and P (partner) 4, B (bug) 5, E (Python tools) 1 or 4.",
        "Exit code 3 is no error: the run stopped early on request and left a checkpoint.",
        "",
    ]
    for folder in ["common", "dem", "fem", "couple", "libport", "prepost"]:
        path = ROOT / folder / "errors.toml"
        if not path.exists():
            continue
        lines += [f"## {folder}", "", "| code | what | meaning and cure |", "|---|---|---|"]
        for code, entry in sorted(tomllib.loads(path.read_text()).items()):
            cells = [code, entry["title"], entry["explain"]]
            lines.append("| " + " | ".join(cell(text) for text in cells) + " |")
        lines.append("")
    return "\n".join(lines)


def verification_page(folder: Path, out: Path) -> str:
    """Return the verification chapter from summary.json; copies the figures beside the pages."""
    found, version = verification_table.results(folder)
    facts = [f for f in verification_table.all_cases() if f["area"] != VALIDATION]
    verification_table.write_badge(out / "figures" / verification_table.BADGE, folder)
    counts = verification_table.counted(facts, found)
    lines = ["# Verification", "", f"![Verification](figures/{verification_table.BADGE})", ""]
    lines += [f"{len(facts)} cases: {verification_table.counts_text(counts)}"
              + (f"; results of version {version}." if found else "."), ""]  # fmt: skip
    lines += ["Cases that fail are in red; nothing is tuned to pass. `make verification` runs all, "
              "`make verification CASE=id` one. Which case uses which key, law or method is in the "
              "[index by feature](verification-index.md); experiments are in a chapter of their "
              "own, [validation](validation.md).", ""]  # fmt: skip
    lines += ["## All cases", "", "The metric is the one that is nearest to its limit. Where a "
              "value is expected, `value` is the distance from it; ≥ marks a limit from below.",
              ""]  # fmt: skip
    lines += [*verification_table.table(facts, found), ""]
    for area in verification_table.AREAS:
        lines += [f"## {area}", ""]
        for case in (f for f in facts if f["area"] == area):
            result = found.get(case["id"])
            lines += case_lines(result, folder, out) if result else not_run(case, case["folder"])
    return "\n".join(lines)


def validation_lines(folder: Path, out: Path) -> str:
    """Return a table of the experiments and a section on each; those not run are there, too."""
    summary = folder / "summary.json"
    cases = json.loads(summary.read_text())["cases"] if summary.exists() else []
    results = {case["id"]: case for case in cases if case.get("area") == VALIDATION}
    table = ["", "| experiment | source | metrics | outside the band |", "|---|---|---|---|"]
    lines = []
    for path in sorted((ROOT / "verification" / VALIDATION).glob("*/case.toml")):
        facts = tomllib.loads(path.read_text())
        case = results.get(facts["id"])
        judged = ["not run", ""]
        if case:
            missed = [cell(m["metric"]) for m in case["metrics"] if not m["pass"]]
            missed += [cell(case["error"])] if case.get("error") else []
            judged = [str(len(case["metrics"])), "; ".join(missed) or "none"]
        table.append("| " + " | ".join([facts["title"], cell(facts["source"]), *judged]) + " |")
        lines += case_lines(case, folder, out) if case else not_run(facts, path.parent)
    return "\n".join([*table, "", *lines])


def beside(readme: str) -> str:
    """Return the page of a case whose links to other cases lead to their sections."""
    return re.sub(r"\]\(\.\./(\w+)/README\.md\)", r"](#case-\1)", readme)


def not_run(facts: dict, folder: Path) -> list[str]:
    """Return the section of a case that was not run: its page as it is in the repository."""
    readme = folder / "README.md"
    page = facts.get("claim", "")
    if readme.exists():
        page = re.sub(r"^# .*\n", "", beside(readme.read_text()), count=1)
    anchor = f"<span id='case-{facts['id']}'>not run</span>"
    return [f"### {facts['title']} ({facts['id']}) {anchor}", "", page, ""]


def case_lines(case: dict, folder: Path, out: Path) -> list[str]:
    """Return the lines of one verification case: text, table of metrics, figure."""
    state = "pass" if case["pass"] else "fail"
    anchor = f"<span id='case-{case['id']}' class='{state}'>{state}</span>"
    lines = [f"### {case['title']} ({case['id']}) {anchor}", ""]
    readme = ROOT / "verification" / case.get("area", "") / case["id"] / "README.md"
    if readme.exists():
        # without its title and its table of measured values: those of this run follow
        text = beside(readme.read_text())
        lines += [re.sub(r"^(# |\|).*\n", "", text, flags=re.MULTILINE), ""]
    else:
        lines += [case.get("claim", ""), "", f"*Source: {case.get('source', '')}*", ""]
    if case.get("error"):
        lines += [f"<p class='fail'>{html.escape(case['error'])}</p>", ""]
    lines += ["| metric | value | expected | limit | |", "|---|---|---|---|---|"]
    for metric in case.get("metrics", []):
        mark = "pass" if metric["pass"] else "fail"
        expected = "" if metric.get("expected") is None else f"{metric['expected']:.6g}"
        value = "nan" if metric["value"] is None else f"{metric['value']:.6g}"
        lines.append(
            f"| {cell(metric['metric'])} | {value} | {expected} | {metric['limit']:.3g} "
            f"| <span class='{mark}'>{mark}</span> |"
        )
    for figure in case.get("figures", []):
        source = folder / case["id"] / figure
        if source.exists():
            target = out / "figures" / f"{case['id']}-{Path(figure).name}"
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)
            lines += ["", f"![{case['title']}](figures/{target.name})"]
    return [*lines, ""]


def noticed_faults(accepted: Path) -> str:
    """Return the table of one-line faults put into the code, and what noticed each."""
    head = "\n## Tests that notice\n\n"
    if not accepted.exists():
        return head + "None tried yet: `make mutants ACCEPT=1`.\n"
    with accepted.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    missed = [row["id"] for row in rows if not row["noticed by"]]
    lines = [
        f"{len(rows)} one-line faults of `tools/mutants.toml` were put into the code, one at a "
        f"time; tests about the thing noticed {len(rows) - len(missed)}"
        + (f", none noticed {', '.join(missed)}." if missed else "."),
        "",
        "| fault in | file | noticed by | which said |",
        "|---|---|---|---|",
    ]
    for row in rows:
        by = row["noticed by"] or "<span class='fail'>nothing</span>"
        lines.append(f"| {cell(row['about'])} | {row['file']} | {by} | {cell(row['how'])} |")
    return head + "\n".join(lines) + "\n"


def gather(out: Path, verification: Path) -> dict[str, str]:
    """Return name -> Markdown of every page, generated ones included."""
    generated = out / "generated"
    subprocess.run(
        [sys.executable, ROOT / "tools/keys.py", "--docs", generated], check=True, cwd=ROOT
    )
    pages = {path.stem: path.read_text() for path in generated.glob("*.md")}
    pages |= {path.stem: path.read_text() for path in (ROOT / "manual").glob("*.md")}
    pages |= manual_links.example_pages(ROOT, out)
    pages["errors"] = errors_page()
    pages["api"] = manual_api.page()
    pages["verification"] = verification_page(verification, out)
    pages["verification"] += noticed_faults(ROOT / "manual/mutants.csv")
    pages["verification-index"] = verification_index.page()
    pages[VALIDATION] += validation_lines(verification, out)
    pages["speed"] += speed_results(ROOT / "manual/speed.csv", out)
    return pages


def speed_results(accepted: Path, out: Path) -> str:
    """Return the table and the figure of the last accepted run of `make bench`."""
    if not accepted.exists():
        return "\n## Last accepted run\n\nNone yet: `make bench ACCEPT=1`.\n"
    rows, head = bench_table.read(accepted)
    bench_table.figure(out / "figures/speed.png", rows, head)
    text = bench_table.markdown(rows, head)
    return f"\n## Last accepted run\n\n{text}\n![Speed](figures/speed.png)\n"


def built(out: Path, verification: Path) -> tuple[dict[str, str], dict[str, str], int]:
    """Return titles and bodies of all pages in reading order, and how many links are dead."""
    out.mkdir(parents=True, exist_ok=True)
    pages = gather(out, verification)
    manual_domains.write(out / "figures")
    for picture in sorted((ROOT / "manual").glob("*.png")):
        shutil.copy(picture, out)
    names = [name for part in manual_page.by_parts(pages).values() for name in part]
    titles = {name: title_of(pages[name], name) for name in names}
    bodies, faults = {}, []
    for name in names:
        bodies[name], dead = manual_links.linked(page_html(pages[name]), pages)
        bodies[name] = manual_search.with_rows(name, bodies[name])
        faults += [(name, target) for target in dead]
    faults += manual_links.dead_anchors(bodies)
    faults += manual_links.missing_images(bodies, out)
    for name, target in faults:
        print(f"manual: page {name} names {target}, which does not exist", file=sys.stderr)
    return titles, bodies, len(faults)


def main() -> int:
    """Build the manual; return 0, or 1 when a page names a page or an image that is not there."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "build/manual")
    parser.add_argument("--verification", type=Path, default=ROOT / "build/verification")
    options = parser.parse_args()
    version = (ROOT / "VERSION").read_text().strip()
    titles, bodies, faults = built(options.out, options.verification)
    for name, body in bodies.items():
        text = manual_page.page(name, body, titles, version)
        (options.out / f"{name}.html").write_text(text)
    (options.out / "search.js").write_text(manual_search.script(titles, bodies))
    print(f"manual: {len(titles)} pages, {options.out}/index.html")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
