"""The traffic light of a run: green, amber or red, why in a sentence, and what to do."""

import html
from pathlib import Path
from typing import NamedTuple

import numpy as np

from talus import histories
from talus.faults import FaultError

GREEN, AMBER, RED = "green", "amber", "red"
ORDER = (GREEN, AMBER, RED)
ENDS = {0: "finished", 1: "fault of the input", 2: "numerical fault", 3: "stopped early",
        4: "fault of the system", 5: "bug"}  # fmt: skip
# words of a note of health (talus_health.f90), and what helps
CURES = (
    ("energy error", "Take a smaller dt or dt_factor; see in the ledger which term runs away."),
    ("largest overlap", "Take stiffer grains, or a slower start: they are pressed too deep."),
    ("late rebuilds", "Take a smaller dt: grains moved past the reach of the contact list."),
    (
        "stability limit",
        "Take a smaller dt, or leave it out: dt_factor = 0.3 of the stability limit, "
        "found anew during the run, is the default.",
    ),
    ("works of both sides", "Take a shorter &clock exchange, or scheme = 'iterated'."),
    ("displacement gradient", "Check loads, young and units, or take a law of finite strain."),
)
# of the energy error of a partner of talus-couple: its dt is the same as alone
PARTNER = (
    "First take a shorter &clock exchange, or scheme = 'iterated': in a coupled run the energy of "
    "a partner goes wrong mostly at the interface; then a smaller dt."
)
TRUST = "N001"  # a figure is red, all results are written
OVERLAP = "largest overlap"
APART = (
    "Bodies overlap where the run begins: move them apart (a surface or a block above the highest "
    "point of the bed, see talus measure)."
)
PRESSED = 0.9  # of the largest overlap: the time at which it was reached


class Light(NamedTuple):
    """Colour, sentences why, sentences what to do."""

    colour: str
    why: list[str]
    cure: list[str]


def pressed_when(path: Path) -> tuple[str, str] | None:
    """Return when overlaps of a *_energy.csv grew deep, and what helps then; None: unknown."""
    try:
        rows = histories.read(path)
        time, overlap = rows["time"], rows["max_overlap"]
    except FaultError:
        return None
    if not time.size or not overlap[-1] > 0.0:
        return None
    k = int(np.argmax(overlap >= PRESSED * overlap[-1]))
    if k < 2:
        return "from the start", APART
    return f"by {time[k]:.4g} s", ""


def light_of(facts: dict, partner: bool = False, deep: tuple[str, str] | None = None) -> Light:
    """Return the light of a summary: its verdict of health, its faults and its end together.

    `partner`: talus-couple drove it; `deep`: see pressed_when.
    """
    health = facts.get("health")
    health = health if isinstance(health, dict) else {}
    verdict = health.get("verdict")
    colour = verdict if verdict in ORDER else (AMBER if "verdict" in health else GREEN)
    notes = [note.strip() for note in str(health.get("notes") or "").split(";") if note.strip()]
    if deep:
        notes = [f"{note}, reached {deep[0]}" if OVERLAP in note else note for note in notes]
    why = [sentence(note) for note in notes]
    cure = [text for words, text in cures_of(partner, deep) if any(words in n for n in notes)]
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
        late = any(fault.get("code") == TRUST for fault in facts.get("errors", []))
        state = "It came to its end, but its results are not to be trusted" if late else (
            f"It did not finish: {end}")  # fmt: skip
        why.insert(0, f"{state} (exit code {code}).")
        cure += ["Go on from its checkpoint with --restart=auto."] if early else []
    return Light(colour, why, list(dict.fromkeys(cure)))


def cures_of(partner: bool, deep: tuple[str, str] | None) -> list[tuple[str, str]]:
    """Return the cures by words of a note, those that this run knows better in their place."""
    better = {"energy error": PARTNER} if partner else {}
    if deep and deep[1]:
        better[OVERLAP] = deep[1]
    return [(words, better.get(words, text)) for words, text in CURES]


def sentence(note: str) -> str:
    """Return a note of health without its first words, as a sentence."""
    text = note.partition(": ")[2] if note.startswith("health ") else note
    return f"{text[:1].upper()}{text[1:]}."


def panel(name: str, program: str, light: Light, links: str = "") -> str:
    """Return the light of one run as HTML; `links` lead to the lines of its log."""
    why = " ".join(html.escape(text) for text in light.why)
    cure = " ".join(html.escape(text) for text in light.cure)
    do = f'<div class="do">What to do: {cure}</div>' if cure else ""
    return (
        f'<div class="light {light.colour}"><span class="lamp"></span><div><b>{html.escape(name)}'
        f"</b> ({html.escape(program)}): <b>{light.colour}</b>. {why}{do}{links}</div></div>"
    )


def worst(lights: list[Light]) -> str:
    """Return the worst colour of several lights."""
    return max((light.colour for light in lights), key=ORDER.index, default=GREEN)
