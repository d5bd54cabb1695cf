"""Print the whole manual as one PDF: title page, contents with numbers of pages, all pages.

Usage: manual_pdf.py [--out build/manual] [--verification build/verification] [--pdf FILE]
Chromium prints it without a screen; the variable CHROMIUM names one that is not on the path. The
contents know the numbers of pages only after a first print, so that it prints twice.
"""

import argparse
import html
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import manual_page

import manual

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
SECONDS = 600
STYLE = """
@page{size:A4;margin:22mm 20mm 24mm;
@bottom-center{content:counter(page);font:9pt sans-serif;color:#7a828c}}
@page title{@bottom-center{content:none}}
body{display:block;width:170mm;font-size:9.5pt;line-height:1.4}
main{max-width:none;padding:0}
.title{page:title;text-align:center;padding-top:75mm}.title h1{font-size:44pt;margin:0}
.title p{font-size:13pt;color:#4a5563}
.chapter,.contents{break-before:page}h1{font-size:21pt}h2{font-size:14pt}h3{font-size:11.5pt}
h1,h2,h3,h4{break-after:avoid}
table{font-size:8pt;max-width:100%}td,th{padding:.1rem .28rem;overflow-wrap:break-word}
td code,td:last-child,p,li{overflow-wrap:anywhere}
td:first-child code{white-space:normal;overflow-wrap:break-word}tr{break-inside:avoid}
.equation{gap:.4rem}
pre{white-space:pre-wrap;overflow-wrap:anywhere;font-size:8.2pt}
img{max-height:185mm;break-inside:avoid}a{color:#31506e;text-decoration:none}
.contents h2{font-size:11pt;margin:.9rem 0 .2rem}
.contents a{display:flex;justify-content:space-between;gap:1rem;color:inherit;padding:.04rem 0}
"""
# what is still too wide for the page becomes smaller: it would shrink all pages
FIT = """
for (const wide of document.querySelectorAll(".equation, table, pre")) {
  const left = document.querySelector("main").getBoundingClientRect().left;
  const room = document.querySelector("main").clientWidth;
  for (let k = 0; k < 4; k++) {
    const parts = [wide, ...wide.children].map((part) => part.getBoundingClientRect().right - left);
    const share = room / Math.max(...parts);
    if (share >= 1) break;
    wide.style.fontSize = `${parseFloat(getComputedStyle(wide).fontSize) * share * 0.98}px`;
  }
}
"""


def browser() -> str | None:
    """Return the browser that prints, None where there is none."""
    asked = os.environ.get("CHROMIUM")
    return shutil.which(asked) if asked else next(filter(None, map(shutil.which, BROWSERS)), None)


def in_book(name: str, body: str) -> str:
    """Return the body of a page whose ids and links are those of one file with all pages."""
    body = re.sub(r"""\bid=(["'])([^"']+)\1""", rf'id="{name}--\2"', body)
    body = re.sub(r'href="#([^"]+)"', rf'href="#{name}--\1"', body)
    body = re.sub(r'href="([\w.-]+)\.html#([^"]+)"', r'href="#\1--\2"', body)
    body = re.sub(r'href="([\w.-]+)\.html"', r'href="#\1"', body)
    return f'<section class="chapter" id="{name}">{body}</section>'


def contents(titles: dict[str, str], numbers: dict[str, int]) -> str:
    """Return the table of contents; `numbers` are the pages where chapters begin."""
    lines = ["<section class='contents'><h1>Contents</h1>"]
    for part, pages in manual_page.by_parts(titles).items():
        lines += [f"<h2>{part}</h2>"] if pages else []
        for name in pages:
            number = f"<span>{numbers.get(name, '')}</span>"
            lines.append(f'<a href="#{name}"><span>{html.escape(titles[name])}</span>{number}</a>')
    return "\n".join([*lines, "</section>"])


