"""A run of grains once more, with two threads and from a checkpoint: the same bits."""

import shutil
from pathlib import Path

from talus.compare import difference, extent, same_arrays
from talus.verification import Case, field_steps

ROUNDING = 1.0e-8  # measured on 2 ranks: 2.4e-10 (form_bed)


def same_fields(first: Path, second: Path) -> bool:
    """Whether the last steps of two field files agree to the bit."""
    a, b = field_steps(first)[-1].grains, field_steps(second)[-1].grains
    return same_arrays(a, b)


def largest_way(first: Path, second: Path) -> float:
    """Return the largest distance of a grain in the last steps of two files, over their extent."""
    a, b = field_steps(first)[-1].grains["x"], field_steps(second)[-1].grains["x"]
    return difference(a, b) / extent(a)


def judge(case: Case, name: str, title: str = "") -> None:
    """Run name.nml, whose results on one thread are there, in both ways."""
    fields, one = case.folder / f"{name}.h5", case.folder / "one.h5"
    shutil.copy(fields, one)
    case.run("talus-dem", f"{name}.nml", "--threads=2")
    case.metric(f"{title}two threads: the same bits", float(same_fields(one, fields)), 1.0, 0.0)
    chosen = sorted(case.folder.glob(f"{name}.chk*.h5"), key=lambda p: p.stat().st_mtime)[0]
    shutil.copy(chosen, case.folder / "middle.chk.h5")
    case.run("talus-dem", f"{name}.nml", "--threads=1", "--restart=middle.chk.h5")
    if case.ranks:  # a new list begins the search of gaps elsewhere: rounding, which grows
        off = largest_way(one, fields)
        case.below(f"{title}restart on ranks, places that differ / extent", off, ROUNDING)
        return
    case.metric(f"{title}restart: the same bits", float(same_fields(one, fields)), 1.0, 0.0)
