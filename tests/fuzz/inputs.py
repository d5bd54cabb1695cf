"""Small runs whose files the fuzzers damage: each takes a fraction of a second."""

import sys
from pathlib import Path

import numpy as np
from fuzzing import Run, call

from talus import mesh as meshes
from talus.verification import write_packing

sys.path.insert(0, str(Path(__file__).parents[1] / "python"))
import opened_column  # noqa: E402

R = 1.0e-3
QUARTZ = "&material id = 'quartz', density = 2650.0, young = 1.0e8, poisson = 0.25 /\n"
GRAINS = f"""{QUARTZ}
&run title = 'Bed', t_end = END, gravity = 0.0, 0.0, -9.81 /
&contact between = 'quartz', 'quartz', friction = 0.5, damping_ratio = 0.1, CONTACT /
&particles file = 'packing.h5', material = 'quartz' /
&dynamics dt = 2.0e-6 /
&output every_time = 2.0e-4 /
&history every_time = 2.0e-5 /
"""
BED = (
    GRAINS.replace("CONTACT", "law = 'hertz_mindlin', rolling_friction = 0.1")
    + """
&wall id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'quartz' /
&surface id = 'tool', file = 'tool.stl', material = 'quartz', velocity = 0.1, 0.0, 0.0 /
&driven group = 'pusher', velocity = 0.0, 0.0, -0.1 /
&bond young = 1.0e7, tensile_strength = 1.0e5, shear_strength = 1.0e5 /
"""
)
LINEAR = "law = 'linear', normal_stiffness = 1.0e4, tangential_stiffness = 5.0e3"
CELL = (
    GRAINS.replace(", gravity = 0.0, 0.0, -9.81", "").replace("CONTACT", LINEAR)
    + """
&cell size = 5.97e-3, 5.97e-3, 5.97e-3 /
&cell_rate component = 'zz', rate = -10.0 /
"""
)
TOOLS = (
    GRAINS.replace("CONTACT", "law = 'hertz_mindlin'")
    + """
&wall id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'quartz' /
&wall id = 'east', point = 5.96e-3, 0.0, 0.0, normal = -1.0, 0.0, 0.0, material = 'quartz' /
&servo wall = 'east', stress = 1.0e3, area = 3.6e-5, tolerance = 1.0e3 /
&surcharge stress = 5.0e2, lower = 0.0, 0.0, upper = 6.0e-3, 6.0e-3 /
&surface id = 'tool', file = 'tool.stl', material = 'quartz' /
&body surface = 'tool', free = 'x', mass = 1.0e-4, force = 0.01, 0.0, 0.0 /
&membrane id = 'skin', file = 'skin.stl', material = 'quartz', young = 1.0e6, thickness = 1.0e-4,
          density = 2.0e4, pressure = 1.0e2, inside = 0.003, 0.003, 0.003 /
&penetrometer id = 'cone', tip = 3.0e-3, 3.0e-3, 5.9e-3, diameter = 2.0e-3, shaft = 2.0e-2,
          material = 'quartz', velocity = 0.0, 0.0, -0.1 /
&measure id = 'core', region = 'box', lower = 0.0, 0.0, 0.0, upper = 4.0e-3, 4.0e-3, 4.0e-3,
          every_time = 1.0e-4 /
&limits allow = 'energy_error', overlap = 0.5 /
"""
)
FEED = (
    GRAINS.replace("CONTACT", "law = 'hertz_mindlin', rolling_friction = 0.1")
    + """
&surface id = 'belt', file = 'tool.stl', material = 'quartz', velocity = 0.1, 0.0, 0.0 /
&source id = 'rain', semi_axes = 5.0e-4, 4.0e-4, 3.0e-4, scatter = 0.2, number_rate = 2.0e4,
        region = 'box', lower = 0.0, 0.0, 7.0e-3, upper = 6.0e-3, 6.0e-3, 9.0e-3,
        velocity = 0.0, 0.0, -1.0, every_time = 1.0e-4 /
&source id = 'batch', placement = 'packing', file = 'packing.h5', shift = 0.02, 0.0, 0.0,
        start = 1.0e-4, grains = 27, every_time = 1.0e-4 /
&sink id = 'out', region = 'sphere', centre = 0.0, 0.0, 0.0, radius = 2.0e-3, start = 1.0e-4,
      every_time = 1.0e-4 /
"""
)
SOLID = """
&run title = 'Cube', t_end = END, gravity = 0.0, 0.0, -9.81 /
&mesh file = 'block.h5' /
&section group = 'all', material = 'soil' /
&support group = 'z0', fix = 'x', 'y', 'z' /
&curve id = 'ramp', times = 0.0, 1.0, values = 0.0, 1.0 /
&traction group = 'z1', value = 0.0, 1.0e3, -1.0e4, curve = 'ramp' /
&output every_time = 5.0e-4 /
&history every_time = 1.0e-4 /
"""
ELASTIC = (
    SOLID
    + """
&material id = 'soil', density = 1500.0, young = 1.0e7, poisson = 0.3 /
&analysis kind = 'newmark', dt = 1.0e-4 /
"""
)
PLASTIC = (
    SOLID
    + """
&material id = 'soil', law = 'drucker_prager', density = 1800.0, young = 1.0e8, poisson = 0.25,
          cohesion = 2.0e1, friction_deg = 35.0, dilation_deg = 10.0, hardening = 0.5e6 /
&analysis kind = 'static', dt = 1.0e-4 /
"""
)
STAGES = (
    SOLID.replace("group = 'all', material", "group = 'lower', material")
    + """
&material id = 'soil', law = 'cam_clay', density = 1800.0, poisson = 0.25, critical_slope = 1.0,
          compression_index = 0.1, swelling_index = 0.02, specific_volume = 2.0,
          overconsolidation = 1.5 /
&section group = 'upper', material = 'soil' /
&initial_stress group = 'all', value = -1.0e5, -1.0e5, -1.0e5, 0.0, 0.0, 0.0 /
&stage group = 'upper', time = 4.0e-4, duration = 2.0e-4 /
&analysis kind = 'static', dt = 1.0e-4 /
"""
)
CHECKPOINT = "&checkpoint every_time = HALF /\n"


