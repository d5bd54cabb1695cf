"""The pages manual/learn-*.md: one skeleton, and their commands work, in small form."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from talus import cli
from talus.programs import find_program
from talus.verification import launcher

MANUAL = Path(__file__).resolve().parents[2] / "manual"
PAGES = sorted(MANUAL.glob("learn-*.md"))
HEADS = ["What you need", "Steps", "What you see", "Questions"]
#: of the `talus new` of each page
SMALL = {
    "packing": ["grains=140", "young=2e6"],
    "triaxial": ["grains=100", "strain=0.005", "compressed=0.08"],
    "hopper": ["grains=40", "open_for=0.07", "width=0.04"],
    "facets": ["grains=20", "width=0.012", "elements=1", "duration=0.03"],
    "overlap": ["above=12"],
    "surround": ["grains=100", "strain=0.02", "rate=2.0", "compressed=0.08"],
    "solver": ["grains=20", "width=0.012", "elements=1", "duration=0.03"],
    "cluster": ["grains=80", "limit=0.12"],
}
EXIT = re.compile(r"# exit code (\d)$")


def commands(page: Path) -> list[str]:
    """Return the commands of the steps of a page."""
    steps = page.read_text().split("## Steps")[1].split("## What you see")[0]
    steps = re.sub(r"^```python.*?^```$", "", steps, flags=re.M | re.S)
    blocks = re.findall(r"^```\n(.*?)^```$", steps, flags=re.M | re.S)
    lines = [line for block in blocks for line in block.splitlines()]
    return [line for line in lines if line and not line.startswith("#")]


def solve(line: str) -> None:
    """Run a command of programs or of the shell; it ends with 0, or as the page says."""
    if line.startswith("mpirun -n"):  # on any machine, and as root
        line = shlex.join(launcher(2)) + line.removeprefix("mpirun -n 2")
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, timeout=60)
    said = EXIT.search(line)
    assert done.returncode == (int(said[1]) if said else 0), done.stdout[-2000:] + done.stderr


def do(line: str, small: list[str]) -> None:
    """Run one command of a page, `talus new` in small form; pictures are only parsed."""
    words = shlex.split(line, comments=True)
    if words[0] == "cd":
        os.chdir(words[1])
    elif words[:2] == ["talus", "new"]:
        assert cli.main([*words[1:], "--small", "--set", *small]) == 0
    elif words[:2] in (["talus", "render"], ["talus", "view"], ["talus", "watch"]):
        options = cli.build_parser().parse_args(words[1:])
        assert Path(getattr(options, "grains", None) or options.folder).exists()
    elif words[0] == "talus":
        assert cli.main(words[1:]) == 0
    else:
        solve(line)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_skeleton(page: Path) -> None:
    """A page begins with its picture and has the same parts in the same order."""
    text = page.read_text()
    pictures = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", text)
    assert pictures and all((MANUAL / name).is_file() for name in pictures)
    assert text.index("![") < text.index("## ")
    assert re.findall(r"^## (.*)$", text, flags=re.M) == HEADS
    assert text.split("## Questions")[1].count("**") >= 6  # three questions


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_steps(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every command of the steps works from a fresh folder, in the order of the page."""
    programs, python = find_program("talus-dem").resolve().parent, Path(sys.executable).parent
    monkeypatch.setenv("PATH", f"{programs}:{python}:{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", str(MANUAL.parent / "prepost"))
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    monkeypatch.chdir(tmp_path)
    lines = commands(page)
    assert len(lines) > 4 and lines[0].startswith("talus new")
    for line in lines:
        if page.stem == "learn-packing" or not line.startswith("talus report"):  # once is enough
            do(line, SMALL[page.stem.removeprefix("learn-")])


def test_pages() -> None:
    """No page is missing, and the index names each."""
    assert {page.stem.removeprefix("learn-") for page in PAGES} == set(SMALL)
    index = (MANUAL / "index.md").read_text()
    assert all(f"({page.name})" in index for page in PAGES)
