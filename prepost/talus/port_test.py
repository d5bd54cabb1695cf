"""Drive a solver at the exchange port through every verb and find what it does wrong.

`test_solver` starts the command several times: once through all verbs, with requests that must be
refused between them, then once for each way to end.
"""

import os
import signal
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from talus import port_judge
from talus.port import Message
from talus.port_asker import LostError, SolverAsker, rows
from talus.port_judge import Finding, Judge
from talus.port_names import ROLES, Field

VERB_OF = {"solve": "SOLVE", "advance": "ADVANCE", "force": "FORCE", "kick_drift": "KICK_DRIFT",
           "reject": "REJECT", "checkpoint": "CHECKPOINT", "population": "WAKE"}  # fmt: skip
FAR = 1.0e3  # m; a surface there touches nothing


@dataclass
class Options:
    """What a user may say of the solver."""

    transport: str = "shared_memory"
    time_limit: float = 10.0  # s
    facets: str = ""
    group: str = ""
    material: str = ""  # of a surface
    dt: float = 0.0  # s; 0: the solver's step limit


@dataclass
class Session:
    """A solver under test: what was asked, what was found."""

    asker: SolverAsker
    options: Options
    found: list[Finding] = field(default_factory=list)
    asked: int = 0
    judge: Judge = field(default_factory=Judge)
    words: list[str] = field(default_factory=list)  # capabilities
    time: float = 0.0  # s
    dt: float = 1.0e-6  # s
    checkpoint: str = ""
    hello: tuple[Message, Message] | None = None
    loads: dict[str, np.ndarray] = field(default_factory=dict)  # fields of the sets in a step

    def good(self, section: str, verb: str, **fields: object) -> Message | None:
        """Ask what must be answered; None when the reply is a fault."""
        self.asked += 1
        request, reply = self.asker.ask(verb, *self.interval(verb), **fields)
        for page, text in self.judge.look(request, reply):
            self.found.append((section if page == "Verbs" else page, f"{self.of(request)}: {text}"))
        if reply.status:
            text = f"{reply.text(Field.ERROR_CODE)}: {reply.text(Field.ERROR_MESSAGE)}"
            self.found.append((section, f"{self.of(request)} was refused: {text}"))
            return None
        return reply

    def maybe(self, verb: str, **fields: object) -> Message | None:
        """Ask what may be refused; then the refusal has its form."""
        self.asked += 1
        request, reply = self.asker.ask(verb, *self.interval(verb), **fields)
        for page, text in self.judge.look(request, reply):
            self.found.append((page, f"{self.of(request)}: {text}"))
        return None if reply.status else reply

    def bad(self, section: str, why: str, verb: str, **fields: object) -> None:
        """Ask what must be refused."""
        self.asked += 1
        request, reply = self.asker.ask(verb, *self.interval(verb), **fields)
        found = port_judge.header(request, reply)
        if reply.status:
            found += port_judge.refusal(reply)
        self.found += [(page, f"{verb} {why}: {text}") for page, text in found]
        if not reply.status:
            self.found.append((section, f"{verb} {why} was not refused"))

    def interval(self, verb: str) -> tuple[float, float]:
        """Return the times of a request [s]."""
        steps = ("ADVANCE", "SOLVE", "KICK_DRIFT")
        return self.time, self.time + (self.dt if verb in steps else 0.0)

    @staticmethod
    def of(request: Message) -> str:
        """Name a request."""
        what = request.text(Field.WHAT) or request.text(Field.ROLE)
        return f"{request.name} {what}".strip()

    def step(self) -> dict[str, object]:
        """Return the fields of the sets in a step."""
        return {name.replace(".", "__"): value for name, value in self.loads.items()}

    def can(self, word: str) -> bool:
        """Return whether a capability was told."""
        return word in self.words


def greet(s: Session) -> bool:
    """HELLO, before it what must wait for it."""
    s.bad("Verbs", "before HELLO", "READY")
    s.asked += 1
    _, reply = s.asker.hello(protocol=99)
    if not reply.status:
        s.found.append(("A message", "HELLO with protocol 99 was not refused"))
    s.asked += 1
    s.hello = s.asker.hello()
    reply = s.hello[1]
    if reply.status:
        why = f"{reply.text(Field.ERROR_CODE)}: {reply.text(Field.ERROR_MESSAGE)}"
        s.found.append(("Verbs", f"HELLO was refused: {why}"))
        return False
    s.found += port_judge.hello(reply)
    s.words = [w for w in reply.text(Field.CAPABILITIES).split(",") if w]
    s.time = float(rows(reply, Field.TIME)[0]) if Field.TIME in reply.fields else 0.0
    limit = rows(reply, Field.STEP_LIMIT)
    step = rows(reply, Field.DT)
    s.dt = s.options.dt or (float(step[0]) if step.size else 0.0)
    s.dt = s.dt or (0.5 * float(limit[0]) if limit.size and 0.0 < limit[0] < 1.0 else 1.0e-6)
    return True


