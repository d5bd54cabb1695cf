"""Build the wheel of the Python package `talus` with the tables of decks and errors inside.

Usage: wheel.py FOLDER. The standard library alone is used, so that no network is needed. The name
of the wheel is printed.
"""

import base64
import hashlib
import sys
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
STAMP = (2026, 1, 1, 0, 0, 0)  # of all files: the same sources make the same wheel
SKIPPED = {"__pycache__"}


def metadata(project: dict) -> str:
    """Return METADATA of the project of pyproject.toml."""
    lines = ["Metadata-Version: 2.1", f"Name: {project['name']}", f"Version: {project['version']}",
             f"Summary: {project['description']}", f"License: {project['license']['text']}",
             f"Requires-Python: {project['requires-python']}"]  # fmt: skip
    lines += [f"Requires-Dist: {name}" for name in project["dependencies"]]
    for extra, names in project.get("optional-dependencies", {}).items():
        lines.append(f"Provides-Extra: {extra}")
        lines += [f'Requires-Dist: {name}; extra == "{extra}"' for name in names]
    return "\n".join(lines) + "\n"


def contents(project: dict) -> dict[str, bytes]:
    """Return the files of the wheel but for its record, by their names."""
    package = ROOT / "prepost/talus"
    files = {
        f"talus/{path.relative_to(package)}": path.read_bytes()
        for path in sorted(package.rglob("*"))
        if path.is_file() and not SKIPPED & set(path.parts) and "tables" not in path.parts
    }
    for folder in ("common", "dem", "fem", "couple", "prepost"):
        for name in ("deck.toml", "errors.toml"):
            if (ROOT / folder / name).is_file():
                files[f"talus/tables/{folder}/{name}"] = (ROOT / folder / name).read_bytes()
    files["talus/VERSION"] = f"{project['version']}\n".encode()
    scripts = "".join(f"{name} = {what}\n" for name, what in project["scripts"].items())
    info = f"{project['name']}-{project['version']}.dist-info"
    made = {
        "METADATA": metadata(project),
        "WHEEL": "Wheel-Version: 1.0\nGenerator: talus\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        "entry_points.txt": f"[console_scripts]\n{scripts}",
        "LICENSE": (ROOT / "LICENSE").read_text(),
    }
    return files | {f"{info}/{name}": text.encode() for name, text in made.items()}


def record(files: dict[str, bytes], name: str) -> bytes:
    """Return the record: name, hash and size of each file."""
    lines = []
    for file, data in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        lines.append(f"{file},sha256={digest},{len(data)}\n")
    return "".join([*lines, f"{name},,\n"]).encode()


def main() -> int:
    """Write the wheel into the folder."""
    project = tomllib.loads((ROOT / "prepost/pyproject.toml").read_text())["project"]
    stem = f"{project['name']}-{project['version']}"
    files = contents(project)
    name = f"{stem}.dist-info/RECORD"
    files[name] = record(files, name)
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    wheel = folder / f"{stem}-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for file, data in files.items():
            entry = zipfile.ZipInfo(file, STAMP)
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(entry, data)
    print(wheel)
    return 0


if __name__ == "__main__":
    sys.exit(main())
