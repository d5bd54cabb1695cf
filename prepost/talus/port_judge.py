"""What is wrong with a reply at the exchange port, by the tables of the page (talus.port_names)."""

from dataclasses import dataclass, field

import numpy as np

from talus.port import Message
from talus.port_messages import REPLIES, SET_REPLIES
from talus.port_names import CAPABILITIES, CELLS, PROTOCOL, VERBS, Field

KINDS = {"f": "real", "i": "integer"}
FAULT = (Field.ERROR_CODE, Field.ERROR_MESSAGE, Field.ERROR_PLACE, Field.ERROR_HINT)
#: Fields of sets that a reply must have: (side, role, verb); others of the role may be there.
MOTION = (Field.U, Field.V, Field.A)
PUSH = (Field.FORCE, Field.MOMENT, Field.IMPULSE, Field.MOMENT_IMPULSE, Field.WORK)
NEEDED = {
    ("solid", role, verb): MOTION
    for role in ("report", "load", "prescribe")
    for verb in ("READY", "SOLVE", "ADVANCE")
} | {
    ("solid", "prescribe", "SOLVE"): (*MOTION, Field.REACTION),
    ("grains", "prescribe", "ADVANCE"): PUSH,
    ("grains", "prescribe", "READY"): PUSH,
    ("grains", "surface", "ADVANCE"): (Field.FORCE, Field.IMPULSE, Field.WORK),
    ("grains", "report", "ADVANCE"): (Field.X, Field.V),
}  # fmt: skip
for _role in ("report", "load", "prescribe"):
    NEEDED["solid", _role, "FORCE"] = (Field.FORCE,)
Finding = tuple[str, str]  # section of the page, what is wrong


@dataclass
class Judge:
    """What is known of a solver by now; `look` returns what is wrong with a reply."""

    side: str = "solid"
    sets: dict[str, tuple[str, int]] = field(default_factory=dict)  # role, entities
    counts: dict[str, int] = field(default_factory=dict)  # nodes, elements, grains ...

    def look(self, request: Message, reply: Message) -> list[Finding]:
        """Return what is wrong with a reply that should be good."""
        found = header(request, reply)
        if reply.status:
            return [*found, *refusal(reply)]
        known, needed = self.known(request)
        for name in sorted(needed - set(reply.fields)):
            found.append(("Verbs", f"the field '{name}' is missing"))
        counts = {} if request.name == "DESCRIBE" else dict(self.counts)
        for name, value in reply.fields.items():
            if name not in known:
                found.append(("Verbs", f"the field '{name}' is not known"))
                continue
            kind, shape = known[name]
            if "." in name:
                counts["set"] = self.sets[name.rpartition(".")[0]][1]
            found += [("Verbs", f"the field '{name}' {text}")
                      for text in wrong_value(value, kind, shape, counts)]  # fmt: skip
        if request.name == "DESCRIBE" and not found:
            self.counts |= {k: n for k, n in counts.items() if k in ("nodes", "elements", "grains")}
        return found

    def known(self, request: Message) -> tuple[dict[str, tuple[str, str]], set[str]]:
        """Return kind and shape of all fields that the reply may have, and those it must have."""
        verb = request.name
        table = list(REPLIES[verb])
        if verb == "DESCRIBE":
            table += REPLIES[f"DESCRIBE {request.text(Field.WHAT)}"]
        rows = [row for row in table if row[3] in ("both", self.side)]
        known = {name: (kind, shape) for name, kind, shape, _, _ in rows}
        needed = {name for name, _, _, _, required in rows if required}
        if verb == "SELECT":
            self.counts["set"] = len(np.atleast_1d(request.fields[Field.ID]))
            if request.text(Field.ROLE) == "border":
                needed = set()
        if verb in ("READY", "SOLVE", "ADVANCE", "FORCE", "KICK_DRIFT"):
            if verb == "FORCE" or verb == "KICK_DRIFT":
                needed |= set() if request.flag(Field.BRIEF) else {Field.SCALARS}
            for name, (role, _) in self.sets.items():
                for member, kind, shape, _, _ in SET_REPLIES[f"{self.side} {role}"]:
                    known[f"{name}.{member}"] = kind, shape
                members = NEEDED.get((self.side, role, verb), ())
                needed |= {f"{name}.{member}" for member in members}
        return known, needed


def header(request: Message, reply: Message) -> list[Finding]:
    """Return what is wrong with the header of a reply."""
    found = []
    for name in ("sequence", "verb"):
        seen, due = getattr(reply, name), getattr(request, name)
        if seen != due:
            found.append(("A message", f"the reply has {name} {seen}, {due} is due"))
    if reply.protocol != PROTOCOL:
        found.append(("A message", f"the reply has protocol {reply.protocol}, not {PROTOCOL}"))
    if not 0 <= reply.status <= 5 or reply.status == 3:
        found.append(("A message", f"there is no status {reply.status} of a reply"))
    return found