def describe(s: Session) -> Message | None:
    """DESCRIBE: the mesh or the grains, which tell the side, and the rest."""
    s.asked += 1
    request, reply = s.asker.ask("DESCRIBE", what="grains")
    s.judge.side = "solid" if reply.status else "grains"
    own = "mesh" if reply.status else "grains"
    s.found += s.judge.look(*s.hello)
    before = len(s.found)
    body = s.good("DESCRIBE", "DESCRIBE", what=own)
    if own == "mesh" and body is not None and len(s.found) == before:
        s.found += port_judge.mesh(body)
    for what in ("quadrature", "groups") if own == "mesh" else ("contacts", "groups"):
        s.maybe("DESCRIBE", what=what)
    if s.options.facets:
        s.good("DESCRIBE", "DESCRIBE", what="facets", group=s.options.facets)
    if s.options.group:
        s.good("DESCRIBE", "DESCRIBE", what="group", group=s.options.group)
    s.bad("DESCRIBE", "of something that is not there", "DESCRIBE", what="nonsense")
    s.bad("DESCRIBE", "of a group that is not there", "DESCRIBE", what="group", group="no such")
    s.bad("A message", "without 'what'", "DESCRIBE")
    s.bad("A message", "with a field that is not known", "DESCRIBE", what=own, nonsense=1.0)
    return body


