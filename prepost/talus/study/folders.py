"""The folder of results: the frozen plan, a folder a point, what has become of each.

results/study.json    the plan, written once
results/points/0001/  a copy of the base folder with the point's values, point.sh, point.out, exit
results/locks/0001    locked by all processes of a point that runs, even when the driver is gone
A point is finished when its file `exit` is there, which point.sh renames into place.
"""

import fcntl
import json
import os
import re
import shlex
import shutil
import sys
from datetime import UTC, datetime
from pathlib import Path

import talus
from talus.faults import FaultError
from talus.files import make_folder, write_text_file
from talus.programs import find_program
from talus.study import deck_text
from talus.study.definition import WORD, Study, hashes

PROGRAMS = ("talus-dem", "talus-fem", "talus-couple")
SCRIPT = """#!/bin/sh
# Point {number} of '{title}'. Does nothing when it has finished.
cd "$(dirname "$0")" || exit 4
[ -e exit ] && exit 0
export OMP_NUM_THREADS={threads}
begin=$(date +%s.%N)
(
set -e
{commands}
) >>point.out 2>&1 </dev/null
code=$?
echo "{{\\"exit_code\\": $code, \\"begin\\": $begin, \\"end\\": $(date +%s.%N)}}" >exit.tmp
mv exit.tmp exit
exit $code
"""


class Store:
    """The folder of results of a study."""

    def __init__(self, folder: Path):
        """Take the folder, which need not be there yet."""
        self.folder = folder
        self.plan: dict = {}

    def point(self, number: int) -> Path:
        """Return the folder of a point, by its number from 1."""
        return self.folder / "points" / f"{number:04d}"

    def load(self) -> bool:
        """Read the plan; return whether there is one."""
        path = self.folder / "study.json"
        if not path.is_file():
            return False
        try:
            self.plan = json.loads(path.read_text())
            self.plan["rows"][0], self.plan["identity"]
        except (OSError, ValueError, KeyError, IndexError, TypeError) as fault:
            raise FaultError("E594", f"{path} is no plan of a study: {fault}") from fault
        return True

    def begin(self, study: Study) -> None:
        """Write the plan, or refuse (E587) one that differs from what was begun."""
        if self.load():
            if self.plan["identity"] != study.identity:
                hint = "put it back, or begin anew: --output=OTHER; results and cores may change"
                text = f"the study or its base folder has changed since {self.folder} was begun"
                raise FaultError("E587", text, hint, str(study.path))
            return
        make_folder(self.folder)
        self.plan = {
            "talus": talus.version(), "identity": study.identity, "title": study.title,
            "begun": datetime.now(UTC).isoformat(timespec="seconds"), "plan": study.plan,
            "seed": study.seed, "commands": study.commands, "files": hashes(study.base),
            "rows": study.rows(),
        }  # fmt: skip
        write_text_file(self.folder / "study.json", json.dumps(self.plan, indent=1))

    def numbers(self) -> range:
        """Return the numbers of the points."""
        return range(1, len(self.plan["rows"]) + 1)

    def end_of(self, number: int) -> dict | None:
        """Return exit code and times of a finished point, else None."""
        try:
            return json.loads((self.point(number) / "exit").read_text())
        except (OSError, ValueError):
            return None

    def lock(self, number: int) -> int | None:
        """Return a descriptor that locks a point, or None while a process of it runs."""
        return lock_file(self.folder / "locks" / f"{number:04d}")

    def message(self, number: int) -> str:
        """Return the first error of a point's output, else its last line."""
        try:
            lines = (self.point(number) / "point.out").read_text(errors="replace").splitlines()
        except OSError:
            return ""
        lines = [line.strip() for line in lines if line.strip()]
        return next((x for x in lines if re.match(r"error \w", x)), lines[-1] if lines else "")

    def prepare(self, study: Study, number: int) -> Path:
        """Make the folder of a point; return its script. A half-done one is made anew."""
        folder, values = self.point(number), self.plan["rows"][number - 1]
        script = folder / "point.sh"
        if study.run["restart"] and script.is_file():
            return script
        if folder.exists():
            shutil.rmtree(folder)
        folder.parent.mkdir(parents=True, exist_ok=True)
        links = set(study.link)
        shutil.copytree(study.base, folder, ignore=lambda at, names: [
            n for n in names if str((Path(at) / n).relative_to(study.base)) in links])  # fmt: skip
        for name in links:
            (folder / name).symlink_to((study.base / name).resolve())
        self.edit_decks(study, folder, values)
        write_text_file(script, script_of(study, number, values))
        return script

    def edit_decks(self, study: Study, folder: Path, values: dict) -> None:
        """Put the values of a point into its decks."""
        texts: dict[str, str] = {}
        for one in study.parameters:
            for k, target in enumerate(one.targets):
                text = texts.get(target.deck) or (folder / target.deck).read_text()
                kind = study.kinds[one.name, k]
                texts[target.deck] = deck_text.put(text, target, values[one.name], kind)
        for name, text in texts.items():
            (folder / name).unlink()
            (folder / name).write_text(text)


def lock_file(path: Path) -> int | None:
    """Return a descriptor with an exclusive lock of a file, or None if another holds it."""
    make_folder(path.parent)
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        return None
    return descriptor


def word_of(value: object) -> str:
    """Return a value as a word of a command."""
    return repr(value) if isinstance(value, float) else shlex.quote(str(value))


def line_of(command: str, number: int, values: dict) -> str:
    """Return a command with the values in place of {name} and its program found."""
    known = values | {"point": number}
    first, _, rest = WORD.sub(lambda found: word_of(known[found[1]]), command).partition(" ")
    if first in PROGRAMS:
        first = shlex.quote(str(find_program(first)))
    elif first in ("python", "python3"):
        first = shlex.quote(sys.executable)
    elif first == "talus":
        home = shlex.quote(str(Path(talus.__file__).resolve().parent.parent))
        first = f"PYTHONPATH={home} {shlex.quote(sys.executable)} -m talus"
    return f"{first} {rest}".strip()


def script_of(study: Study, number: int, values: dict) -> str:
    """Return the script of a point; only this makes it finished."""
    lines = "\n".join(line_of(command, number, values) for command in study.commands)
    title = study.title.replace("\n", " ")
    return SCRIPT.format(number=number, title=title, threads=study.run["threads"], commands=lines)
