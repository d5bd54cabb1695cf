"""Pages of the examples for the manual, and the links between pages as HTML has them."""

import re
import shutil
from pathlib import Path

LINK = re.compile(r'href="([^":#]+)\.md(#[^"]*)?"')
BESIDE = re.compile(r"\]\((\w+)\.md(#[^)]*)?\)")
PICTURE = re.compile(r"(!\[[^\]]*\]\()([\w-]+\.png)\)")


def example_pages(root: Path, out: Path) -> dict[str, str]:
    """Return name -> Markdown of the pages of all examples; their pictures go to figures/."""
    pages = {}
    for source in sorted((root / "examples").glob("*/*.md")):
        folder = source.parent.name
        text = source.read_text()
        for _, picture in PICTURE.findall(text):
            target = out / "figures" / f"{folder}-{picture}"
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source.parent / picture, target)
        text = PICTURE.sub(rf"\1figures/{folder}-\2)", text)
        text = BESIDE.sub(lambda m, f=folder: f"]({example_name(f, m[1])}.md{m[2] or ''})", text)
        pages[example_name(folder, source.stem)] = text
    return pages


def example_name(folder: str, stem: str) -> str:
    """Return the name of a page of an example."""
    return f"example-{folder}" + (f"-{stem.lower()}" if stem != "README" else "")


def page_of(target: str, pages: dict[str, str]) -> str | None:
    """Return the name of the page of a link to `target`.md, None where there is none."""
    path = Path(target)
    name = path.name if path.name != "README" else example_name(path.parent.name, path.name)
    return name if name in pages else None


def linked(body: str, pages: dict[str, str]) -> tuple[str, list[str]]:
    """Return a body with links to pages of HTML, and the targets that are no page."""
    dead = []

    def to_html(found: re.Match) -> str:
        name = page_of(found[1], pages)
        if name is None:
            dead.append(found[1])
            return found[0]
        return f'href="{name}.html{found[2] or ""}"'

    return LINK.sub(to_html, body), dead


def dead_anchors(bodies: dict[str, str]) -> list[tuple[str, str]]:
    """Return page and link of those that lead to no heading or equation."""
    ids = {name: set(re.findall(r"""id=["']([^"']+)["']""", body)) for name, body in bodies.items()}
    found = []
    for name, body in bodies.items():
        for target, anchor in re.findall(r'href="([\w.-]*?)(?:\.html)?#([^"]+)"', body):
            if (target or name) in ids and anchor not in ids[target or name]:
                found.append((name, f"{target or name}#{anchor}"))
    return found


def missing_images(bodies: dict[str, str], out: Path) -> list[tuple[str, str]]:
    """Return page and name of the images that are not in the folder of the manual."""
    found = []
    for name, body in bodies.items():
        for source in re.findall(r"""<img[^>]*\bsrc=["']([^"']+)["']""", body):
            if not source.startswith("data:") and not (out / source).exists():
                found.append((name, source))
    return found
