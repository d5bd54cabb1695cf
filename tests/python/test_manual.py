"""The manual as HTML and as a book: search without a server, ways between pages, the PDF."""

import html
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from browser import asked as browser_asked
from browser import working  # noqa: F401

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import manual_links  # noqa: E402
import manual_page  # noqa: E402
import manual_pdf  # noqa: E402
import manual_search  # noqa: E402

import manual  # noqa: E402

SOURCES = {
    "index": "# Talus\n\n[Deck](deck-dem.md#contact).\n\n## Sand\n\nQuartz & feldspar.",
    "deck-dem": "# Deck\n\n## contact\n\n| key | meaning |\n|---|---|\n| `friction` | of Coulomb |",
    "theory-dem": "# Theory\n\n$$ \\begin{aligned}a&=b\\\\c&=d\\end{aligned} $$ {D.1}\n\n$E<1$.",
    "example-x": "# An example\n\nQuartz flows.",
}


def made() -> tuple[dict[str, str], dict[str, str]]:
    """Return titles and bodies of a manual of four pages."""
    names = [name for part in manual_page.by_parts(SOURCES).values() for name in part]
    titles = {name: manual.title_of(SOURCES[name], name) for name in names}
    bodies = {name: manual.page_html(SOURCES[name]).replace(".md#", ".html#") for name in names}
    return titles, {n: manual_search.with_rows(n, body) for n, body in bodies.items()}


def asked(tmp_path: Path, query: str) -> list[tuple[str, str]]:
    """Return address and heading of what a browser finds, from files."""
    titles, bodies = made()
    for name, body in bodies.items():
        (tmp_path / f"{name}.html").write_text(manual_page.page(name, body, titles, "1.0"))
    (tmp_path / "search.js").write_text(manual_search.script(titles, bodies))
    page = f"{(tmp_path / 'index.html').as_uri()}?q={query}"
    dom = browser_asked(page, tmp_path, "--virtual-time-budget=1000", "--dump-dom")
    found = re.search(r'<main id="found">(.*?)</main>', dom, flags=re.S)
    links = re.findall(r'<a href="([^"]+)">(.*?)</a>', found[1] if found else "")
    return [(where, re.sub("<[^>]+>", "", text)) for where, text in links]


@pytest.mark.parametrize(
    ("query", "expected"),
    [
        ("friction", [("deck-dem.html#contact-friction", "contact friction")]),
        ("quartz", [("index.html#sand", "Sand"), ("example-x.html#an-example", "An example")]),
        ("quartz+feldspar", [("index.html#sand", "Sand")]),
        ("nothing-of-this", []),
    ],
)
def test_search(tmp_path: Path, browser: None, query: str, expected: list[tuple[str, str]]) -> None:
    """A page opened from a file finds keys, words in several pages, and all words of a query."""
    assert asked(tmp_path, query) == expected


def test_ways_between_pages() -> None:
    """Every page leads to the one before and the one after, in the order of the list of pages."""
    titles, bodies = made()
    assert list(titles) == ["index", "deck-dem", "theory-dem", "example-x"]
    pages = {name: manual_page.page(name, bodies[name], titles, "1.0") for name in titles}
    listed = re.findall(r"<a href='([\w.-]+)\.html'", pages["index"].split("</nav>")[0])
    ways = {name: re.findall(r"rel=(\w+) href='([\w.-]+)\.html'", p) for name, p in pages.items()}
    assert listed == list(titles) and "href='index.html' class=here" in pages["index"]
    assert ways["index"] == [("next", "deck-dem")]
    assert ways["deck-dem"] == [("prev", "index"), ("next", "theory-dem")]
    assert ways["example-x"] == [("prev", "theory-dem")]


def test_every_page_has_a_place() -> None:
    """Pages of the manual stand in one part each; only examples are left to the last."""
    listed = [name for pages in manual_page.PARTS.values() for name in pages]
    assert len(set(listed)) == len(listed)
    written = {path.stem for path in (ROOT / "manual").glob("*.md")}
    assert written <= set(listed)


LAST = ["What can go wrong", "Not supported", "Keys and equations", "Cases", "Related pages"]


