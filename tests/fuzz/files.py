"""Damage files that the programs read: checkpoints, packings, meshes, surfaces.

Usage: files.py [--bin build/bin] [--long] [--seed N] [--count N] [--only KIND ...] [--keep DIR]
Damage by fixed seeds: bits turned and ends cut off (the program refuses the file or ends as
without), the same where the checksum was taken away, and single datasets and attributes changed
through h5py with the checksum written anew or taken away (values may change then; nothing may
crash, hang or become NaN).
"""

import random
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import h5py
import inputs
import numpy as np
from fuzzing import FAST, ROOT, Run, Tally, baseline, options, trial

sys.path.insert(0, str(ROOT / "prepost"))

from talus.checksum import ROOM, has_checksum, write_checksum  # noqa: E402

# kind: run, the file that is damaged, weight in the campaign
TARGETS = {
    "dem checkpoint": ("bed_restart", "deck.chk.h5", 3),
    "dem checkpoint of a cell": ("cell_restart", "deck.chk.h5", 2),
    "checkpoint of sources": ("feed_restart", "deck.chk.h5", 2),
    "checkpoint of tools": ("tools_restart", "deck.chk.h5", 2),
    "checkpoint of stages": ("stages_restart", "deck.chk.h5", 2),
    "fem checkpoint": ("elastic_restart", "deck.chk.h5", 2),
    "plastic checkpoint": ("plastic_restart", "deck.chk.h5", 2),
    "packing": ("bed", "packing.h5", 2),
    "mesh": ("elastic", "block.h5", 2),
    "surface": ("bed", "tool.stl", 2),
    "coupled checkpoint": ("coupled_restart", "deck.x4.chk.h5", 1),
    "overlap checkpoint": ("overlap_restart", "deck.x8.chk.h5", 1),
    "opened checkpoint": ("opened_restart", "deck.x60.chk.h5", 1),
    "checkpoint of a bed": ("opened_restart", "grains.x60.chk.h5", 1),
    "dem fields": ("bed_restart", "deck.h5", 1),
    "fem fields": ("plastic_restart", "deck.h5", 1),
    "history": ("bed_restart", "deck_energy.csv", 1),
    "manifest": ("coupled_restart", "deck.manifest", 1),
}
TEXT = (".stl", ".csv", ".manifest")  # nothing tells a changed digit in a text
SHORT, LONG = 2, 80  # damaged inputs of each kind and sort of damage, times the weight
REALS = [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-310, 0.0, -1.0, 1e18]
WHOLES = [-(2**31), 2**31 - 1, 2**31, -(2**63), 2**62, -1, 0, 1, 7, 10**6]


def flip(path: Path, dice: random.Random) -> None:
    """Turn one to four bits anywhere."""
    data = bytearray(path.read_bytes())
    for _ in range(dice.choice([1, 1, 1, 2, 4])):
        data[dice.randrange(len(data))] ^= 1 << dice.randrange(8)
    path.write_bytes(data)


def cut(path: Path, dice: random.Random) -> None:
    """Cut the end off, put bytes behind it, or zeros in place of a block."""
    data = path.read_bytes()
    place = dice.randrange(len(data))
    what = dice.randrange(3)
    if what == 0:
        path.write_bytes(data[:place])
    elif what == 1:
        path.write_bytes(data + dice.randbytes(dice.choice([1, 100, 5000])))
    else:
        path.write_bytes(data[:place] + bytes(min(4096, len(data) - place)) + data[place + 4096 :])


def things(file: h5py.File) -> tuple[list[str], list[tuple[str, str]]]:
    """Names of all datasets, (object, name) of all attributes."""
    datasets: list[str] = []
    attributes = [("/", name) for name in file.attrs]

    def visit(name: str, item: object) -> None:
        attributes.extend((name, key) for key in item.attrs)
        if isinstance(item, h5py.Dataset):
            datasets.append(name)

    file.visititems(visit)
    return datasets, attributes


def change_values(file: h5py.File, name: str, dice: random.Random) -> None:
    """Set one value, or all, to one that is out of all bounds or just wrong."""
    values = np.array(file[name])
    if values.dtype.kind not in "iuf" or not values.size:
        return
    choice = REALS if values.dtype.kind == "f" else WHOLES
    limits = None if values.dtype.kind == "f" else np.iinfo(values.dtype)
    value = dice.choice([v for v in choice if limits is None or limits.min <= v <= limits.max])
    if dice.random() < 0.2:
        values[...] = value
    else:
        values.reshape(-1)[dice.randrange(values.size)] = value
    file[name][...] = values


def change_shape(file: h5py.File, name: str, dice: random.Random) -> None:
    """Replace a dataset by one of another shape: rows fewer or more, transposed, flat, empty."""
    values = np.array(file[name])
    if not values.ndim:
        values = values.reshape(1)
    shapes: list[Callable[[], np.ndarray]] = [
        lambda: values[:-1],
        lambda: np.concatenate([values, values[-1:]]),
        lambda: values.T.copy(),
        lambda: values.reshape(-1),
        lambda: values[:0],
        lambda: values[..., :-1] if values.ndim > 1 else values.reshape(-1, 1),
        lambda: values.reshape(1, *values.shape),
        lambda: np.concatenate([values] * 3),
        lambda: values.reshape(-1)[:1].reshape(()) if values.size else values,
    ]
    other = dice.choice(shapes)()
    del file[name]
    file[name] = other


