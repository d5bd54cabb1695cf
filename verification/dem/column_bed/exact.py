"""A tile becomes a bed: stress by depth, lateral stress, motion, beds side by side."""

import numpy as np

from talus.cli import main
from talus.column import MOST_PART, Bed, Replays
from talus.column_measure import inner_rows, moved_places, weight_stress
from talus.column_stack import cut, like_tile, stack
from talus.column_stamp import ColumnStamp, read_column_stamp
from talus.compare import max_of
from talus.packing import read_packing
from talus.tile_stamp import read_stamp
from talus.verification import Case, field_steps, read_history

TILE = ("--count 300 --axes 1e-3 1e-3 1e-3 --spread 0.2 --seed 1 --stress 100 --young 2.9e7 "
        "--making-friction 0.1 --edge 0.02 --least-edges 6")  # fmt: skip
HEIGHT, GRAVITY = 0.1, 9.81
BEDS = {"free": 0.0, "loaded": 500.0}  # surcharge [Pa]


def run(case: Case) -> None:
    """Make a tile and two columns of it, lay them side by side, stack the tile as it is."""
    made(case, f"pack tile {TILE} -o {case.folder / 'tile.h5'}")
    found = {name: column(case, name, load) for name, load in BEDS.items()}
    for name, load in BEDS.items():
        side_by_side(case, name, load)
    bare = without_replay(case, found["free"])
    case.above("without replay the free bed moves more, times", bare / found["free"].way, 5.0)
    draw(case, found)


def made(case: Case, words: str) -> None:
    """Run the command talus; it must succeed."""
    if main(words.split()) != 0:
        raise RuntimeError(f"{case.folder}: talus {words}")


def column(case: Case, name: str, load: float) -> ColumnStamp:
    """Make a column and judge its stresses and its motion."""
    path = case.folder / f"{name}.h5"
    words = f"pack column {case.folder / 'tile.h5'} --height {HEIGHT} --surcharge {load}"
    made(case, f"{words} -o {path}")
    stamp, packing = read_column_stamp(path), read_packing(path)
    vertical = stamp.stress[:, 2, 2]
    case.below(f"{name}: vertical stress off density x depth + surcharge, mean",
               float(np.abs(vertical / exact(stamp) - 1.0).mean()), 0.02,
               "the bed is stacked of whole layers of the tile's density")  # fmt: skip
    above = weight_stress(packing, stamp.z, stamp.density * GRAVITY, load)
    case.below(f"{name}: vertical stress off the weight above + surcharge, largest",
               max_of(np.abs(vertical / above - 1.0)), 1e-3, "unrest that is left")  # fmt: skip
    off = lateral_of(stamp) / replayed_at(stamp, vertical) - 1.0
    case.below(
        f"{name}: lateral stress off that of the replays, mean below the highest slice",
        float(np.abs(off[:-1]).mean()),
        0.03,
        "nothing but unrest is to change it",
    )
    case.below(
        f"{name}: the same in the highest slice",
        abs(off[-1]),
        0.25,
        "there grains of the surface take over the load of what is cut off",
    )
    case.below(f"{name}: way of 95 of 100 inner grains in coming to rest [d]", stamp.way, 1e-2)
    return stamp


def exact(stamp: ColumnStamp) -> np.ndarray:
    """Vertical stress of the slices of an even bed [Pa]."""
    middle = 0.5 * (stamp.z[1:] + stamp.z[:-1])
    weight = stamp.density * GRAVITY * stamp.solid_fraction
    return stamp.surcharge + weight * (stamp.height - middle)


def lateral_of(stamp: ColumnStamp) -> np.ndarray:
    """Lateral stress of the slices [Pa]."""
    return stamp.stress[:, [0, 1], [0, 1]].mean(axis=1)


def replayed_at(stamp: ColumnStamp, vertical: np.ndarray) -> np.ndarray:
    """Lateral stress of the replays at other vertical stresses [Pa]."""
    own = stamp.replayed[::-1]
    return np.interp(vertical, own[:, 2], own[:, :2].mean(axis=1))


