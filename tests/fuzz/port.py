"""Damage to the ports of live coupled runs: it is noticed and named, or does no harm.

Usage: port.py [--long] [--seed N] [--bin FOLDER] [--keep]
Flips, zeros and random values in the control words and messages of the shared memory; flips, cuts
and removals of files of the hdf5 transport, and of its whole folder. Each run must end within the
limit: either as a run that nobody disturbed, with its bits, or with exit code 4 and a fault of the
port. The restart then ends as the undisturbed run, and nothing stays behind.
"""

import mmap
import os
import random
import re
import shutil
import signal
import sys
import time
from argparse import Namespace
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import runs

LIMIT = 20.0  # s for a run to end after the damage
T_END = {"shared_memory": 0.02, "hdf5": 0.003}  # s; about a second of wall time
CONTROL = 1344  # bytes of the control block that are in use
WORDS = {
    "requests written": 960, "requests taken": 1024, "replies written": 1152,
    "replies taken": 1216, "chunk of a request": 1088, "chunk of a reply": 1280,
    "couple joined": 256, "solver joined": 640, "couple state": 208, "solver state": 592,
    "magic": 0, "slot": 8, "beat of the solver": 576,
}  # fmt: skip
SLOT = 4096  # first byte of the requests; those of the replies begin SLOT_BYTES later
SLOT_BYTES = 2**22


def segment_of(run: runs.Run, side: str) -> mmap.mmap | None:
    """Map the segment of a side, which has no name any more, through talus-couple's descriptors."""
    with suppress(OSError):
        for fd in Path(f"/proc/{run.pid}/fd").iterdir():
            if f"-{side}" in os.readlink(fd) and "/dev/shm/talus-" in os.readlink(fd):
                with fd.open("r+b") as file:
                    return mmap.mmap(file.fileno(), 0)
    return None


def spoil(memory: mmap.mmap, at: int, how: str, rng: random.Random) -> None:
    """Change the word (8 bytes) at an offset."""
    word = int.from_bytes(memory[at : at + 8], "little")
    if how == "zero":
        word = 0
    elif how == "random":
        word = rng.getrandbits(64)
    elif how == "step":
        word = word & ~0xFFFFFFFF | (word + 1) & 0xFFFFFFFF
    else:
        for bit in rng.sample(range(64), 1 if how == "flip" else 2):
            word ^= 1 << bit
    memory[at : at + 8] = word.to_bytes(8, "little")


