"""Recipes of packaging/: one source of package names, and it covers what the programs load."""

import ast
import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from talus.programs import find_program

ROOT = Path(__file__).resolve().parents[2]
PACKAGING = ROOT / "packaging"
DEPS = (ROOT / "tools/deps.sh").read_text()
#: what each -dev package of Debian is called in Spack, and what comes from elsewhere there
SPACK_NAMES = {
    "gcc": "c",
    "gfortran": "fortran",
    "make": "gmake",
    "libopenblas-dev": "openblas",
    "libmumps-dev": "mumps",
    "libmetis-dev": "metis",
    "libhypre-dev": "hypre",
    "libhdf5-dev": "hdf5",
    "libopenmpi-dev": "mpi",
    "python3": "python",
}
WITH_OTHERS = {"libc6-dev", "openmpi-bin", "python3-venv"}


def listed(name: str) -> set[str]:
    """Return the packages of a list of tools/deps.sh."""
    return set(re.search(rf'^{name}="([^"]*)"', DEPS, flags=re.MULTILINE)[1].split())


def spack_dependencies() -> set[str]:
    """Return the names that package.py depends on, without versions and variants."""
    tree = ast.parse((PACKAGING / "spack/package.py").read_text())
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    named = [c for c in calls if isinstance(c.func, ast.Name) and c.func.id == "depends_on"]
    return {re.match(r"[\w-]+", ast.literal_eval(call.args[0]))[0] for call in named}


@pytest.mark.skipif(not shutil.which("dpkg-query"), reason="packages of Debian")
def test_installed_covers_what_is_loaded() -> None:
    """Each library that a program names is in a package of the list, or of Debian's base."""
    needed = set()
    for name in ("talus-dem", "talus-fem", "talus-couple"):
        program = find_program(name)
        own = subprocess.run(["readelf", "-d", program], capture_output=True, text=True).stdout
        direct = set(re.findall(r"\(NEEDED\).*\[(.+)\]", own))
        places = subprocess.run(["ldd", program], capture_output=True, text=True).stdout
        found = re.findall(r"^\s*(\S+) => (\S+)", places, flags=re.MULTILINE)
        needed |= {Path(path).resolve() for library, path in found if library in direct}
    assert len(needed) > 8
    names = [form for path in map(str, needed) for form in (path, path.removeprefix("/usr"))]
    found = subprocess.run(["dpkg-query", "-S", *names], capture_output=True, text=True).stdout
    owners = {line.split(":")[0] for line in found.splitlines()}
    assert len(found.splitlines()) == len(needed)
    base = {"libc6", "libgcc-s1"}
    assert owners - base <= listed("installed") | listed("gmsh_libraries")


def test_recipes_name_no_package() -> None:
    """Containers take their packages from tools/deps.sh alone, and build by one script."""
    for name in ("Dockerfile", "apptainer.def", "build.sh"):
        text = (PACKAGING / name).read_text()
        assert "apt-get" not in text and "deps.sh" in text, name
        assert name == "build.sh" or "build.sh /opt/talus" in text, name


def test_apptainer_takes_what_the_build_needs() -> None:
    """Every folder and file that the build and the installation read is copied."""
    text = (PACKAGING / "apptainer.def").read_text()
    copied = set(re.findall(r"^    (\S+) /src/\1$", text, flags=re.MULTILINE))
    assert all((ROOT / name).exists() for name in copied)
    parts = set(re.search(r"^PARTS\s*:= (.+)$", (ROOT / "Makefile").read_text(), re.M)[1].split())
    needs = {"Makefile", "VERSION", "LICENSE", "CITATION.cff", "libport", "prepost", "tools"}
    assert parts | needs | {"packaging"} == copied


def test_spack_package_agrees() -> None:
    """What make deps installs has its name in Spack; the Python packages are those of the wheel."""
    named = spack_dependencies()
    assert listed("compilers") == SPACK_NAMES.keys() | WITH_OTHERS
    assert set(SPACK_NAMES.values()) <= named
    project = tomllib.loads((ROOT / "prepost/pyproject.toml").read_text())["project"]
    spack = {need if need == "gmsh" else f"py-{need}" for need in project["dependencies"]}
    assert {name for name in named if name.startswith("py-") or name == "gmsh"} == spack
    version = (ROOT / "VERSION").read_text().strip()
    assert f'version("{version}")' in (PACKAGING / "spack/package.py").read_text()


@pytest.mark.parametrize("name", ["bug", "question", "feature"])
def test_issue_templates(name: str) -> None:
    """Each form has its head, and asks for what `talus doctor` says, the deck and the log."""
    text = (ROOT / f".github/ISSUE_TEMPLATE/{name}.md").read_text()
    head = re.match(r"---\nname: .+\nabout: .+\ntitle: \"\"\nlabels: (.+)\n---\n", text)
    assert head and head[1] == name
    assert all(word in text for word in ("`talus doctor`", "`*.nml`", "`*.log`"))
    assert text.count("```") % 2 == 0