def refusal(reply: Message) -> list[Finding]:
    """Return what is wrong with the report of a fault."""
    found = []
    for name in FAULT:
        if not isinstance(reply.fields.get(name), bytes):
            found.append(("A message", f"a reply with status {reply.status} has no text '{name}'"))
    if more := set(reply.fields) - set(FAULT):
        found.append(("A message", f"the report of a fault has the field '{min(more)}' too"))
    code = reply.text(Field.ERROR_CODE)
    if not found and (len(code) != 4 or not code[:1].isalpha() or not code[1:].isdigit()):
        found.append(("A message", f"error.code is '{code}', not a letter and three digits"))
    if not found and not reply.text(Field.ERROR_MESSAGE):
        found.append(("A message", "error.message is empty"))
    return found


def wrong_value(value: np.ndarray | bytes, kind: str, shape: str, counts: dict) -> list[str]:
    """Return what is wrong with a value; counts that are not known yet are learnt from it."""
    if isinstance(value, bytes):
        return [] if kind == "text" else [f"holds text, {kind}s are due"]
    if KINDS[value.dtype.kind] != kind:
        return [f"holds {KINDS[value.dtype.kind]}s, {kind} is due"]
    found = []
    components, _, of = shape.strip("()").rpartition(", ")
    seen = value.shape[1] if value.ndim == 2 else 1
    choices = [int(word) for word in components.replace(" or ", " ").split() if word.isdigit()]
    if components and choices and seen not in choices or not components and seen != 1:
        found.append(f"has {seen} components, {components or 1} are due")
    plus = of.endswith(" + 1")
    due = int(of) if of.isdigit() else counts.setdefault(of.removesuffix(" + 1"), len(value) - plus)
    if len(value) != due + plus:
        found.append(f"has {len(value)} rows, {due + plus} are due ({shape})")
    if kind == "real" and not np.isfinite(value).all():
        found.append(f"holds {np.count_nonzero(~np.isfinite(value))} numbers that are not finite")
    return found


def hello(reply: Message) -> list[Finding]:
    """Return what is wrong with what a solver says of itself."""
    found = []
    words = [word for word in reply.text(Field.CAPABILITIES).split(",") if word]
    for word in words:
        if word not in CAPABILITIES:
            found.append(("Capabilities", f"there is no capability '{word}'"))
    if len(words) != len(set(words)):
        found.append(("Capabilities", "a capability stands twice"))
    limit = np.ravel(reply.fields.get(Field.STEP_LIMIT, 0.0))
    if limit.size and limit[0] > 1e100:
        found.append(("Verbs", f"step_limit is {limit[0]:g} s: 0 says that there is none"))
    kinds = ("", "static", "newmark", "hht", "explicit")
    if reply.text(Field.ANALYSIS) not in kinds:
        found.append(("Verbs", f"there is no analysis '{reply.text(Field.ANALYSIS)}'"))
    return found


def mesh(reply: Message) -> list[Finding]:
    """Return what is wrong with a mesh whose fields have their shapes."""
    fields, found = reply.fields, []
    count, start = len(fields[Field.ID]), np.ravel(fields[Field.START])
    node, kind = np.ravel(fields[Field.NODE]), np.ravel(fields[Field.KIND])
    if not np.array_equal(np.ravel(fields[Field.ID]), np.arange(1, count + 1)):
        found.append(("DESCRIBE mesh", "ids are not 1, 2, 3 ..."))
    if node.size and not 1 <= node.min() <= node.max() <= count:
        found.append(("DESCRIBE mesh", f"an element has a node that is not one of 1 to {count}"))
    if start[0] != 1 or start[-1] != len(node) + 1 or (np.diff(start) <= 0).any():
        found.append(("DESCRIBE mesh", "start does not divide node into elements"))
    names = {number: name for name, number in CELLS.items()}
    for number, corners in zip(kind, np.diff(start), strict=True):
        size = "".join(c for c in names.get(int(number), "") if c.isdigit())
        if int(size or 0) != corners:
            found.append(("DESCRIBE mesh", f"an element of kind {number} has {corners} nodes"))
            break
    return found


def same_reply(first: Message, second: Message) -> list[str]:
    """Return the fields in which two replies differ in a bit."""
    names = sorted(set(first.fields) | set(second.fields))
    bits = [[np.asarray(m.fields.get(n, b"")).tobytes() for n in names] for m in (first, second)]
    return [name for name, a, b in zip(names, *bits, strict=True) if a != b]


def of_verb(name: str) -> int:
    """Return the number of a verb, also of one that there is not."""
    return VERBS.get(name, 99)
