"""A bed that breaks under a coupled block, against the same bed under a wall."""

import numpy as np
from coupled import audit_of, compare_runs, write_box, write_deck

from talus.verification import Case, read_history, write_packing

RADIUS, SIDE, ASIDE, EXCHANGE = 1.0e-3, 6.2e-3, 3.0e-5, 1.0e-6
WALL = """&wall      id = 'top', point = 0.0, 0.0, 6.0e-3, normal = 0.0, 0.0, -1.0,
           material = 'plate', velocity = 0.0, 0.0, -1.0 /"""
END, MIDDLE = "1.6e-4", "4.8e-5"


def write_bed(case: Case, ghosts: bool = False) -> None:
    """Write 27 spheres in layers that are shifted in turn, and the block on them, or on a layer."""
    k, j, i = (a.ravel() for a in np.meshgrid(*[np.arange(3)] * 3, indexing="ij"))
    x = RADIUS * (1.0 + 2.0 * np.column_stack([i, j, k]))
    x[:, :2] += 0.5 * (SIDE - 6.0 * RADIUS) + ASIDE * (1 - 2 * (k % 2))[:, None]
    low = (7.0 if ghosts else 6.0) * RADIUS
    if ghosts:
        x = np.vstack([x, x[9:18] + [0.0, 0.0, 4.0 * RADIUS]])
    write_packing(case.folder / "pack.h5", x, np.full((len(x), 3), RADIUS),
                  kind=np.repeat([0, 1], [27, len(x) - 27]),
                  groups={"top": np.arange(28, len(x) + 1)})  # fmt: skip
    write_box(case.folder / "block.h5", [-2.0e-4, -2.0e-4, low], [6.4e-3, 6.4e-3, low + 2.0e-3],
              (2, 2, 1))  # fmt: skip


def under_block(case: Case, name: str, threads: int = 1, transport: str = "shared_memory") -> None:
    """Run the bed under the block; 'parts' in two parts."""
    block = {"top": "the face of a block", "wall": "", "end": ""}
    write_deck(case, f"{name}_grains.nml", "grains.nml", **block)
    deck = case.folder / f"{name}_grains.nml"
    deck.write_text(deck.read_text().replace("'plate'", "'block'"))
    write_deck(case, f"{name}_solid.nml", "solid.nml")
    for end in (MIDDLE, END) if name == "parts" else (END,):
        write_deck(case, f"{name}.nml", "coupled.nml", name=name, end=end, threads=threads,
                   transport=transport)  # fmt: skip
        again = ("--restart=auto",) if name == "parts" and end == END else ()
        case.run("talus-couple", f"{name}.nml", *again)


def compare_breaks(case: Case, label: str, wall: dict, block: dict) -> None:
    """Judge order, times and stresses of what breaks."""
    n = len(wall["id"])
    case.above(f"{label}grains that break", n, 8)
    case.metric(f"{label}grains that break under the block", len(block["id"]), n, 0)
    n = min(n, len(block["id"]))
    case.metric(f"{label}places in the order at which others break",
                int((wall["id"][:n] != block["id"][:n]).sum()), 0, 0)  # fmt: skip
    late = block["time"][:n] - wall["time"][:n]
    case.below(f"{label}delay less an exchange [s]", np.abs(late - EXCHANGE).max(), 1e-9)
    case.below(f"{label}difference of stresses",
               np.abs(block["stress"][:n] / wall["stress"][:n] - 1).max(), 1e-3)  # fmt: skip


def compare_ghosts(case: Case) -> None:
    """Judge a bed under spheres that the block carries, by ids behind those of the bed."""
    write_bed(case, ghosts=True)
    driven = "&driven ids = 28, 29, 30, 31, 32, 33, 34, 35, 36, velocity = 0.0, 0.0, -1.0 /"
    write_deck(case, "driven.nml", "grains.nml", top="spheres", wall=driven, end=f"t_end = {END}, ")
    case.run("talus-dem", "driven.nml", "--threads=1")
    write_deck(case, "ghosts_grains.nml", "grains.nml", top="ghosts", wall="", end="")
    write_deck(case, "ghosts_solid.nml", "solid.nml")
    write_deck(case, "ghosts.nml", "coupled.nml", name="ghosts", end=END, threads=1,
               transport="shared_memory")  # fmt: skip
    deck = case.folder / "ghosts.nml"
    deck.write_text(deck.read_text().replace("surface = 'block'", "ghosts = 'top'"))
    case.run("talus-couple", "ghosts.nml")
    rows = [read_history(case.folder / f"{name}_broken.csv") for name in
            ("driven", "ghosts_grains")]  # fmt: skip
    compare_breaks(case, "ghosts: ", *rows)
    audit = audit_of(case, "ghosts")
    way = audit["largest_ghost_displacement"][-1] / 1.59e-4
    case.metric("ghosts: largest way / that of the face", way, 1.0, 1e-3)


