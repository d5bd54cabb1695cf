"""`talus study`: many runs of a base folder of decks, with parameters drawn by a plan."""

import argparse
import csv
import shutil
import signal
import sys
from pathlib import Path

from talus.faults import FaultError
from talus.study.definition import Study, check_decks, read_study
from talus.study.folders import Store
from talus.study.runner import Runner, span

FAILURES = 2  # exit code when points have failed


def register(commands: argparse._SubParsersAction) -> None:
    """Add `study`."""
    new = commands.add_parser("study", help="many runs: parameters, plan, sensitivities")
    new.add_argument("file", type=Path, help="study.toml")
    new.add_argument("-o", "--output", type=Path, help="folder of results (default: STEM_results)")
    new.add_argument("--again", action="store_true", help="run the failed points again")
    ways = new.add_mutually_exclusive_group()
    ways.add_argument("--plan", action="store_true", help="print the points, run nothing")
    ways.add_argument("--status", action="store_true", help="say how far it is, run nothing")
    ways.add_argument("--collect", action="store_true", help="table and figures of what there is")
    new.set_defaults(run=study)


def study(options: argparse.Namespace) -> int:
    """Run what is left of a study, then collect."""
    one = read_study(options.file, options.output)
    store = Store(one.output)
    if options.plan:
        return show_plan(one)
    if options.status or options.collect:
        if not store.load():
            hint = f"talus study {options.file}"
            raise FaultError("E594", f"{store.folder} holds no study that was begun", hint)
        refuse_other(one, store)
        return show_status(store) if options.status else collect(one, store)
    check_decks(one)
    store.begin(one)
    if options.again:
        forget_failed(store)
    if one.run["scheduler"] != "local":
        from talus.study.jobs import submit

        print(*submit(one, store), sep="\n")
        return 0
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    Runner(one, store).run()
    return collect(one, store)


def refuse_other(one: Study, store: Store) -> None:
    """Refuse (E587) to evaluate points of other parameters than those of the file."""
    if set(store.plan["rows"][0]) != {p.name for p in one.parameters}:
        text = f"{store.folder} was begun with other parameters"
        raise FaultError("E587", text, ", ".join(store.plan["rows"][0]), str(one.path))


def forget_failed(store: Store) -> None:
    """Remove the folders of failed points, so that they are run again."""
    for number in store.numbers():
        end = store.end_of(number)
        if end is not None and end["exit_code"]:
            shutil.rmtree(store.point(number))


def show_plan(one: Study) -> int:
    """Print the points as CSV, after a check against the decks."""
    check_decks(one)
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(["point", *(p.name for p in one.parameters)])
    for number, row in enumerate(one.rows(), 1):
        writer.writerow([number, *row.values()])
    return 0


def show_status(store: Store) -> int:
    """Print how many points are in which state, their time, and the failed ones."""
    ends = {n: store.end_of(n) for n in store.numbers()}
    done = [end for end in ends.values() if end is not None]
    failed = [n for n, end in ends.items() if end is not None and end["exit_code"]]
    print(f"{len(done)} of {len(ends)} points are done, {len(failed)} of them failed")
    if done:
        mean = sum(end["end"] - end["begin"] for end in done) / len(done)
        left = (len(ends) - len(done)) * mean
        print(f"{mean:.3g} s a point; {span(left)} of work are left")
    for number in failed:
        print(f"point {number}: exit code {ends[number]['exit_code']}: {store.message(number)}")
    return 0


def collect(one: Study, store: Store) -> int:
    """Write table, statistics, figures and page; return 2 if points failed."""
    from talus.study.page import finish

    table, files = finish(one, store)
    print(*files, sep="\n")
    bad = [k for k, state in enumerate(table.state) if state == "failed"]
    for k in bad:
        print(f"point {k + 1}: exit code {table.exit_code[k]}: {table.message[k]}",
              file=sys.stderr)  # fmt: skip
    if bad and not table.count("finished") and not table.count("waiting"):
        text = f"every one of the {len(bad)} points failed"
        hint = f"see {store.point(bad[0] + 1)}/point.out"
        raise FaultError("E595", text, hint, exit_code=FAILURES)
    return FAILURES if bad else 0
