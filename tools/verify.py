"""Run verification cases and write build/verification/summary.json and a badge of its counts.

Usage: verify.py [--case ID ...] [--area NAME ...] [--quick] [--ranks N] [--solid-ranks N]
       [--jobs N] [--accept] [--bin build/bin] [--out build/verification]
A case is verification/<area>/<id>/ with case.toml and exact.py (see talus.verification).
Cases that were not run keep their last result in the summary. With --ranks every run of talus-dem,
by talus-couple too, has that many, with --solid-ranks every talus-fem of a coupled run; give --out
another folder then. A case whose case.toml says by `one_solid_rank` why its solid cannot have ranks
is named with that reason and not run. With --jobs so many cases run at a time, on one thread each.
With --accept (`make verification ACCEPT=1`) the badge of the README is written anew.
"""

import argparse
import difflib
import importlib.util
import json
import multiprocessing
import os
import shutil
import sys
import time
import tomllib
import traceback
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "prepost"))
sys.dont_write_bytecode = True

import verification_table  # noqa: E402

from talus import version  # noqa: E402
from talus.study.runner import span  # noqa: E402
from talus.verification import Case  # noqa: E402


def find_cases() -> dict[str, dict]:
    """Return id -> facts of case.toml, with its area and folder."""
    cases = {}
    for path in sorted(ROOT.glob("verification/*/*/case.toml")):
        facts = tomllib.loads(path.read_text())
        if facts["id"] != path.parent.name:
            raise SystemExit(f"verify: {path}: id '{facts['id']}' differs from the folder's name")
        cases[facts["id"]] = facts | {"area": path.parent.parent.name, "folder": path.parent}
    return cases


def run_cases(
    chosen: list[dict], settings: tuple[Path, Path, tuple[int, int]], jobs: int
) -> Iterator[dict]:
    """Yield the entries of the chosen cases as they end; with jobs > 1 each has its own process."""
    work = [(facts, *settings) for facts in chosen]
    if jobs < 2:
        for item in work:
            yield run_case(item)
        return
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    importlib.import_module("talus.look")  # half a second that each process would need
    with multiprocessing.get_context("fork").Pool(jobs, maxtasksperchild=1) as pool:
        yield from pool.imap_unordered(run_case, work, chunksize=1)


def run_case(item: tuple[dict, Path, Path, tuple[int, int]]) -> dict:
    """Run one case (facts, binaries, out, ranks of both sides) in a copy of its folder."""
    facts, binaries, out, ranks = item
    scratch = out / facts["id"]
    shutil.rmtree(scratch, ignore_errors=True)
    shutil.copytree(facts["folder"], scratch)
    spec = importlib.util.spec_from_file_location(f"exact_{facts['id']}", scratch / "exact.py")
    module = importlib.util.module_from_spec(spec)
    case = Case(facts["id"], facts["title"], scratch, binaries, *ranks)
    start, error = time.monotonic(), ""
    sys.path.insert(0, str(facts["folder"].parent))
    try:
        spec.loader.exec_module(module)
        module.run(case)
    except Exception as fault:  # a case that breaks is a case that fails, with its text
        error = f"{type(fault).__name__}: {fault}"
        (scratch / "traceback.txt").write_text(traceback.format_exc())
    finally:
        sys.path.pop(0)
    keep = ("id", "title", "area", "quick", "claim", "source")
    entry = {key: facts.get(key) for key in keep} | {
        "metrics": case.metrics,
        "figures": case.figures,
    }
    good = not error and bool(case.metrics) and all(m["pass"] for m in case.metrics)
    return entry | {"error": error, "pass": good, "seconds": round(time.monotonic() - start, 2)}


def show(entry: dict) -> None:
    """Print one case: a line, and its failures."""
    state = "pass" if entry["pass"] else "FAIL"
    print(
        f"{state}  {entry['area']:7s} {entry['id']:28s} {len(entry['metrics']):3d} metrics "
        f"{entry['seconds']:8.1f} s"
    )
    for m in entry["metrics"]:
        if not m["pass"]:
            wanted = f"limit {m['limit']:.4g}" + (
                "" if m["expected"] is None else f" about {m['expected']:.8g}"
            )
            print(f"      {m['metric']}: {m['value']} ({wanted})")
    if entry["error"]:
        print("      " + entry["error"].replace("\n", "\n      "))
    sys.stdout.flush()