def run(case: Case) -> None:
    """Compare with a wall, then with runs in parts, on threads and by files."""
    write_bed(case)
    write_deck(case, "wall.nml", "grains.nml", top="a wall", wall=WALL, end=f"t_end = {END}, ")
    case.run("talus-dem", "wall.nml", "--threads=1")
    under_block(case, "whole")
    wall, block = (read_history(case.folder / f"{name}_broken.csv") for name in
                   ("wall", "whole_grains"))  # fmt: skip
    compare_breaks(case, "", wall, block)
    audit = audit_of(case, "whole")
    walls = read_history(case.folder / "wall_walls.csv")
    top = walls["wall"] == walls["wall"].max()
    alone = np.interp(audit["time"] - 1.5 * EXCHANGE, walls["time"][top], walls["force_z"][top])
    before = (audit["time"] < block["time"][0]) & (audit["time"] > 2.5 * EXCHANGE)  # not the start
    most = np.abs(alone[before]).max()
    off = np.abs(audit["force_on_solid_z"][before] - alone[before]).max()
    case.below("difference of forces until the first break / the largest", off / most, 1e-2)
    names = ("kinetic", "elastic", "friction", "contact_damping")
    spent = sum(audit[f"grains_{name}"] for name in names)
    gap = np.abs(spent - audit["grains_boundary_work"]).max() / audit["grains_boundary_work"].max()
    case.below("energies of the audit that nobody counts / work of the face", gap, 5e-3)
    energy = read_history(case.folder / "whole_grains_energy.csv")
    case.below("closure of the ledger of the grains", energy["relative_closure"][-1], 1e-3)
    for name, threads, transport in (("parts", 1, "shared_memory"), ("two", 2, "shared_memory"),
                                     ("files", 1, "hdf5")):  # fmt: skip
        under_block(case, name, threads, transport)
        compare_runs(case, f"{name}: ", "whole", name)
        for kind in ("broken", "breakage"):
            a, b = (case.folder / f"{head}_grains_{kind}.csv" for head in ("whole", name))
            differs = float(a.read_bytes() != b.read_bytes())
            case.metric(f"{name}: {kind}.csv differs", differs, 0, 0)
    compare_ghosts(case)
    draw(case, walls, top, audit, block)


def draw(case: Case, walls: dict, top: np.ndarray, audit: dict, block: dict) -> None:
    """Draw force and energies over time."""
    fig, (ax, ax2) = case.figure(ncols=2, figsize=(9.5, 4.0))
    ax.plot(1e6 * walls["time"][top], walls["force_z"][top], "k-", lw=1.2, label="wall")
    ax.plot(1e6 * audit["time"], audit["force_on_solid_z"], "C1.", ms=3, label="block")
    for time in block["time"]:
        ax.axvline(1e6 * time, color="0.8", lw=0.6, zorder=0)
    ax.set(xlabel="time [µs]", ylabel="force [N]", title="lines: a grain breaks")
    ax.legend()
    names = ("kinetic", "elastic", "friction", "contact_damping")
    labels = ("kinetic", "elastic", "friction, released, fines", "contact damping")
    ax2.stackplot(1e6 * audit["time"], *(1e3 * audit[f"grains_{n}"] for n in names), labels=labels,
                  alpha=0.6)  # fmt: skip
    work = 1e3 * audit["grains_boundary_work"]
    ax2.plot(1e6 * audit["time"], work, "k-", label="work of the face")
    ax2.set(xlabel="time [µs]", ylabel="energy [mJ]")
    ax2.legend(fontsize=8)
    case.save(fig)
