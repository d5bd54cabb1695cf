"""An installed suite runs, may be moved, goes again; a tarball elsewhere; the wheel in a venv."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from talus import templates
from talus.mesh import box, write_mesh
from talus.programs import find_program

ROOT = Path(__file__).resolve().parents[2]
SOLID = """&run      title = 'Cube', gravity = 0.0, 0.0, -9.81 /
&mesh     file = 'cube.h5' /
&material id = 'soil', law = 'linear_elastic', density = 1600.0, young = 1.0e6, poisson = 0.3 /
&section  group = 'all', material = 'soil' /
&support  group = 'z0', fix = 'x', 'y', 'z' /
&analysis kind = 'static', solver = 'direct' /
"""


def programs() -> Path:
    """Return the folder of the programs under test."""
    return find_program("talus-dem").resolve().parent


def clean(**more: str) -> dict[str, str]:
    """Return an environment that knows nothing of the sources."""
    left = {"PYTHONPATH", "TALUS_BIN", "LD_LIBRARY_PATH", "OPAL_PREFIX"}
    return {k: v for k, v in os.environ.items() if k not in left} | more


def call(*words: object, **more: str) -> str:
    """Run a command in a clean environment and return what it said."""
    done = subprocess.run(list(map(str, words)), env=clean(**more), capture_output=True, text=True,
                          timeout=60)  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout


def install(*words: object, **more: str) -> str:
    """Run tools/install.sh with this Python."""
    return call(ROOT / "tools/install.sh", *words, PYTHON=sys.executable, **more)


def test_install(tmp_path: Path) -> None:
    """Programs, talus, man pages, completion, schemas work where they are moved; all goes again."""
    root = tmp_path / "dest/opt/talus"
    (root / "bin").mkdir(parents=True)
    (root / "bin/other").write_text("of another package")
    install("install", root, programs(), programs().parent / "lib")
    moved = tmp_path / "moved"
    root.rename(moved)
    for name in ("talus-dem", "talus-fem", "talus-couple"):
        assert name in call(moved / "bin" / name, "--version")
        assert "EXIT STATUS" in (moved / f"share/man/man1/{name}.1").read_text()
    talus = {"TALUS_PYTHON": sys.executable}
    link = tmp_path / "talus"
    link.symlink_to(moved / "bin/talus")  # as ~/bin has it
    made = tmp_path / "cluster"
    assert "cluster" in call(link, "new", "cluster", "--small", "-o", made, **talus)
    assert "in order (talus-dem)" in call(link, "check", made / "bed.nml", **talus)
    assert "Coulomb" in call(link, "explain", "friction", **talus)
    words = (moved / "share/man/man1/talus.1").read_text()
    assert "port\\-test" in words and "\\-\\-deck" in words
    complete = moved / "share/bash-completion/completions/talus"
    assert "_talus" in call("bash", "-c", f"source '{complete}' && complete -p talus")
    assert "#compdef talus" in (moved / "share/zsh/site-functions/_talus").read_text()
    assert "complete -c talus" in (
        moved / "share/fish/vendor_completions.d/talus.fish"
    ).read_text()
    assert (moved / "share/talus/editors/json/talus-dem.schema.json").is_file()
    install("uninstall", moved)
    assert [p.name for p in moved.rglob("*") if p.is_file()] == ["other"]
    assert not (moved / "share").exists()


def test_uninstall_nothing(tmp_path: Path) -> None:
    """Where nothing was installed, nothing is removed, and it is said."""
    done = subprocess.run([ROOT / "tools/install.sh", "uninstall", tmp_path],
                          capture_output=True, text=True)  # fmt: skip
    assert done.returncode == 1 and "nothing of Talus is installed" in done.stderr


def test_tarball(tmp_path: Path) -> None:
    """Unpacked anywhere, the solver runs with the libraries of the tarball, MPI's plugins too."""
    file = tmp_path / "talus.tar.gz"
    install("tarball", file, programs(), programs().parent / "lib", COMPRESS="cat")
    call("tar", "-C", tmp_path, "-xf", file)
    root = next(tmp_path.glob("talus-*/"))
    write_mesh(tmp_path / "cube.h5", box([0.0, 0.0, 0.0], [1.0, 1.0, 1.0], (2, 2, 2)))
    (tmp_path / "cube.nml").write_text(SOLID)
    done = subprocess.run([root / "bin/talus-fem", tmp_path / "cube.nml"], capture_output=True,
                          text=True, env=clean(LD_DEBUG="libs"), timeout=60)  # fmt: skip
    assert done.returncode == 0 and "finished, exit 0" in done.stdout
    loaded = {line.split()[-1] for line in done.stderr.splitlines() if "calling init:" in line}
    for name in ("libhdf5_serial", "libdmumps", "libmpi.", "mca_"):
        found = [path for path in loaded if Path(path).name.startswith(name)]
        assert found and all(path.startswith(str(root)) for path in found), found


def test_wheel(tmp_path: Path) -> None:
    """A fresh environment gets the wheel without network; talus has templates and tables there."""
    wheel = call(sys.executable, ROOT / "tools/wheel.py", tmp_path / "wheel").strip()
    again = call(sys.executable, ROOT / "tools/wheel.py", tmp_path / "again").strip()
    assert Path(wheel).read_bytes() == Path(again).read_bytes()
    call(sys.executable, "-m", "venv", "--without-pip", tmp_path / "venv")
    python = tmp_path / "venv/bin/python"
    call(
        sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index", wheel
    )
    site = next((tmp_path / "venv/lib").glob("*/site-packages"))
    below = [p for p in sys.path if p.endswith("site-packages")]
    (site / "below.pth").write_text("\n".join(below))  # numpy and its kin are there already
    talus = tmp_path / "venv/bin/talus"
    assert call(talus, "--version").strip() == f"talus {(ROOT / 'VERSION').read_text().strip()}"
    assert str(site) in call(python, "-c", "import talus; print(talus.__file__)")
    said = call(talus, "new", "--help")
    assert all(kind in said for kind in templates.kinds())
    assert "would overwrite" in call(talus, "explain", "E636")


@pytest.mark.parametrize("name", ["CITATION.cff", "CONTRIBUTING.md", "LICENSE", "VERSION"])
def test_papers(name: str) -> None:
    """What a stranger looks for in the root is there; the version is the same in all."""
    text = (ROOT / name).read_text()
    assert text.strip()
    if name == "CITATION.cff":
        assert f"version: {(ROOT / 'VERSION').read_text().strip()}\n" in text