def choose(cases: dict[str, dict], wanted: list[str], quick: bool, areas: list[str]) -> list[dict]:
    """Return the cases to run; an unknown id is a fault that names the nearest."""
    for name in wanted:
        if name not in cases:
            near = difflib.get_close_matches(name, cases, 1)
            hint = f"; did you mean '{near[0]}'?" if near else ""
            raise SystemExit(f"verify: no case '{name}'{hint} (there are {', '.join(cases)})")
    return [
        c
        for c in cases.values()
        if (not wanted or c["id"] in wanted)
        and (not quick or c.get("quick"))
        and (not areas or c["area"] in areas)
    ]


def left_text(waiting: list[dict], known: dict[str, float], jobs: int) -> str:
    """Return how many cases wait and how long they will take, by what they and others took [s]."""
    if not waiting:
        return "all cases are done"
    usual = sum(known.values()) / len(known) if known else 0.0
    seconds = sum(known.get(facts["id"], usual) for facts in waiting) / max(jobs, 1)
    return f"{len(waiting)} cases wait, about {span(seconds)} left"


def leave_out(chosen: list[dict]) -> list[dict]:
    """Return the cases whose solid may have ranks; name the others and why."""
    for facts in chosen:
        if reason := facts.get("one_solid_rank"):
            print(f"none  {facts['area']:7s} {facts['id']:28s} {reason}")
    return [facts for facts in chosen if not facts.get("one_solid_rank")]


def main() -> int:
    """Run the cases; return 1 if any failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--case", nargs="+", action="extend", default=[])
    parser.add_argument("--area", nargs="+", default=[])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--ranks", type=int, default=0)
    parser.add_argument("--solid-ranks", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    # make hands the variables of its command line on
    accepted = bool(os.environ.get("ACCEPT"))
    parser.add_argument("--accept", action="store_true", default=accepted)
    parser.add_argument("--bin", type=Path, default=ROOT / "build/bin")
    parser.add_argument("--out", type=Path, default=ROOT / "build/verification")
    options = parser.parse_args()
    os.environ.setdefault("TALUS_BIN", str(options.bin.resolve()))
    cases = find_cases()
    out = options.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    summary = out / "summary.json"
    old = json.loads(summary.read_text())["cases"] if summary.exists() else []
    results = {entry["id"]: entry for entry in old if entry["id"] in cases}
    passed = failed = 0
    chosen = choose(cases, options.case, options.quick, options.area)
    if options.solid_ranks:
        chosen = leave_out(chosen)
    ranks = (options.ranks, options.solid_ranks)
    waiting, known = chosen, {name: entry["seconds"] for name, entry in results.items()}
    for entry in run_cases(chosen, (options.bin.resolve(), out, ranks), options.jobs):
        results[entry["id"]] = entry
        passed, failed = passed + entry["pass"], failed + (not entry["pass"])
        show(entry)
        known[entry["id"]] = entry["seconds"]
        waiting = [facts for facts in waiting if facts["id"] != entry["id"]]
        if sys.stderr.isatty():
            print(f"\r{left_text(waiting, known, options.jobs):60s}", end="\r", file=sys.stderr)
        ordered = [results[name] for name in cases if name in results]
        summary.write_text(json.dumps({"version": version(), "cases": ordered}, indent=1) + "\n")
    badges = [out, *([ROOT / "manual"] if options.accept else [])]
    for folder in badges:
        verification_table.write_badge(folder / verification_table.BADGE, out)
    print(f"{passed} passed, {failed} failed")
    nothing = not passed and not options.solid_ranks  # a case of grains alone has no solid
    return 1 if failed or nothing else 0


if __name__ == "__main__":
    sys.exit(main())
