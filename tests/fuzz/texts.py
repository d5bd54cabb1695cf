"""Damage what the Python tools read: gmsh meshes, packings in text form, packings, histories.

Usage: texts.py [--long] [--seed N] [--count N] [--only KIND ...] [--keep DIR]
Every damaged file is read (values may change) or refused with a code and exit code 1 or 4;
exceptions, signals and hangs are failures. Each call runs in a child of this process.
"""

import io
import os
import random
import shutil
import signal
import sys
import tempfile
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import files
import inputs
import numpy as np
from fuzzing import CODE, FAST, ROOT, Tally, options

sys.path.insert(0, str(ROOT / "prepost"))

from talus import cli  # noqa: E402
from talus import mesh as meshes  # noqa: E402

LIMIT = 30  # [s] of a call
CALLS = {
    "gmsh mesh": ("cube.msh", ["mesh", "convert", "cube.msh", "-o", "out.h5"]),
    "gmsh binary mesh": ("binary.msh", ["mesh", "convert", "binary.msh", "-o", "out.h5"]),
    "packing as text": ("bed.txt", ["pack", "text2h5", "bed.txt", "-o", "out.h5"]),
    "packing": ("packing.h5", ["pack", "h52text", "packing.h5", "-o", "out.txt"]),
    "measured packing": ("packing.h5", ["measure", "packing.h5"]),
    "fields": ("deck.h5", ["measure", "deck.h5"]),
    "fields to VTU": ("deck.h5", ["convert", "deck.h5", "-o", "vtu"]),
    "history": ("deck_energy.csv", ["plot", "energy", "deck_energy.csv", "-o", "out.png"]),
}
SHORT, LONG = 3, 150


def write_inputs(scratch: Path, binaries: Path) -> Path:
    """Make a run of grains with its results, a packing as text and meshes of gmsh."""
    import meshio

    run = inputs.make("bed_restart", scratch, binaries)
    folder = run.folder
    cli.main(["pack", "h52text", str(folder / "packing.h5"), "-o", str(folder / "bed.txt")])
    mesh = meshes.box(np.zeros(3), np.ones(3), (2, 1, 1))
    cells = [("hexahedron", mesh.hex8), ("quad", np.asarray(mesh.facets["z1"]))]
    tags = [np.full(len(rows), k + 1) for k, (_, rows) in enumerate(cells)]
    made = meshio.Mesh(
        mesh.x,
        cells,
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={"solid": np.array([1, 3]), "face": np.array([2, 2])},
    )
    meshio.write(folder / "cube.msh", made, file_format="gmsh22", binary=False)
    meshio.write(folder / "binary.msh", made, file_format="gmsh22", binary=True)
    return folder


def child(arguments: list[str], folder: Path) -> None:
    """Make the call in this process and end it; the exit code 99 is an exception."""
    signal.alarm(LIMIT)
    os.chdir(folder)
    said = io.StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said):
            code = cli.main(arguments)
    except BaseException as fault:
        (folder / "said").write_text(f"{type(fault).__name__}: {fault}")
        os._exit(99)
    (folder / "said").write_text(said.getvalue())
    os._exit(code)


def call(arguments: list[str], folder: Path) -> str:
    """Return the verdict on a call in a folder."""
    sys.stdout.flush()
    pid = os.fork()
    if pid == 0:
        child(arguments, folder)
    _, status = os.waitpid(pid, 0)
    said = (folder / "said").read_text() if (folder / "said").exists() else ""
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        return "hang: longer than allowed" if number == signal.SIGALRM else f"crash: {number}"
    code = os.waitstatus_to_exitcode(status)
    if code == 99:
        return f"exception: {said[:150]}"
    if code == 0:
        return "changed"
    return "refused" if code in (1, 4) and CODE.search(said) else f"unclear: {code}, {said[:150]}"


def damage(path: Path, dice: random.Random) -> None:
    """Turn bits, cut, change words of a text, or edit an HDF5 file."""
    if path.suffix == ".h5":
        dice.choice([files.flip, files.cut, files.edit, files.bare])(path, dice)
        return
    what = dice.choice(["flip", "cut", "word", "word"])
    if what != "word":
        getattr(files, what)(path, dice)
        return
    words = path.read_bytes().split(b" ")
    others = [b"nan", b"1e400", b"-1", b"", b"99999999999999999999", b"x", b"\xff\xfe", b"0", b"\n"]
    words[dice.randrange(len(words))] = dice.choice(others)
    path.write_bytes(b" ".join(words))


def main() -> int:
    """Run the campaign."""
    found = options(__doc__)
    tally = Tally()
    with tempfile.TemporaryDirectory(prefix="talus_fuzz_", dir=FAST) as scratch:
        folder = write_inputs(Path(scratch), found.bin)
        place = Path(scratch) / "trial"
        for kind, (name, arguments) in CALLS.items():
            if found.only and not any(word in kind for word in found.only):
                continue
            for number in range(found.count or (LONG if found.long else SHORT)):
                shutil.rmtree(place, ignore_errors=True)
                shutil.copytree(folder, place)
                damage(place / name, random.Random(f"{found.seed} {kind} {number}"))
                what = call(arguments, place)
                tally.add(what, f"{kind}, {number}, seed {found.seed}")
                if found.keep and what not in ("changed", "refused"):
                    shutil.copytree(place, found.keep / f"{kind}_{number}")
    return tally.close()


if __name__ == "__main__":
    sys.exit(main())
