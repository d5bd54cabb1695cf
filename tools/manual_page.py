"""One page of the manual as HTML: list of pages, search box, way to the page before and after."""

import html
from collections.abc import Iterable

#: Parts of the manual and their pages in reading order; the rest are examples.
PARTS = {
    "Start": ["index", "first-run", "install", "choosing", "running", "ranks"],
    "Learn": [
        "learn-packing",
        "learn-triaxial",
        "learn-hopper",
        "learn-facets",
        "learn-overlap",
        "learn-surround",
        "learn-cluster",
        "learn-solver",
    ],
    "Use": [
        "element-tests",
        "drivers",
        "capillary",
        "pore-fluid",
        "moving-beds",
        "breakage",
        "yielding-solids",
        "measures",
        "view",
        "study",
        "python-run",
    ],
    "Reference": [
        "prepost",
        "deck-dem",
        "deck-fem",
        "deck-couple",
        "files",
        "errors",
        "api",
        "glossary",
    ],
    "Theory": [
        "theory-notation",
        "theory-differences",
        "theory-dem",
        "theory-fem",
        "theory-coupling",
        "theory-overlap",
    ],
    "Evidence": ["verification", "verification-index", "validation", "speed"],
    "Extend": ["extending", "style", "port", "own-solver", "fenicsx", "scikit-fem", "lammps"],
    "Releases": ["newcomers", "release-next", "release-0.2.0"],
}
REST = "Examples"
STYLE = """
body{margin:0;font:16px/1.55 system-ui,sans-serif;color:#1c2430;display:flex}
nav{width:16rem;height:100vh;background:#f3f1ec;padding:1.2rem;box-sizing:border-box;flex:none;
position:sticky;top:0;overflow:auto;font-size:.94em}
nav a{display:block;color:#31506e;text-decoration:none;padding:.12rem 0}nav a.here{font-weight:700}
nav h2{font-size:.8em;letter-spacing:.06em;text-transform:uppercase;color:#7a828c;
margin:1rem 0 .1rem}
nav header{position:sticky;top:-1.2rem;background:#f3f1ec;padding:.8rem 0 .5rem;margin-top:-.8rem}
nav input{width:100%;box-sizing:border-box;font:inherit;padding:.3rem .5rem;margin-top:.5rem;
border:1px solid #cfd6de;border-radius:4px}
main{max-width:54rem;padding:1rem 2.5rem 4rem;min-width:0;flex:auto}
main[hidden]{display:none}
#found p{margin:.1rem 0 1rem}#found mark{background:#ffe9a8}#found small{color:#7a828c}
table{border-collapse:collapse;margin:1rem 0;font-size:.92em}td,th{border:1px solid #cfd6de;
padding:.25rem .6rem;
text-align:left;vertical-align:top}td:first-child code{white-space:nowrap}
th{background:#f3f1ec}pre{background:#f6f7f9;padding:.8rem;overflow-x:auto;
border-radius:4px}code{font-size:.92em}img{max-width:100%}
.equation{display:flex;align-items:center;justify-content:space-between;gap:1rem}
.equation{overflow-wrap:normal}.equation>span{white-space:nowrap;flex:none}
math{font-family:"STIX Two Math","STIX Math",STIXMath,"Latin Modern Math","Cambria Math",math;
font-size:1.08em}
.equation math{margin:0 auto}mtd[columnalign=left]{text-align:left;padding-left:0}
mtd[columnalign=right]{text-align:right;padding-right:0}.fail{color:#b00020;font-weight:700}
.pass{color:#1f6f3d}footer{color:#7a828c;font-size:.85em;margin-top:3rem}
.ways{display:flex;justify-content:space-between;gap:2rem;margin-top:3rem;padding-top:.8rem;
border-top:1px solid #cfd6de}.ways a{color:#31506e;text-decoration:none}
tr:target,:target{background:#fff6d8}
@media print{nav,.ways{display:none}}
"""


def by_parts(names: Iterable[str]) -> dict[str, list[str]]:
    """Return part -> its pages among `names`, in reading order."""
    there = set(names)
    parts = {part: [name for name in pages if name in there] for part, pages in PARTS.items()}
    rest = sorted(there - {name for pages in PARTS.values() for name in pages})
    releases = parts.pop("Releases")
    return parts | {REST: rest, "Releases": releases}


def page(name: str, body: str, titles: dict[str, str], version: str) -> str:
    """Return the whole page `name`; `titles` are those of all pages, in reading order."""
    order = list(titles)
    links = ""
    for part, pages in by_parts(titles).items():
        links += f"<h2>{part}</h2>" if pages else ""
        for other in pages:
            here = " class=here" if other == name else ""
            links += f"<a href='{other}.html'{here}>{html.escape(titles[other])}</a>"
    place = order.index(name)
    ways = "<span></span>"
    if place > 0:
        before = order[place - 1]
        ways = f"<a rel=prev href='{before}.html'>← {html.escape(titles[before])}</a>"
    if place + 1 < len(order):
        after = order[place + 1]
        ways += f"<a rel=next href='{after}.html'>{html.escape(titles[after])} →</a>"
    return (
        "<!doctype html><html lang='en'><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width'>"
        f"<title>{html.escape(titles[name])} - Talus</title><style>{STYLE}</style>"
        f"<nav><header><strong>Talus {version}</strong><input id='search' type='search' "
        "placeholder='Search the manual ( / )' aria-label='Search the manual'></header>"
        f"{links}</nav>"
        f"<main>{body}<div class='ways'>{ways}</div><footer>Talus {version}</footer></main>"
        "<main id='found' hidden></main><script src='search.js'></script></html>\n"
    )
