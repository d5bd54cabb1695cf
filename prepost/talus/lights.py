"""The traffic light of a run: green, amber or red, why in a sentence, and what to do."""

import html
from typing import NamedTuple

GREEN, AMBER, RED = "green", "amber", "red"
ORDER = (GREEN, AMBER, RED)
ENDS = {0: "finished", 1: "fault of the input", 2: "numerical fault", 3: "stopped early",
        4: "fault of the system", 5: "bug"}  # fmt: skip
# words of a note of health (talus_health.f90), and what helps
CURES = (
    ("energy error", "Take a smaller dt or dt_factor; see in the ledger which term runs away."),
    ("largest overlap", "Take stiffer grains, or a slower start: they are pressed too deep."),
    ("late rebuilds", "Take a smaller dt: grains moved past the reach of the contact list."),
    ("stability limit", "Take a smaller dt: it was above the stability limit."),
    ("works of both sides", "Take a shorter &clock exchange, or scheme = 'iterated'."),
    ("displacement gradient", "Check loads, young and units, or take a law of finite strain."),
)


class Light(NamedTuple):
    """Colour, sentences why, sentences what to do."""

    colour: str
    why: list[str]
    cure: list[str]


def light_of(facts: dict) -> Light:
    """Return the light of a summary: its verdict of health, its faults and its end together."""
    health = facts.get("health")
    health = health if isinstance(health, dict) else {}
    verdict = health.get("verdict")
    colour = verdict if verdict in ORDER else (AMBER if "verdict" in health else GREEN)
    notes = [note.strip() for note in str(health.get("notes") or "").split(";") if note.strip()]
    why = [sentence(note) for note in notes]
    cure = [text for words, text in CURES if any(words in note for note in notes)]
    for fault in facts.get("errors", []):
        why.append(f"{fault.get('code')}: {fault.get('message')} ({fault.get('place')})")
        cure += [str(fault["hint"])] if fault.get("hint") else []
        cure.append(f"talus explain {fault.get('code')}")
    code = facts.get("exit_code")
    if code == 0 and not why:
        why = ["It finished, and every figure of its health is within its limits."]
        why = why if verdict == GREEN else ["It finished; it judges no figures of health."]
    if code != 0:
        end = ENDS.get(code, "unknown end") if isinstance(code, int) else "unknown end"
        early = code == 3
        colour = AMBER if early and colour != RED else RED
        why.insert(0, f"It did not finish: {end} (exit code {code}).")
        cure += ["Go on from its checkpoint with --restart=auto."] if early else []
    return Light(colour, why, list(dict.fromkeys(cure)))


def sentence(note: str) -> str:
    """Return a note of health without its first words, as a sentence."""
    text = note.partition(": ")[2] if note.startswith("health ") else note
    return f"{text[:1].upper()}{text[1:]}."


def panel(name: str, program: str, light: Light) -> str:
    """Return the light of one run as HTML."""
    why = " ".join(html.escape(text) for text in light.why)
    cure = " ".join(html.escape(text) for text in light.cure)
    do = f'<div class="do">What to do: {cure}</div>' if cure else ""
    return (
        f'<div class="light {light.colour}"><span class="lamp"></span><div><b>{html.escape(name)}'
        f"</b> ({html.escape(program)}): <b>{light.colour}</b>. {why}{do}</div></div>"
    )


def worst(lights: list[Light]) -> str:
    """Return the worst colour of several lights."""
    return max((light.colour for light in lights), key=ORDER.index, default=GREEN)
