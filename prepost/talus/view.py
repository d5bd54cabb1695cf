"""One page of HTML with a view of a run in three dimensions, without anything from the network."""

import html
import json
from pathlib import Path

import matplotlib
import numpy as np

from talus import version, view_data
from talus.faults import FaultError
from talus.fields import FieldFile, has_steps, of_a_grid
from talus.files import make_folder, replaced
from talus.pictures import ROLES
from talus.view_data import Page

HERE = Path(__file__).parent
#: the code of the page in the order in which it runs
CODE = ("view_pace", "view_cull", "view_quick", "view_shaders", "view_scene", "view_draw", "view")


def files_of(
    run: Path, solid: Path | None, latest: bool = False
) -> tuple[Path | None, Path | None]:
    """Return the field files of grains and of the solid of a run: a folder, or one of the files.

    `latest`: of several in a folder the one written last, as a page about the folder shows it.
    """
    if not run.is_dir():
        grains = holds(run)
        if not grains and solid:
            raise FaultError("E602", f"{run} holds a solid, and --solid is given", "grains first")
        return (run, solid) if grains else (None, run)
    found = [path for path in sorted(run.glob("*.h5")) if has_steps(path) and not of_a_grid(path)]
    both = []
    for kind, given in ((True, None), (False, solid)):
        some = [given] if given else [path for path in found if holds(path) == kind]
        if len(some) > 1 and latest:
            some = [max(some, key=lambda path: path.stat().st_mtime)]
        if len(some) > 1:
            names = ", ".join(path.name for path in some)
            what = "grains" if kind else "a solid"
            raise FaultError(
                "E602",
                f"several files of {run} hold {what}: {names}",
                f"name one: talus view {some[0]}",
            )
        both.append(some[0] if some else None)
    if not any(both):
        raise FaultError("E602", f"no field file in {run}", "run the deck with &output")
    return both[0], both[1]


def holds(path: Path) -> bool:
    """Whether a field file holds grains (else a solid)."""
    with FieldFile(path) as fields:
        return fields.mesh is None


def html_of(page: Page, title: str) -> str:
    """Return the page: its template, the code, and the data of `page`."""
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 1.0, 256))[:, :3]
    page.put("viridis", np.round(255.0 * colours), "u1")
    facts = page.facts | {"roles": [[k, *role] for k, role in ROLES.items()]}
    blobs = "\n".join(
        f'<script type="text/plain" id="b-{name}">{text}</script>'
        for name, text in page.text.items()
    )
    parts = {
        "TITLE": html.escape(title),
        "STAMP": f"Talus {version()}",
        "BLOBS": blobs,
        "FACTS": json.dumps(facts).replace("</", "<\\/"),
        "CODE": "\n".join((HERE / f"{name}.js").read_text(encoding="utf-8") for name in CODE),
    }
    text = (HERE / "view.html").read_text(encoding="utf-8")
    for name, value in parts.items():
        text = text.replace(f"@{name}@", value)
    return text


def write(run: Path, solid: Path | None, output: Path, most: int, title: str) -> None:
    """Write the page of a run; `most` is the largest number of steps."""
    if output.suffix not in (".html", ".htm"):
        raise FaultError("E601", f"no page can be written as '{output.name}'", "end it with .html")
    grains, body = files_of(run, solid)
    page = view_data.build(grains, body, most)
    make_folder(output.parent)
    with replaced(output) as temporary:
        temporary.write_text(html_of(page, title or run.resolve().name), encoding="utf-8")
