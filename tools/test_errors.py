"""Run the failing decks of tests/errors and compare exit code, codes and text.

Usage: test_errors.py [--bin build/bin] [--only WORD] [--codes]
Each folder holds expect.toml: program, exit, codes, contains (texts that must appear), optional
args, deck (default deck.nml) and writes = true where files may be left behind. Further, in the
order in which they take effect on a scratch copy:
  base     folders of tests/errors/base whose files are there before those of the case
  edits    [file, old text, new text]; no old text: the new one is put at the end
  (make_input.py is run, if there)
  before   command lines of programs that must succeed before
  damage   Python statements
  partner  a Python script with arguments that runs beside the program; its output counts too
  file_size  limit on the size of a file in bytes, as of a full disk
  ranks    number of ranks that mpirun starts; each code must then occur once
First the codes themselves are checked: those of the sources, of errors.toml and of the tests must
be the same (tools/error_codes.py); --codes does no more than that.
"""

import argparse
import hashlib
import multiprocessing
import os
import re
import resource
import runpy
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "prepost"))

from error_codes import check_codes  # noqa: E402

from talus.verification import launcher  # noqa: E402

FORKS = multiprocessing.get_context("forkserver")  # it loads numpy and HDF5 once for all inputs
CODE = re.compile(r"\b(?:error|warning:) ([A-Z]\d{3})")
LIMIT = 300.0
SAID = "make_input.txt"  # what make_input.py said, removed after it


def contents(folder: Path) -> dict[str, bytes]:
    """Return the hash of every file under a folder by its name (empty for folders)."""
    return {
        str(path.relative_to(folder)): (
            hashlib.sha256(path.read_bytes()).digest() if path.is_file() else b""
        )
        for path in folder.rglob("*")
    }


def run_script(folder: Path, environment: dict[str, str]) -> None:
    """Run make_input.py of a folder in this process; what it says goes to a file there."""
    os.chdir(folder)
    os.environ.update(environment)
    sys.path[:0] = [str(folder)]
    with open(SAID, "w", buffering=1) as said:
        os.dup2(said.fileno(), 1)
        os.dup2(said.fileno(), 2)
        runpy.run_path("make_input.py", run_name="__main__")


class Bench:
    """A scratch copy of a case, and how commands are run in it."""

    def __init__(self, folder: Path, scratch: Path, binaries: Path) -> None:
        """Copy base and case, make the edits."""
        self.expect = tomllib.loads((folder / "expect.toml").read_text())
        self.scratch, self.binaries = scratch, binaries
        self.environment = dict(
            os.environ,
            PYTHONPATH=f"{ROOT / 'prepost'}:{scratch}",
            PYTHONDONTWRITEBYTECODE="1",
            TALUS_BIN=str(binaries),
            TALUS_PYTHON=sys.executable,
            OMP_NUM_THREADS="1",
        )
        for base in self.expect.get("base", []):
            shutil.copytree(ROOT / "tests/errors/base" / base, scratch, dirs_exist_ok=True)
        shutil.copytree(folder, scratch, dirs_exist_ok=True)
        for name, old, new in self.expect.get("edits", []):
            path = scratch / name
            text = path.read_text() if path.exists() else ""
            if old not in text:
                raise ValueError(f"{name} does not hold {old!r}")
            path.write_text(text.replace(old, new) if old else text + new)

    def start(self, command: list[str], file_size: int = 0) -> subprocess.Popen:
        """Start a command in the scratch copy."""

        def limit() -> None:
            if file_size:
                resource.setrlimit(resource.RLIMIT_FSIZE, (file_size, file_size))

        return subprocess.Popen(
            command,
            cwd=self.scratch,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            preexec_fn=limit,
        )

    def prepare(self) -> str:
        """Make the input and run the preparation; return what went wrong."""
        commands = []
        if (self.scratch / "make_input.py").exists() and (wrong := self.make_input()):
            return wrong
        for line in self.expect.get("before", []):
            program, *rest = shlex.split(line)
            commands.append([str(self.binaries / program), *rest])
        if "damage" in self.expect:
            commands.append([sys.executable, "-c", self.expect["damage"]])
        for command in commands:
            process = self.start(command)
            said, _ = process.communicate(timeout=LIMIT)
            if process.returncode:
                return f"{command} failed: {said[-800:]}"
        return ""

    def make_input(self) -> str:
        """Run make_input.py in a process of its own; return what went wrong."""
        process = FORKS.Process(target=run_script, args=(self.scratch, self.environment))
        process.start()
        process.join(LIMIT)
        if process.exitcode is None:  # it hangs
            process.kill()
            process.join()
        said = self.scratch / SAID
        text = said.read_text(errors="replace") if said.exists() else ""
        said.unlink(missing_ok=True)
        return f"make_input.py failed: {text[-800:]}" if process.exitcode else ""

    def run(self) -> tuple[int, str]:
        """Run the program; return exit code (-1: it hangs) and output, the partner's too."""
        expect = self.expect
        program = [str(self.binaries / expect["program"]), expect.get("deck", "deck.nml")]
        room = expect.get("file_size", 0)
        if "ranks" in expect:
            if room:  # that of the ranks alone: mpirun has files of its own
                program = ["prlimit", f"--fsize={room}", *program]
                self.environment["OMPI_MCA_btl"] = "self,tcp"
            program, room = launcher(expect["ranks"]) + program, 0
        partner = None
        if "partner" in expect:
            partner = self.start([sys.executable, *shlex.split(expect["partner"])])
        process = self.start(program + expect.get("args", []), room)
        output, code = "", None
        for one in (process, partner):
            if one is None:
                continue
            try:
                output += one.communicate(timeout=LIMIT)[0]
            except subprocess.TimeoutExpired:
                one.kill()
                output += one.communicate()[0] + "ran longer than allowed"
                code = -1
        return process.returncode if code is None else code, output


