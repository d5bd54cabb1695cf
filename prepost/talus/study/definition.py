"""The study file: read, checked, and compared with what was begun."""

import hashlib
import json
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

from talus.faults import FaultError
from talus.programs import program_of
from talus.study import deck_keys, deck_text, plans
from talus.study.faults import check_words, nearest, take
from talus.study.parameters import Parameter, read_parameter
from talus.study.results import Curve, Result, read_curve, read_result

STUDY = ("title", "base", "commands", "plan", "points", "levels", "seed", "most", "link", "output")
RUN = ("cores", "threads", "scheduler", "limit", "options", "restart", "at_once")
TABLES = ("study", "parameter", "result", "curve", "run")
SCHEDULERS = ("local", "slurm", "pbs")
WORD = re.compile(r"\{([A-Za-z_]\w*)\}")
MOST = 10000  # points, unless the study allows more


@dataclass
class Study:
    """A study file that is in order: what is run, over what, what is asked of it."""

    path: Path
    title: str
    base: Path
    commands: list[str]
    link: list[str]
    plan: str
    points: int
    levels: int
    seed: int
    output: Path
    parameters: list[Parameter]
    results: list[Result]
    curves: list[Curve]
    run: dict
    identity: str = ""
    kinds: dict[tuple[str, int], str] | None = None

    def rows(self) -> list[dict]:
        """Return the values of the parameters at every point."""
        return plans.make_points(self.plan, self.points, self.levels, self.seed, self.parameters)


def load(path: Path) -> dict:
    """Return the tables of a study file."""
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as fault:
        raise FaultError("E580", f"cannot read {path}: {fault.strerror}") from fault
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as fault:
        raise FaultError("E580", f"{path} is no TOML: {fault}") from fault
    check_words(tables, TABLES, str(path))
    for name in ("parameter", "result", "curve"):
        entries = tables.setdefault(name, [])
        if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
            raise FaultError("E580", f"'{name}' is a list of tables", f"[[{name}]]", str(path))
    for name in ("study", "run"):
        if not isinstance(tables.setdefault(name, {}), dict):
            raise FaultError("E580", f"'{name}' is a table", f"[{name}]", str(path))
    return tables


def read_run(table: dict, place: str) -> dict:
    """Return how points are run, with defaults."""
    check_words(table, RUN, place)
    run = {word: take(table, word, int, place, default)
           for word, default in (("cores", 1), ("threads", 1), ("at_once", 50))}  # fmt: skip
    if min(run.values()) < 1:
        raise FaultError("E580", "cores, threads and at_once are 1 or more", "", place)
    run["scheduler"] = take(table, "scheduler", str, place, "local")
    if run["scheduler"] not in SCHEDULERS:
        hint = nearest(run["scheduler"], SCHEDULERS)
        raise FaultError("E593", f"unknown scheduler '{run['scheduler']}'", hint, place)
    run["limit"] = take(table, "limit", (int, float), place, 0)
    run["options"] = take(table, "options", list, place, [])
    run["restart"] = take(table, "restart", bool, place, False)
    return run


def check_names(named: list, place: str) -> None:
    """Refuse (E583) a name that two parameters or results have."""
    names = [one.name for one in named]
    for name in names:
        if names.count(name) > 1 or name == "point":
            text = f"the name '{name}' is {'taken' if name == 'point' else 'there twice'}"
            raise FaultError("E583", text, "", place)


def check_clash(taken: dict, mark: tuple, component: int, name: str, place: str) -> None:
    """Refuse (E583) a second parameter for one place of a deck; (component 0 is all of it)."""
    for old, owner in taken.setdefault(mark, []):
        if old == component or 0 in (old, component):
            text = f"two parameters change {mark[-1]} of {mark[0]}"
            raise FaultError("E583", text, f"'{owner}' and '{name}'", place)
    taken[mark].append((component, name))


def check_commands(commands: list, parameters: list[Parameter], place: str) -> None:
    """Refuse (E592) commands without words, and words in braces that are no parameter."""
    known = [p.name for p in parameters]
    if not commands or not all(isinstance(c, str) and c.strip() for c in commands):
        raise FaultError("E592", "commands is a list of lines", 'commands = ["talus-dem a.nml"]',
                         place)  # fmt: skip
    used = set()
    for command in commands:
        for name in WORD.findall(command):
            used.add(name)
            if name not in [*known, "point"]:
                hint = nearest(name, known)
                raise FaultError("E592", f"'{command}': no parameter '{name}'", hint, place)
    for p in parameters:
        if not p.targets and p.name not in used:
            hint = f"give deck and key, or write {{{p.name}}} into a command"
            raise FaultError("E592", f"parameter '{p.name}' is used nowhere", hint, place)


