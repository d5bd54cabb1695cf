"""Images of all steps of a run, with one scale of colours: numbered PNGs, or an animated GIF."""

import tempfile
from pathlib import Path

import numpy as np

from talus.fields import FieldFile
from talus.files import make_folder, replaced
from talus.pictures import (
    DRIVEN,
    ENDINGS,
    FIXED,
    GHOST,
    MILLI,
    Look,
    check_name,
    fold,
    render,
    top_of,
    values_of,
)

PAUSE = 200  # of a GIF between images [ms]


def common(grains: Path, steps: range, look: Look) -> Look:
    """Return the look with the top of the colours and the bounds of some steps together."""
    tops, low, high = [1.0e-12], np.full(3, np.inf), np.full(3, -np.inf)
    with FieldFile(grains) as fields:
        for step, entry in enumerate(fields.entries()):
            now = fields.read(step) if step in steps else entry
            if step not in steps or not len(now.grains.get("id", ())):
                continue
            if now.cell is not None:
                fold(entry, now)
            reach = now.grains["axes"].max()
            low = np.minimum(low, now.grains["x"].min(axis=0) - reach)
            high = np.maximum(high, now.grains["x"].max(axis=0) + reach)
            free = ~np.isin(now.grains["kind"], (FIXED, DRIVEN, GHOST))
            if free.any() and look.color != "role":
                tops.append(top_of(values_of(entry, now, look.color)[free]))
    bounds = tuple(MILLI * np.column_stack([low, high]).ravel()) if low[0] < high[0] else None
    return look._replace(top=max(tops), bounds=bounds)


def write(grains: Path, solid: Path | None, every: int, output: Path, look: Look) -> list[Path]:
    """Write every so many steps as PNG with the step's number, or one GIF; return the files."""
    check_name(output, (*ENDINGS, ".gif"))
    with FieldFile(grains) as fields:
        steps = range(0, len(fields), every)
    look = common(grains, steps, look)
    if solid:
        look = look._replace(bounds=None)  # the block is larger, and stays where it is
    if output.suffix == ".gif":
        with tempfile.TemporaryDirectory() as folder:
            frames = [Path(folder) / f"{step:06d}.png" for step in steps]
            for step, path in zip(steps, frames, strict=True):
                render(grains, solid, step, path, look)
            join(frames, output)
        return [output]
    written = []
    for step in steps:
        written.append(output.with_stem(f"{output.stem}_{step:06d}"))
        render(grains, solid, step, written[-1], look)
    return written


def join(frames: list[Path], output: Path) -> None:
    """Join images into an animated GIF that begins again."""
    from PIL import Image

    method = Image.Quantize.FASTOCTREE  # keeps colours of few pixels, as those of a legend
    pictures = [Image.open(path).convert("RGB").quantize(256, method) for path in frames]
    make_folder(output.parent)
    options = {"save_all": True, "append_images": pictures[1:], "duration": PAUSE, "loop": 0}
    with replaced(output) as temporary:
        pictures[0].save(temporary, **options)
