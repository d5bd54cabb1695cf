"""Search of the manual: its sections as one script that pages load without a server."""

import html
import json
import re
from pathlib import Path

HEADING = re.compile(r'<h[1-4] id="([^"]+)">(.*?)</h[1-4]>', flags=re.S)
ROW = re.compile(r"<tr>\s*<td>(?:<code>([^<]+)</code>|([A-Z]\d{3}))</td>")
#: pages whose rows are looked for by themselves: keys of decks, codes of errors
OF_ROWS = ("deck-", "errors")
SCRIPT = Path(__file__).with_name("manual_search.js")


def plain(body: str) -> str:
    """Return the words of HTML without formulas and pictures."""
    text = re.sub(r"<(math|style|script)\b.*?</\1>", " … ", body, flags=re.S)
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", text)).split())


def with_rows(name: str, body: str) -> str:
    """Return a body of which each row of a key or a code can be linked to."""
    if not name.startswith(OF_ROWS):
        return body
    pieces = re.split(r"(?=<h[1-4] id=)", body)
    seen: set[str] = set()
    for k, piece in enumerate(pieces):
        section = HEADING.match(piece)

        def mark(row: re.Match, section: re.Match | None = section) -> str:
            key = row[2] or f"{section[1] if section else ''}-{html.unescape(row[1]).strip('&')}"
            if key in seen or not re.fullmatch(r"[\w.-]+", key):
                return row[0]
            seen.add(key)
            return row[0].replace("<tr>", f'<tr id="{key}">', 1)

        pieces[k] = ROW.sub(mark, piece)
    return "".join(pieces)


def entries(name: str, body: str) -> list[tuple[str, str, str]]:
    """Return anchor, title and text of every section of a page, and of its rows of keys."""
    found = []
    for piece in re.split(r"(?=<h[1-4] id=)", body):
        heading = HEADING.match(piece)
        if not heading:
            continue
        title = plain(heading[2])
        rows = re.findall(r'<tr id="([^"]+)">(.*?)</tr>', piece, flags=re.S)
        rest = re.sub(r'<tr id="[^"]+">.*?</tr>', " ", piece, flags=re.S)
        found.append((heading[1], title, plain(rest[heading.end() :])))
        for anchor, row in rows:
            cells = re.findall(r"<td>(.*?)</td>", row, flags=re.S)
            key = plain(cells[0])
            found.append((anchor, f"{title} {key}", plain(" ".join(cells[1:]))))
    return found


def script(titles: dict[str, str], bodies: dict[str, str]) -> str:
    """Return the script of the search with all sections of the manual in it."""
    pages = [
        [name, title, [list(entry) for entry in entries(name, bodies[name])]]
        for name, title in titles.items()
    ]
    data = json.dumps(pages, ensure_ascii=False, separators=(",", ":"))
    return f"const PAGES = {data};\n{SCRIPT.read_text(encoding='utf-8')}"