def stl(path: Path, x: float = -0.5) -> None:
    """Write a plate of two triangles beside the bed as STL text."""
    corner = [(x, -2, 0), (x, 8, 0), (x, 8, 8), (x, -2, 8)]
    lines = ["solid tool"]
    for nodes in ((0, 1, 2), (0, 2, 3)):
        lines += ["facet normal 1 0 0", "outer loop"]
        lines += ["vertex " + " ".join(f"{R * v:.6e}" for v in corner[n]) for n in nodes]
        lines += ["endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid tool", ""]))


def bed(folder: Path) -> None:
    """Write 27 grains of which one is driven, some no spheres, on a floor beside a plate."""
    rng = np.random.default_rng(4)
    x = np.stack(np.meshgrid(*3 * [np.arange(3.0)], indexing="ij"), -1).reshape(-1, 3)
    x = R * (1.99 * x + 0.995) + rng.uniform(-2e-3, 2e-3, x.shape) * R
    axes = np.full(x.shape, R)
    axes[::3] *= np.array([1.0, 0.98, 0.97])
    v = rng.normal(0.0, 0.01, x.shape)
    v[26] = 0.0
    write_packing(
        folder / "packing.h5", x, axes, v=v, groups={"pusher": [27], "low": np.arange(1, 10)}
    )
    stl(folder / "tool.stl")
    stl(folder / "skin.stl", -0.7)


def cube(folder: Path) -> None:
    """Write a cube of eight elements."""
    mesh = meshes.box(np.zeros(3), np.full(3, 0.01), (2, 2, 2))
    mesh.volumes.update(lower=np.arange(4), upper=np.arange(4, 8))
    meshes.write_mesh(folder / "block.h5", mesh)


def coupled(folder: Path) -> None:
    """Write four ghosts on the top of a cube and a grain above them, and the decks."""
    p = 5.0e-3
    flat = [(x, y, 0.0) for x in (p / 2, 1.5 * p) for y in (p / 2, 1.5 * p)]
    x = np.array([*flat, (p, p, 0.705 * p)])
    kind = np.array([1, 1, 1, 1, 0], dtype=np.int32)
    groups = {"floor": np.arange(1, 5)}
    write_packing(folder / "packing.h5", x, np.full((5, 3), 0.49 * p), kind=kind, groups=groups)
    top = meshes.box(np.array([0.0, 0.0, -2 * p]), np.array([2 * p, 2 * p, 0.0]), (2, 2, 2))
    meshes.write_mesh(folder / "block.h5", top)
    (folder / "grains.nml").write_text(f"""{QUARTZ}
&run title = 'Grain on four ghosts', gravity = 0.0, 0.0, -9.81 /
&contact between = 'quartz', 'quartz', law = 'hertz_mindlin', friction = 0.5, damping_ratio = 0.1 /
&particles file = 'packing.h5', material = 'quartz' /
&dynamics dt = 5.0e-6 /
&history every_time = 1.0e-4 /
""")
    (folder / "solid.nml").write_text("""
&run title = 'Cube', gravity = 0.0, 0.0, -9.81 /
&mesh file = 'block.h5' /
&material id = 'soil', density = 1500.0, young = 1.0e7, poisson = 0.3 /
&section group = 'all', material = 'soil' /
&support group = 'z0', fix = 'x', 'y', 'z' /
&analysis kind = 'newmark' /
&history every_time = 1.0e-4 /
""")
    (folder / "deck.nml").write_text("""
&run title = 'Test', t_end = END /
&program side = 'grains', deck = 'grains.nml' /
&program side = 'solid', deck = 'solid.nml' /
&clock exchange = 5.0e-5 /
&facets ghosts = 'floor', facets = 'z1' /
&checkpoint every_time = 2.0e-4 /
""")


