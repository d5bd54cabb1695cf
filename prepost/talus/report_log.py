"""The logs of a run in its report: folded, with an anchor a line and links to those that matter."""

import html
import re
from dataclasses import dataclass, field
from pathlib import Path

MOST_LINES = 4000  # of one log; of a longer one its first and last halves
TOLD = re.compile(r"^(?P<kind>health|warning|error)\b(?: (?P<code>[A-Z]\d{3}))?")
MOST_LINKS = 6  # of one kind
# browsers that do not open what a link leads into
OPEN = """<script>addEventListener("hashchange", opened); opened();
function opened() { const at = document.getElementById(location.hash.slice(1));
  const log = at && at.closest("details");
  if (log && !log.open) { log.open = true; at.scrollIntoView(); } }</script>"""


@dataclass
class Log:
    """The log of a program: its name, its lines, and the lines (from 0) that are left out."""

    name: str
    lines: list[str]
    left_out: range = field(default_factory=lambda: range(0))

    def anchor(self, number: int) -> str:
        """Return the anchor of a line, counted from 1."""
        return f"log-{self.name}-{number}"


def read(folder: Path, name: str) -> Log | None:
    """Return the log of a program in a folder; None where there is none that can be read."""
    try:
        text = (folder / f"{name}.log").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return None
    lines = text.splitlines()
    half = MOST_LINES // 2
    return Log(name, lines, range(half, len(lines) - half) if len(lines) > MOST_LINES else range(0))


def told(log: Log) -> list[tuple[int, str, str]]:
    """Return number, kind and code of the lines on health, warnings and errors, and the last."""
    found = []
    for number, line in enumerate(log.lines, 1):
        match = TOLD.match(line)
        if match and number - 1 not in log.left_out:
            found.append((number, match["kind"], match["code"] or ""))
    return [*found, (len(log.lines), "end", "")] if log.lines else found


def links(log: Log | None) -> str:
    """Return links to the lines of a log that say how the run went, as HTML."""
    if log is None:
        return ""
    parts = []
    lines = told(log)
    for kind in ("health", "warning", "error", "end"):
        some = [(number, code) for number, one, code in lines if one == kind]
        for number, code in some[-MOST_LINKS:]:
            text = html.escape(f"{kind} {code}".strip())
            parts.append(f'<a href="#{log.anchor(number)}">{text}, line {number}</a>')
        if len(some) > MOST_LINKS:
            parts.append(f"{len(some) - MOST_LINKS} more of {kind}")
    whole = f'<a href="#log-{log.name}">{html.escape(log.name)}.log</a>'
    return f'<div class="do">{whole}: {", ".join(parts)}</div>'


def folded(log: Log) -> str:
    """Return a log as HTML, folded, each line with its anchor."""
    shown = []
    for number, line in enumerate(log.lines, 1):
        if number - 1 in log.left_out:
            if number - 1 == log.left_out[0]:
                shown.append(f"<i>… {len(log.left_out)} lines are left out …</i>")
            continue
        kind = TOLD.match(line)
        mark = f' class="{kind["kind"]}"' if kind else ""
        shown.append(f'<span id="{log.anchor(number)}"{mark}>{html.escape(line)}</span>')
    title = f"{html.escape(log.name)}.log, {len(log.lines)} lines"
    body = "\n".join(shown)
    return (
        f'<details class="log" id="log-{html.escape(log.name)}"><summary>{title}</summary>'
        f"<pre>{body}</pre></details>"
    )


def section(logs: list[Log]) -> list[str]:
    """Return the section of all logs as HTML; nothing where there is none."""
    return ["<h2>Logs</h2>", *map(folded, logs), OPEN] if logs else []