def side_by_side(case: Case, name: str, load: float) -> None:
    """Lay a column 3 x 2 times and let it go: as many contacts, and nothing happens."""
    six = case.folder / f"{name}_six.h5"
    made(case, f"pack edit {case.folder / name}.h5 --repeat 3 2 1 -o {six}")
    one, whole = read_packing(case.folder / f"{name}.h5"), read_packing(six)
    case.metric(f"{name}: contacts of six columns / of one", len(whole.pairs) / len(one.pairs),
                6.0, 0.0)  # fmt: skip
    text = (case.folder / "bed.nml").read_text().replace("NAME", name)
    load_line = f"&surcharge stress = {load} /" if load else ""
    (case.folder / f"{name}_bed.nml").write_text(text.replace("SURCHARGE\n", f"{load_line}\n"))
    case.run("talus-dem", f"{name}_bed.nml", "--threads=1")
    rows = read_history(case.folder / f"{name}_bed_energy.csv")
    case.metric(f"{name}: contacts found in six / of the column", rows["contacts"][0],
                6 * len(one.pairs), 0.0)  # fmt: skip
    lost = rows["friction"][-1] + rows["contact_damping"][-1]
    case.below(f"{name}: energy lost in 2 ms / elastic", lost / rows["elastic"][0], 1e-4)
    steps = field_steps(case.folder / f"{name}_bed.h5")
    way = np.linalg.norm(steps[-1].grains["x"] - steps[0].grains["x"], axis=1)
    size = read_stamp(case.folder / "tile.h5").mean_diameter
    case.below(f"{name}: way of its grains in 2 ms, rms [d]",
               float(np.sqrt((way**2).mean())) / size, 1e-4)  # fmt: skip


def without_replay(case: Case, stamp: ColumnStamp) -> float:
    """Stack the tile as it is and let it settle; return the way of its inner grains [d]."""
    tile, own = read_packing(case.folder / "tile.h5"), read_stamp(case.folder / "tile.h5")
    stages = Replays(case.folder / "bare", own, Bed(HEIGHT))
    stages.begin(tile)
    stacked = cut(stack([like_tile(tile, tile)] * stamp.layers), stamp.floor, HEIGHT)
    settled = stages.settle(stacked)
    way = moved_places(stacked, settled)[inner_rows(stacked, HEIGHT - stamp.floor)]
    return float(np.quantile(way, MOST_PART)) / own.mean_diameter


def draw(case: Case, found: dict[str, ColumnStamp]) -> None:
    """Stresses by height, and the ratio of stresses by vertical stress."""
    fig, (left, right) = case.figure(ncols=2, figsize=(9.4, 3.8))
    for name, stamp in found.items():
        middle = 0.5 * (stamp.z[1:] + stamp.z[:-1])
        line = left.plot(exact(stamp) / 1e3, 1e3 * middle, label=f"{name}: density x depth + load")
        color = line[0].get_color()
        left.plot(stamp.stress[:, 2, 2] / 1e3, 1e3 * middle, "o", color=color, label="vertical")
        left.plot(lateral_of(stamp) / 1e3, 1e3 * middle, "s", color=color, mfc="none",
                  label="lateral")  # fmt: skip
        vertical = np.sort(stamp.replayed[:, 2])
        right.plot(vertical / 1e3, replayed_at(stamp, vertical) / vertical, "-", color=color,
                   label=f"{name}: replays of the tile")  # fmt: skip
        right.plot(stamp.stress[:, 2, 2] / 1e3, lateral_of(stamp) / stamp.stress[:, 2, 2], "o",
                   color=color, label="settled bed")  # fmt: skip
    left.set(xlabel="stress [kPa]", ylabel="height [mm]", xlim=(0.0, None))
    left.legend(fontsize=7)
    right.set(xlabel="vertical stress [kPa]", ylabel="lateral / vertical stress [-]",
              ylim=(0.0, None))  # fmt: skip
    right.legend(fontsize=7)
    case.save(fig)