def check_decks(study: Study) -> None:
    """Check every key in its deck and every value of it in the plan; note the types."""
    study.kinds, rows, taken = {}, study.rows(), {}
    for one in study.parameters:
        for number, target in enumerate(one.targets):
            deck, place = study.base / target.deck, f"{study.path} ({one.name})"
            if not deck.is_file():
                names = sorted(p.name for p in study.base.glob("*.nml"))
                hint = nearest(target.deck, names)
                raise FaultError("E589", f"no deck '{target.deck}' in {study.base}", hint, place)
            key = deck_keys.find_key(program_of(deck), target, place)
            if key["most"] > 1 and not target.component:
                hint = f"{target.group}.{target.key}(1)"
                text = f"{target.key} has several values: say which"
                raise FaultError("E581", text, hint, place)
            deck_keys.check_parameter(one, key, [row[one.name] for row in rows], str(study.path))
            text = deck.read_text()
            deck_text.put(text, target, rows[0][one.name], key["type"])
            mark = (target.deck, deck_text.choose(text, target).end, target.key)
            check_clash(taken, mark, target.component, one.name, place)
            study.kinds[one.name, number] = key["type"]


def identity_of(study: Study, tables: dict) -> str:
    """Return a hash of all that decides what the points are; results and cores do not count."""
    own = {k: v for k, v in tables["study"].items() if k not in ("title", "output", "most")}
    total = hashlib.sha256(json.dumps([own, tables["parameter"]], sort_keys=True).encode())
    for name, digest in hashes(study.base).items():
        total.update(f"{name} {digest}\n".encode())
    return total.hexdigest()


def hashes(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of every file of a folder by its name."""
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest()
            for p in sorted(folder.rglob("*")) if p.is_file()}  # fmt: skip


def read_study(path: Path, output: Path | None = None) -> Study:
    """Return the study of a file; every fault of it is E580 to E593."""
    tables = load(path)
    table, place = tables["study"], str(path)
    check_words(table, STUDY, place)
    base = path.parent / str(take(table, "base", str, place))
    if not base.is_dir():
        raise FaultError("E589", f"no base folder {base}", "", place)
    plan = str(take(table, "plan", str, place))
    if plan not in plans.PLANS:
        raise FaultError("E585", f"unknown plan '{plan}'", nearest(plan, plans.PLANS), place)
    parameters = [read_parameter(e, f"{path}: parameter {k}")
                  for k, e in enumerate(tables["parameter"], 1)]  # fmt: skip
    if not parameters:
        raise FaultError("E580", "the study has no parameter", "[[parameter]]", place)
    known, results = [p.name for p in parameters], []
    for k, entry in enumerate(tables["result"], 1):
        results.append(read_result(entry, known, f"{path}: result {k}"))
        known.append(results[-1].name)
    check_names([*parameters, *results], place)
    numbers = [take(table, word, int, place, default)
               for word, default in (("points", 0), ("levels", 3), ("seed", 1), ("most", MOST))
               ]  # fmt: skip
    points, levels, seed, most = numbers
    if levels < 2:
        raise FaultError("E585", f"levels = {levels}: two or more", "", place)
    size = plans.size_of(plan, points, levels, parameters)
    plans.check_plan(plan, points, most, size, place)
    commands = take(table, "commands", list, place)
    check_commands(commands, parameters, place)
    folder = output or path.parent / take(table, "output", str, place, f"{path.stem}_results")
    if folder.resolve().is_relative_to(base.resolve()):
        raise FaultError("E580", f"the results {folder} lie in the base folder", "output", place)
    curves = [read_curve(e, f"{path}: curve {k}") for k, e in enumerate(tables["curve"], 1)]
    study = Study(path, take(table, "title", str, place, path.stem), base, commands,
                  take(table, "link", list, place, []), plan, points, levels, seed, folder,
                  parameters, results, curves, read_run(tables["run"], place))  # fmt: skip
    for name in study.link:
        if not (base / str(name)).is_file():
            raise FaultError("E589", f"link: no file '{name}' in {base}", "", place)
    study.identity = identity_of(study, tables)
    return study