def choose(s: Session, body: Message) -> None:
    """SELECT every role that the solver has, and what it must refuse."""
    ids, count = rows(body, Field.ID).ravel(), len(rows(body, Field.ID))
    kinds = np.ravel(rows(body, Field.KIND))
    if s.judge.side == "grains":
        free = np.flatnonzero(kinds == 0)
        chosen = {"report": [count - 1], "prescribe": [0], "load": list(free[free > 0][-1:])}
    else:
        chosen = {"report": [0, count - 1], "load": list(range(max(0, count - 4), count))}
        chosen["prescribe"] = [count // 2]
    first = next((role for role in ROLES if s.can(role) and role in chosen), "report")
    known = ids[chosen[first]]
    s.bad("Sets", "of a role that there is not", "SELECT", set="t_bad", role="no", id=known)
    s.bad("Sets", "of an id that is not there", "SELECT", set="t_bad", role=first, id=[10**9])
    s.bad("A message", "without ids", "SELECT", set="t_bad", role=first)
    s.bad("A message", "with ids that are reals", "SELECT", set="t_bad", role=first,
          id=known.astype(float))  # fmt: skip
    for role, places in chosen.items():
        if not s.can(role) or not places:
            continue
        reply = s.good("Sets", "SELECT", set=f"t_{role}", role=role, id=ids[places])
        if reply is None:
            continue
        s.judge.sets[f"t_{role}"] = role, len(places)
        if role == "load":
            s.loads[f"t_{role}.{Field.FORCE}"] = np.zeros((len(places), 3))
        elif role == "prescribe" and s.judge.side == "grains":
            s.loads[f"t_{role}.{Field.X}"] = rows(body, Field.X)[places]
    for role in ("report", "prescribe", "load"):
        if not s.can(role):
            s.bad("Capabilities", f"of the role {role}, which is no capability", "SELECT",
                  set="t_bad", role=role, id=known)  # fmt: skip
    if s.can("surface") and s.options.material:
        surface(s)


def surface(s: Session) -> None:
    """SELECT a triangle that touches nothing, and one of vertices that are not there."""
    x = FAR + np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    given = {"role": "surface", "id": [1, 2, 3], "x": x, "material": s.options.material}
    s.bad("Sets", "of a triangle with a vertex that is not there", "SELECT", set="t_bad",
          triangle=[[1, 2, 9]], **given)  # fmt: skip
    if s.good("Sets", "SELECT", set="t_surface", triangle=[[1, 2, 3]], **given) is not None:
        s.judge.sets["t_surface"] = "surface", 3
        s.loads["t_surface.x"] = x


def set_up(s: Session) -> None:
    """SET what the capabilities tell of, and what must be refused."""
    load = s.judge.sets.get("t_load")
    if load and s.can("dead_load"):
        s.good("Sets", "SET", what="dead_load", set="t_load", force=np.zeros((load[1], 3)))
        s.bad("A message", "dead_load with a row too many", "SET", what="dead_load", set="t_load",
              force=np.zeros((load[1] + 1, 3)))  # fmt: skip
        s.bad("Sets", "dead_load of a set that was not selected", "SET", what="dead_load",
              set="t_none", force=np.zeros((load[1], 3)))  # fmt: skip
    if load and s.can("springs"):
        node = np.array([[1]])
        s.good("Sets", "SET", what="springs", node=node, weight=np.array([[1.0]]), stiffness=[0.0])
    if load and s.can("mass_factor"):
        s.good("Sets", "SET", what="mass_factor", set="t_load", value=np.ones(load[1]))
    s.bad("SET", "of something that there is not", "SET", what="nonsense")
    for word, verb in VERB_OF.items():
        if not s.can(word):
            s.bad("Capabilities", f"without the capability {word}", verb)


def ready(s: Session) -> None:
    """READY, after a rehearsal where there is one; before it no step is answered."""
    s.bad("Verbs", "before READY", "ACCEPT")
    if s.can("rehearsal"):
        s.good("Steps", "READY", rehearsal=1)
        if verb := next((VERB_OF[w] for w in ("solve", "advance") if s.can(w)), ""):
            s.good("Steps", verb, **s.step())
            s.good("Steps", "ACCEPT")
    s.good("Verbs", "READY")


def steps(s: Session) -> None:
    """Every verb of a step, refusals between them, REJECT bit for bit."""
    for word in ("solve", "advance"):
        if not s.can(word):
            continue
        verb = VERB_OF[word]
        first = s.good("Verbs", verb, **s.step())
        if s.can("reject"):
            refuse_fields(s, verb)
            s.good("Verbs", "REJECT")
            again = s.good("Verbs", verb, **s.step())
            differ = port_judge.same_reply(first, again) if first and again else []
            if differ:
                s.found.append(("Capabilities", "after REJECT the same step gives another "
                                f"{', '.join(differ)}"))  # fmt: skip
        if s.good("Verbs", "ACCEPT") is not None:
            s.time += s.dt
    if s.can("force"):
        s.good("Steps", "FORCE", scope="all")
        brief(s, s.good("Steps", "FORCE", brief=1), "FORCE")
        s.bad("Steps", "with a scope that there is not", "FORCE", scope="nonsense")
    if s.can("impulse"):
        push = {f"{n.rpartition('.')[0]}__{Field.IMPULSE}": f for n, f in s.loads.items()}
        for verb in ("ADVANCE", "KICK_DRIFT"):
            more = {} if verb == "ADVANCE" else {"kick": 0.0, "drift": 0.0}
            s.good("Steps", verb, **push, **more)
        s.good("Verbs", "REJECT")
    if s.can("kick_drift"):
        s.good("Steps", "KICK_DRIFT", kick=0.0, drift=s.dt)
        brief(s, s.good("Steps", "KICK_DRIFT", kick=s.dt, drift=0.0, brief=1), "KICK_DRIFT")
        s.bad("A message", "without 'kick'", "KICK_DRIFT", drift=s.dt)
        if s.good("Verbs", "ACCEPT", final=1) is not None:
            s.time += s.dt


def brief(s: Session, reply: Message | None, verb: str) -> None:
    """Look whether a brief reply is brief."""
    if reply is not None and Field.SCALARS in reply.fields:
        s.found.append(("Steps", f"{verb} with brief = 1 has scalars"))


def refuse_fields(s: Session, verb: str) -> None:
    """Ask for a step with a field of a wrong shape or kind, one that is not known."""
    given = s.step()
    for name, value in s.loads.items():
        key = name.replace(".", "__")
        s.bad("A message", f"with a row too many in {name}", verb,
              **(given | {key: np.vstack([value, value[:1]])}))  # fmt: skip
        s.bad("A message", f"with integers in {name}", verb, **(given | {key: value.astype(int)}))
    s.bad("A message", "with a field that is not known", verb, **(given | {"nonsense": 1.0}))


def files_and_end(s: Session) -> None:
    """Signals, CHECKPOINT, WRITE, STOP."""
    os.kill(s.asker.process.pid, signal.SIGTERM)
    try:
        s.maybe("DESCRIBE", what="groups")
    except LostError as why:
        text = f"after SIGTERM, which is talus-couple's: {why}"
        raise LostError(text) from why
    if s.can("checkpoint"):
        reply = s.good("Verbs", "CHECKPOINT", tag="port_test")
        s.checkpoint = reply.text(Field.PATH) if reply else ""
        if reply and not Path(s.checkpoint).is_file():
            s.found.append(("Verbs", f"CHECKPOINT names '{s.checkpoint}', which is not there"))
        if reply and not reply.text(Field.HASH):
            s.found.append(("Verbs", "CHECKPOINT has no hash"))
    s.maybe("WRITE", tag="port_test")
    s.good("What a partner does", "STOP")
    judge_code(s, "STOP", 0)


def judge_code(s: Session, after: str, wanted: int | None) -> None:
    """Look whether the solver ends, and how; None: with any code but 0."""
    code = s.asker.exit_code()
    due = "another than 0" if wanted is None else str(wanted)
    if code is None:
        s.found.append(("What a partner does", f"after {after} the solver does not end"))
    elif code == 0 if wanted is None else code != wanted:
        text = f"after {after} the exit code is {code}, {due} is due"
        s.found.append(("What a partner does", text))


def through(s: Session) -> None:
    """Ask everything once."""
    if not greet(s):
        return
    body = describe(s)
    if body is None:
        return
    choose(s, body)
    set_up(s)
    ready(s)
    steps(s)
    files_and_end(s)


def stop_early(s: Session) -> None:
    """STOP with early = 1: exit code 3."""
    s.asker.hello()
    s.asker.ask("STOP", early=1)
    judge_code(s, "STOP with early = 1", 3)


def abort(s: Session) -> None:
    """ABORT: an empty reply, exit code 4."""
    s.asker.hello()
    _, reply = s.asker.ask("ABORT")
    if reply.status or reply.fields:
        s.found.append(("What a partner does", "the reply of ABORT is not empty"))
    judge_code(s, "ABORT", 4)


def partner_dies(s: Session) -> None:
    """The port goes away: exit code 4."""
    s.asker.hello()
    s.asker.leave()
    judge_code(s, "the end of talus-couple", 4)


def forged(name: str, verb: str = "HELLO", **wrong: int) -> Callable[[Session], None]:
    """Return a test that sends a message with wrong words in its header."""

    def test(s: Session) -> None:
        """Send it: the solver refuses it or leaves."""
        s.asker.hello()
        request = s.asker.request(verb, 0.0, 0.0, {})
        s.asker.send(request, **wrong)
        try:
            reply = s.asker.receive()
        except LostError as why:
            if s.asker.process.poll() == 0 or "no reply" in str(why):
                s.found.append(("A message", f"{name}: {why}"))
            return
        if not reply.status:
            s.found.append(("A message", f"{name} was answered as if it were good"))

    return test


ENDS = (
    ("STOP with early = 1", stop_early),
    ("ABORT", abort),
    ("the death of talus-couple", partner_dies),
    ("a wrong checksum", forged("a message with a wrong checksum", "ACCEPT", checksum=12345)),
    ("a wrong number", forged("a message out of sequence", "ACCEPT", sequence=77)),
    ("an unknown verb", forged("a verb that there is not", "NONE")),
)


def restarted(first: Session) -> Callable[[Session], None]:
    """Return a test that starts from the checkpoint of another session."""

    def test(s: Session) -> None:
        """HELLO with `restart` tells the time of the checkpoint."""
        request, reply = s.asker.hello(restart=first.checkpoint)
        s.judge.side = first.judge.side
        s.found += s.judge.look(request, reply)
        if reply.status:
            s.found.append(("Capabilities", f"HELLO with restart: {reply.text('error.message')}"))
        elif abs(float(rows(reply, Field.TIME)[0]) - first.time) > 1e-9 * abs(first.time):
            s.found.append(("Capabilities", f"after a restart time is {rows(reply, Field.TIME)[0]}"
                            f", that of the checkpoint was {first.time}"))  # fmt: skip
        s.asker.ask("STOP")
        judge_code(s, "STOP", 0)

    return test


def run_one(command: list[str], options: Options, test: Callable[[Session], None],
            name: str) -> Session:  # fmt: skip
    """Start the solver for one test."""
    with SolverAsker(command, options.transport, options.time_limit) as asker:
        s = Session(asker, options)
        try:
            test(s)
        except LostError as why:
            last = f" (the solver printed: {asker.output()})" if asker.output() else ""
            s.found.append(("Death and hang", f"{name}, request {asker.sequence}: {why}{last}"))
        return s


def test_solver(command: list[str], options: Options) -> tuple[list[Finding], int, str]:
    """Return what was found, the number of requests, and the side of the solver."""
    first = run_one(command, options, through, "all verbs")
    found, asked = list(first.found), first.asked
    tests = list(ENDS)
    if first.checkpoint and Path(first.checkpoint).is_file():
        tests.append(("a restart", restarted(first)))
    if first.words:  # who does not get through HELLO fails in all the rest
        for name, test in tests:
            one = run_one(command, options, test, name)
            found, asked = found + one.found, asked + one.asker.sequence
    return list(dict.fromkeys(found)), asked, first.judge.side