def control_word(run: runs.Run, rng: random.Random) -> str:
    """Damage a word of the control block, mostly one of those that steer the exchange."""
    side = rng.choice(["grains", "solid"])
    name, at = rng.choice(sorted(WORDS.items()))
    if rng.random() < 0.3:
        at = 8 * rng.randrange(CONTROL // 8)
        name = f"word at {at}"
    how = rng.choice(["flip", "flip", "two flips", "zero", "random", "step"])
    memory = segment_of(run, side)
    if memory is not None:
        spoil(memory, at, how, rng)
    return f"{how} in '{name}' of {side}"


def message(run: runs.Run, rng: random.Random) -> str:
    """Flip bits of the messages under way, again and again for a while."""
    side = rng.choice(["grains", "solid"])
    memory = segment_of(run, side)
    slot = SLOT + rng.choice([0, SLOT_BYTES])
    end = time.monotonic() + 0.3
    while memory is not None and time.monotonic() < end and run.process.poll() is None:
        spoil(memory, slot + 8 * rng.randrange(100), rng.choice(["flip", "two flips"]), rng)
        time.sleep(0.0005)
    return f"flips in messages of {side}"


def folder_of(run: runs.Run) -> Path:
    """Return the folder of the hdf5 transport."""
    return next(iter(run.folder.glob("talus-*.port")), run.folder / "talus-none.port")


def catch(run: runs.Run, endings: tuple[str, ...]) -> Path | None:
    """Return a file of the port's folder as soon as there is one that ends like this."""
    folder, end = folder_of(run), time.monotonic() + 5.0
    while run.process.poll() is None and time.monotonic() < end:
        with suppress(OSError):
            for entry in os.scandir(folder):
                if entry.name.endswith(endings):
                    return Path(entry.path)
    return None


def file_of_port(run: runs.Run, rng: random.Random) -> str:
    """Damage, cut, remove or replace a file of the port."""
    endings = (".request.h5", ".reply.h5")
    if rng.random() < 0.3:
        endings = rng.choice([(".beat",), (".joined",), (".run",)])
    deed = rng.choice(["flip", "flip", "cut", "remove", "empty", "folder", "pipe"])
    path = catch(run, endings)
    if path is not None:
        with suppress(OSError):
            damage_file(path, deed, rng)
    return f"{deed} {path.name if path else 'nothing'}"


def damage_file(path: Path, deed: str, rng: random.Random) -> None:
    """Do the deed."""
    if deed in ("remove", "folder", "pipe"):
        path.unlink()
    if deed == "folder":
        path.mkdir()
    if deed == "pipe":
        os.mkfifo(path)
    if deed in ("flip", "cut", "empty"):
        with path.open("r+b") as file:
            size = file.seek(0, 2)
            if deed != "flip":
                file.truncate(rng.randrange(size) if deed == "cut" else 0)
            else:
                at = rng.randrange(size)
                file.seek(at)
                byte = file.read(1)[0] ^ 1 << rng.randrange(8)
                file.seek(at)
                file.write(bytes([byte]))


def whole_folder(run: runs.Run, rng: random.Random) -> str:
    """Remove the port's folder, or everything in it."""
    folder = folder_of(run)
    deed = rng.choice(["remove", "empty"])
    for path in folder.glob("*"):
        with suppress(OSError):
            path.unlink()
    if deed == "remove":
        for _ in range(20):
            shutil.rmtree(folder, ignore_errors=True)
            if not folder.exists():
                break
    if rng.random() < 0.3:
        runs.kill(run.pid, signal.SIGTERM)
        deed += " and SIGTERM"
    return f"{deed} the folder"


Damage = Callable[[runs.Run, random.Random], str]
ATTACKS: list[tuple[str, Damage]] = [
    ("shared_memory", control_word), ("shared_memory", control_word), ("shared_memory", message),
    ("hdf5", file_of_port), ("hdf5", whole_folder), ("hdf5", file_of_port),
]  # fmt: skip


def one(given: Namespace, tally: runs.Tally, k: int, good: dict) -> None:
    """One run that is damaged, and its restart."""
    transport, attack = ATTACKS[k % len(ATTACKS)]
    rng = random.Random(f"{given.seed} {k}")
    folder = given.scratch / f"{k:03d}"
    runs.model(folder, T_END[transport], transport)
    run = runs.Run(given.bin, folder)
    run.find_solvers()
    run.wait_for_rows(rng.choice([0, 500, 2000]))
    name = f"{k} {transport}: {attack(run, rng)}"
    code, text = run.end(LIMIT)
    tally.check(f"{name}: ends within {LIMIT} s", code is not None, text)
    wanted, bits = good[transport]
    if code == wanted:
        different = runs.differences(runs.result(folder), bits)
        tally.check(f"{name}: harmless, so the same bits, not {different[:5]}", not different)
    else:
        faults = re.findall(r"^error ([A-Z]\d{3})", text, re.MULTILINE)
        named = bool(faults) and all(fault[0] == "P" for fault in faults)
        early = code == 3 and "SIGTERM" in name
        tally.check(f"{name}: noticed, exit {code}, {faults}", early or code == 4 and named, text)
    left = run.strays()
    tally.check(f"{name}: no solver stays: {left}", not left)
    code, text = runs.Run(given.bin, folder, "--restart=auto").end(120.0)
    tally.check(f"{name}: restart ends as a whole run, code {code}", code == wanted, text)
    different = runs.differences(runs.result(folder), bits)
    tally.check(f"{name}: restart gives the same bits, not {different[:5]}", not different)
    left = runs.remains(folder)
    tally.check(f"{name}: nothing stays after the restart: {left}", not left)


def main() -> int:
    """Run the attacks."""
    given = runs.arguments(__doc__)
    tally = runs.Tally()
    good = {}
    for transport, t_end in T_END.items():
        folder = given.scratch / f"whole-{transport}"
        runs.model(folder, t_end, transport)
        code, text = runs.Run(given.bin, folder).end(120.0)
        tally.check(f"whole run over {transport} ends, code {code}", code in (0, 2), text)
        good[transport] = code, runs.result(folder)
    only = os.environ.get("TALUS_FUZZ_ONLY")
    for k in range(180 if given.long else 5):
        if not only or int(only) == k:
            one(given, tally, k, good)
    return runs.leave(given, tally)


if __name__ == "__main__":
    sys.exit(main())