def judge(folder: Path, binaries: Path) -> list[str]:
    """Run one failing deck in a scratch copy; return what differs from expect.toml."""
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name) / folder.name
        bench = Bench(folder, scratch, binaries)
        wrong = bench.prepare()
        if wrong:
            return [wrong]
        before = contents(scratch)
        code, output = bench.run()
        after = contents(scratch)
    touched = sorted(
        name for name in before.keys() | after.keys() if before.get(name) != after.get(name)
    )
    return differences(bench.expect, code, output, touched)


def differences(expect: dict, code: int, output: str, touched: list[str]) -> list[str]:
    """Compare a finished run with what was expected."""
    found = []
    if code != expect["exit"]:
        found.append(f"exit code {code}, expected {expect['exit']}")
    missing = set(expect["codes"]) - set(CODE.findall(output))
    if missing:
        found.append(
            f"codes {sorted(missing)} not reported (reported: {sorted(set(CODE.findall(output)))})"
        )
    found += [
        f"text not shown: {text!r}" for text in expect.get("contains", []) if text not in output
    ]
    others = set(re.findall(r"^error ([A-Z]\d{3}): ", output, re.MULTILINE)) - set(expect["codes"])
    if expect["exit"] in (2, 4) and others and "partner" not in expect:
        found.append(f"further codes {sorted(others)}")
    if "ranks" in expect and len(CODE.findall(output)) > len(expect["codes"]):
        found.append("codes more than once")
    if re.search(r"Fortran runtime|Backtrace for|Sanitizer|runtime error:", output):
        found.append("a trace instead of a message")
    if expect["exit"] == 1 and touched and not expect.get("writes"):
        found.append(f"files made, changed or removed: {', '.join(touched)}")
    if found:
        found.append("output: " + output[-1500:])
    return found


def main() -> int:
    """Run all failing decks; return 1 if any was not refused as expected."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", type=Path, default=ROOT / "build/bin")
    parser.add_argument("--only", default="")
    parser.add_argument("--codes", action="store_true")
    options = parser.parse_args()
    FORKS.set_forkserver_preload(["__main__", "talus.mesh", "talus.packing"])
    problems = check_codes()
    passed, failed = int(not problems), len(problems)
    if problems:
        print("FAILED codes\n    " + "\n    ".join(problems))
    folders = [path.parent for path in sorted(ROOT.glob("tests/errors/*/expect.toml"))]
    folders = [f for f in folders if options.only in f.name and not options.codes]
    # some wait for a time limit: two at a time even on one core
    with ThreadPoolExecutor(max(2, os.cpu_count() or 1)) as pool:
        results = pool.map(lambda folder: judge(folder, options.bin.resolve()), folders)
        for folder, found in zip(folders, results, strict=True):
            passed, failed = passed + (not found), failed + bool(found)
            if found:
                print(f"FAILED {folder.name}\n    " + "\n    ".join(found), flush=True)
    print(f"{passed} passed, {failed} failed")
    return 1 if failed or not passed else 0


if __name__ == "__main__":
    sys.exit(main())