def book(titles: dict[str, str], bodies: dict[str, str], version: str, pages: str) -> str:
    """Return the whole manual as one page of HTML; `pages` is its table of contents."""
    chapters = "\n".join(in_book(name, bodies[name]) for name in titles)
    return (
        "<!doctype html><html lang='en'><meta charset='utf-8'>"
        f"<title>Talus {version}: manual</title><style>{manual_page.STYLE}{STYLE}</style><main>"
        f"<section class='title'><h1>Talus</h1><p>Grains, solids, and both at once</p>"
        f"<p>Manual of version {version}</p></section>{pages}{chapters}</main>"
        f"<script>{FIT}</script></html>"
    )


def numbers_of(pdf: bytes) -> tuple[dict[str, int], int]:
    """Return the page on which each link ends, and the number of pages, of a PDF by Chromium."""
    nodes = re.finditer(rb"(\d+) 0 obj\s*<</Type /Pages.*?/Kids \[(.*?)\]", pdf, flags=re.S)
    tree = {node[1]: node[2].split() for node in nodes}
    below = {kid for kids in tree.values() for kid in kids[::3]}
    order: list[bytes] = []
    left = [node for node in tree if node not in below]
    while left:
        node = left.pop(0)
        if node in tree:
            left = tree[node][::3] + left
        else:
            order.append(node)
    places = {node: k for k, node in enumerate(order, 1)}
    ends = re.finditer(rb"/([^\s/\[\]<>()]+) \[(\d+) 0 R /XYZ", pdf)
    names = {re.sub(rb"#(..)", lambda h: bytes.fromhex(h[1].decode()), e[1]): e[2] for e in ends}
    return {name.decode(): places[node] for name, node in names.items()}, len(order)


def unnumbered(titles: dict[str, str], numbers: dict[str, int]) -> list[str]:
    """Return the chapters that begin on no page, or before the one that they follow."""
    pages = [numbers.get(name, 0) for name in titles]
    before = [2, *pages[:-1]]  # title page and contents come first
    return [name for name, k, last in zip(titles, pages, before, strict=True) if k <= last]


def printed(program: str, source: Path, target: Path) -> None:
    """Print a page of HTML into a PDF with an outline, without a screen."""
    with tempfile.TemporaryDirectory() as profile:
        flags = ["--headless=new", "--disable-gpu", "--no-pdf-header-footer",
                 "--generate-pdf-document-outline", f"--user-data-dir={profile}",
                 f"--print-to-pdf={target}"]  # fmt: skip
        if os.geteuid() == 0:
            flags.append("--no-sandbox")  # Chromium refuses root with it
        subprocess.run([program, *flags, source.resolve().as_uri()], check=True,
                       capture_output=True, timeout=SECONDS)  # fmt: skip
    if not target.exists():
        raise OSError(f"{program} wrote no {target}")


def main() -> int:
    """Print the manual; return 0, 1 for dead links or lost chapters, 4 where nothing prints."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=manual.ROOT / "build/manual")
    parser.add_argument("--verification", type=Path, default=manual.ROOT / "build/verification")
    parser.add_argument("--pdf", type=Path, help="default: talus.pdf in the folder of --out")
    options = parser.parse_args()
    program = browser()
    if not program:
        print(
            "manual: no chromium here prints the manual\n"
            "  hint: apt install chromium fonts-stix, or make manual-pdf CHROMIUM=/path/of/it",
            file=sys.stderr,
        )
        return 4
    version = (manual.ROOT / "VERSION").read_text().strip()
    titles, bodies, faults = manual.built(options.out, options.verification)
    source, target = options.out / "book.html", options.pdf or options.out / "talus.pdf"
    numbers: dict[str, int] = {}
    try:
        for _ in range(2):
            source.write_text(book(titles, bodies, version, contents(titles, numbers)))
            printed(program, source, target)
            numbers, count = numbers_of(target.read_bytes())
    except (OSError, subprocess.SubprocessError) as fault:
        print(f"manual: the PDF could not be printed: {fault}", file=sys.stderr)
        return 4
    finally:
        source.unlink(missing_ok=True)
    lost = unnumbered(titles, numbers)
    print(f"manual: {len(titles)} chapters, {count} pages, {target}")
    if lost:
        print(f"manual: in the PDF no page begins {', '.join(lost)}", file=sys.stderr)
    return 1 if faults or lost else 0


if __name__ == "__main__":
    sys.exit(main())