def change_type(file: h5py.File, name: str, dice: random.Random) -> None:
    """Replace a dataset by one of other numbers, of text, of records, or by a group."""
    values = np.array(file[name])
    del file[name]
    what = dice.randrange(7)
    if what == 0:
        file[name] = values.astype(np.float32 if values.dtype.kind in "iuf" else object)
    elif what == 1 and values.dtype.kind in "iuf":
        file[name] = np.clip(np.nan_to_num(values), -100, 100).astype(np.int8)
    elif what == 2:
        file[name] = values.astype("S8") if values.dtype.kind in "iuf" else 1.0
    elif what == 3:
        file[name] = np.zeros(values.shape, [("a", "i4"), ("b", "f8")])
    elif what == 4:
        file.create_group(name)
    elif what == 5:
        file[name] = h5py.Empty("f8")
    else:
        file.create_dataset(name, shape=values.shape or (1,), dtype=h5py.string_dtype())


def change_attribute(file: h5py.File, owner: str, name: str, dice: random.Random) -> None:
    """Remove an attribute or give it another value, kind or shape."""
    attrs = file[owner].attrs
    del attrs[name]
    what = dice.randrange(9)
    if what == 0:
        attrs[name] = np.array(["talus"] * 1000, dtype=h5py.string_dtype())
    elif what == 1:
        attrs[name] = np.array([b"talus"] * 1000)
    elif what == 2:
        attrs[name] = dice.choice(WHOLES[:3])
    elif what == 3:
        attrs[name] = dice.choice(REALS)
    elif what == 4:
        attrs[name] = np.arange(300)
    elif what == 5:
        attrs[name] = h5py.Empty(dice.choice(["S5", "f8"]))
    elif what == 6:
        attrs[name] = "x" * dice.choice([0, 1, 60000])
    elif what == 7:
        attrs[name] = np.zeros(2, [("a", "i4"), ("b", "f8")])


def bare(path: Path, dice: random.Random) -> None:
    """Take the checksum away, as in files of other programs, then turn bits or cut."""
    path.write_bytes(bytes(ROOM) + path.read_bytes()[ROOM:])
    dice.choice([flip, flip, flip, cut])(path, dice)


def fnv(data: bytes) -> str:
    """Return the 64-bit FNV-1a hash of the manifest."""
    hashed = 14695981039346656037
    for byte in data:
        hashed = (hashed ^ byte) * 1099511628211 % 2**64
    return f"{hashed:016X}"


def adopt(path: Path) -> None:
    """Let the manifest of a coupled run take a changed checkpoint for its own."""
    for manifest in path.parent.glob("*.manifest"):
        lines = manifest.read_text().splitlines()
        for k, line in enumerate(lines):
            if line.endswith(path.name):
                who, _, name = line.split()
                lines[k] = f"{who} {fnv(path.read_bytes())} {name}"
        manifest.write_text("".join(f"{line}\n" for line in lines))


def edit(path: Path, dice: random.Random) -> None:
    """Change one dataset or attribute; checkpoints keep a checksum, others lose it at times."""
    checked = has_checksum(path)
    with h5py.File(path, "r+") as file:
        datasets, attributes = things(file)
        what = dice.random()
        if what < 0.2 and attributes:
            change_attribute(file, *dice.choice(attributes), dice)
        elif what < 0.3:
            del file[dice.choice(datasets)]
        else:
            how = change_values if what < 0.65 else change_shape if what < 0.85 else change_type
            how(file, dice.choice(datasets), dice)
    if checked and (".chk" in path.name or dice.random() < 0.5):
        write_checksum(path)
    elif checked:
        data = path.read_bytes()
        path.write_bytes(bytes(ROOM) + data[ROOM:])
    adopt(path)


SORTS = {"flip": flip, "cut": cut, "edit": edit, "bare": bare}


def campaign(kind: str, run: Run, path: str, count: int, tally: Tally, found: object) -> None:
    """Try `count` damaged inputs of each sort of damage."""
    text = path.endswith(TEXT)
    for sort, damage in SORTS.items():
        if sort in ("edit", "bare") and (text or (sort == "bare" and "fields" in kind)):
            continue
        for number in range(count):
            dice = random.Random(f"{found.seed} {kind} {sort} {number}")
            what = trial(
                run,
                lambda folder, damage=damage, dice=dice: damage(folder / path, dice),
                text or sort in ("edit", "bare") or "fields" in kind,
                found.keep,
            )
            tally.add(what, f"{kind}, {sort} {number}, seed {found.seed}")


def main() -> int:
    """Run the campaign."""
    found = options(__doc__)
    tally = Tally()
    with tempfile.TemporaryDirectory(prefix="talus_fuzz_", dir=FAST) as scratch:
        runs: dict[str, Run] = {}
        for kind, (name, path, weight) in TARGETS.items():
            if found.only and not any(word in kind for word in found.only):
                continue
            if name not in runs:
                runs[name] = baseline(inputs.make(name, Path(scratch), found.bin))
            count = found.count or weight * (LONG if found.long else SHORT)
            campaign(kind, runs[name], path, count, tally, found)
    return tally.close()


if __name__ == "__main__":
    sys.exit(main())