def overlapping(folder: Path) -> None:
    """Write a column of touching spheres in a bar of hexahedra, and the decks."""
    d = 1.0e-3
    line = d * (np.arange(2) + 0.5)
    x = np.array([(a, b, d * (k + 0.5)) for k in range(-4, 10) for a in line for b in line])
    v = np.where(x[:, 2:] < 0.0, np.array([0.0, 0.0, 0.05]), 0.0)
    write_packing(folder / "packing.h5", x, np.full((len(x), 3), 0.5005 * d), v=v)
    bar = meshes.box(np.zeros(3), np.array([2 * d, 2 * d, 14 * d]), (1, 1, 7))
    bar.volumes.update(inner=np.arange(3), layer=np.arange(3, 5), rest=np.arange(5, 7))
    meshes.write_mesh(folder / "block.h5", bar)
    (folder / "grains.nml").write_text(f"""{QUARTZ}
&run title = 'Column of spheres', gravity = 0.0, 0.0, 0.0 /
&contact between = 'quartz', 'quartz', law = 'linear', normal_stiffness = 1.0e5,
         tangential_stiffness = 5.0e4, friction = 0.5 /
&particles file = 'packing.h5', material = 'quartz' /
&dynamics dt = 2.0e-7 /
&history every_time = 4.0e-6 /
""")
    (folder / "solid.nml").write_text("""
&run title = 'Bar', gravity = 0.0, 0.0, 0.0 /
&mesh file = 'block.h5' /
&material id = 'soil', density = 1388.0, young = 1.0e8, poisson = 0.0 /
&section group = 'all', material = 'soil' /
&support group = 'z1', fix = 'x', 'y', 'z' /
&analysis kind = 'explicit' /
&history every_time = 4.0e-6 /
""")
    (folder / "deck.nml").write_text("""
&run title = 'Test', t_end = END /
&program side = 'grains', deck = 'grains.nml' /
&program side = 'solid', deck = 'solid.nml' /
&clock exchange = 1.0e-6 /
&overlap free_elements = 'inner', ghost_elements = 'layer' /
&checkpoint every_time = 0.8e-5 /
""")


def opened(folder: Path) -> None:
    """Write a column of spheres that wake as a box passes."""
    opened_column.write(folder, ", keep_behind = 4.0e-3, hold_behind = 1.0e-3")
    deck = (folder / "coupled.nml").read_text().replace("t_end = 1.2e-4", "t_end = END")
    (folder / "deck.nml").write_text(deck)
    (folder / "coupled.nml").unlink()


def make(name: str, scratch: Path, binaries: Path) -> Run:
    """Make the inputs of a run: bed, tools, cell, elastic, ... (see below); '_restart' behind
    it: it was run to its half, and goes on from its checkpoint."""
    kind, _, restart = name.partition("_")
    folder = scratch / name
    folder.mkdir(parents=True)
    text, end, program = {
        "bed": (BED, 4.0e-4, "talus-dem"),
        "cell": (CELL, 4.0e-4, "talus-dem"),
        "feed": (FEED, 4.0e-4, "talus-dem"),
        "elastic": (ELASTIC, 1.0e-3, "talus-fem"),
        "plastic": (PLASTIC, 1.0e-3, "talus-fem"),
        "stages": (STAGES, 1.0e-3, "talus-fem"),
        "tools": (TOOLS, 4.0e-4, "talus-dem"),
        "coupled": ("", 4.0e-4, "talus-couple"),
        "overlap": ("", 1.6e-5, "talus-couple"),
        "opened": ("", 1.2e-4, "talus-couple"),
    }[kind]
    writers = {"coupled": coupled, "overlap": overlapping, "opened": opened}
    writers.get(kind, bed if program == "talus-dem" else cube)(folder)
    deck = folder / "deck.nml"
    text = text or deck.read_text()
    command = [str(binaries / program), "deck.nml"]
    if restart:
        half = text if "&checkpoint" in text else text + CHECKPOINT
        half = half.replace("HALF", f"{end / 4:.3e}").replace("END", f"{end / 2:.3e}")
        deck.write_text(half)
        code, said = call(command, folder)
        if code != 0:
            sys.exit(f"{name}: the first half ends with {code}:\n{said[-3000:]}")
        newest = "deck.manifest" if program == "talus-couple" else "deck.chk.h5"
        command = [*command, f"--restart={newest}"]
    deck.write_text(text.replace("END", f"{end:.3e}"))
    return Run(name, folder, command)