@pytest.mark.parametrize("name", manual_page.PARTS["Use"])
def test_order_of_a_page(name: str) -> None:
    """A page says what it is for, shows a figure and a deck, and ends as all others do."""
    text = (ROOT / "manual" / f"{name}.md").read_text()
    first = re.match(r"# [^\n]+\n\n(.*?)\n\n!\[[^]]+\]\(([^)]+\.png)\)\n", text, flags=re.S)
    assert first and not first[1].startswith(("#", "```", "|", "*")) and "\n\n" not in first[1]
    assert (ROOT / "manual" / first[2]).stat().st_size < 150_000
    assert text.index("\n```") >= first.end()
    headings = re.findall(r"^## (.+)$", text, flags=re.M)
    last = [heading for heading in LAST if heading in headings]
    assert headings[-len(last) :] == last and set(LAST) - set(last) <= {"Not supported"}
    cases = re.search(r"\n## Cases\n\n(.*?)\n\n## ", text, flags=re.S)[1]
    named = re.findall(r"verification\.md#case-(\w+)", cases)
    assert all(list((ROOT / "verification").glob(f"*/{case}/case.toml")) for case in named)
    assert named or "tests/python/" in cases
    assert re.search(r"deck-(dem|fem|couple)\.md", text) or name == "view"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> subprocess.CompletedProcess:
    """Build the real manual, without results of verification."""
    folder = tmp_path_factory.mktemp("whole")
    tool = [sys.executable, ROOT / "tools/manual.py", "--out", folder / "out"]
    done = subprocess.run([*tool, "--verification", folder / "none"], capture_output=True,
                          text=True, timeout=300)  # fmt: skip
    done.folder = folder / "out"
    return done


def test_no_dead_links_and_images(whole: subprocess.CompletedProcess) -> None:
    """Every link of the real manual leads somewhere, and every image is there."""
    assert (whole.returncode, whole.stderr) == (0, "")
    pages = {path.stem for path in whole.folder.glob("*.html")}
    assert {path.stem for path in (ROOT / "manual").glob("*.md")} | {"api", "errors"} <= pages
    images = {name for path in whole.folder.glob("*.html")
              for name in re.findall(r'<img[^>]*src="([^"]+)"', path.read_text())}  # fmt: skip
    assert {"figures/domains-facets.svg", "figures/domains-overlap.svg"} <= images
    assert all((whole.folder / name).stat().st_size for name in images)


def test_dead_ends_are_found(tmp_path: Path) -> None:
    """A missing image, page or heading is a fault with its page."""
    (tmp_path / "there.png").write_bytes(b"x")
    bodies = {
        "a": '<h1 id="top">A</h1><img alt="" src="there.png"><img src="figures/gone.svg">'
        '<a href="b.html#none">x</a><a href="#top">y</a>',
        "b": "<img src='data:image/png;base64,x'>",
    }
    assert manual_links.missing_images(bodies, tmp_path) == [("a", "figures/gone.svg")]
    assert manual_links.dead_anchors(bodies) == [("a", "b#none")]
    assert manual_links.linked('<a href="nowhere.md">x</a>', bodies)[1] == ["nowhere"]


def test_aligned_formula() -> None:
    """Rows of an aligned formula become rows of a table, without the marks between them."""
    body = manual.page_html(SOURCES["theory-dem"])
    assert body.count("<mtr>") == 2 and "&</mi>" not in html.unescape(body)


def test_links_of_the_book() -> None:
    """In one file, links between pages lead to chapters and their headings."""
    titles, bodies = made()
    text = manual_pdf.book(titles, bodies, "1.0", manual_pdf.contents(titles, {"index": 3}))
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert len(set(ids)) == len(ids) and "theory-dem--D.1" in ids
    assert set(re.findall(r'href="#([^"]+)"', text)) <= set(ids)
    assert '<a href="#index"><span>Talus</span><span>3</span></a>' in text


def test_numbers_of_pages(tmp_path: Path, browser: None) -> None:
    """Title, contents and four chapters are six pages, and the contents know where each begins."""
    titles, bodies = made()
    (tmp_path / "book.html").write_text(
        manual_pdf.book(titles, bodies, "1.0", manual_pdf.contents(titles, {}))
    )
    manual_pdf.printed(manual_pdf.browser(), tmp_path / "book.html", tmp_path / "book.pdf")
    numbers, count = manual_pdf.numbers_of((tmp_path / "book.pdf").read_bytes())
    assert count == 6
    assert {name: numbers[name] for name in titles} == {n: k for k, n in enumerate(titles, 3)}
    assert manual_pdf.unnumbered(titles, numbers) == []


def test_lost_chapters() -> None:
    """A chapter without a page, or on that of the one before, is named."""
    titles = dict.fromkeys(("index", "install", "view"), "")
    numbers = {"index": 3, "install": 9, "view": 14}
    assert manual_pdf.unnumbered(titles, numbers) == []
    assert manual_pdf.unnumbered(titles, numbers | {"install": 3}) == ["install"]
    assert manual_pdf.unnumbered(titles, {"index": 3, "install": 9}) == ["view"]


def test_no_browser(tmp_path: Path) -> None:
    """Without a browser it is said what to install, and nothing is built."""
    tool = [sys.executable, ROOT / "tools/manual_pdf.py", "--out", tmp_path / "book"]
    environment = os.environ | {"CHROMIUM": "/nowhere/chromium"}
    done = subprocess.run(tool, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 4 and "apt install chromium" in done.stderr
    assert not (tmp_path / "book").exists()
