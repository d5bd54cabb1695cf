"""Table and figure of `make bench`: bench.csv, its Markdown for the manual, bench.png."""

import csv
import statistics
from pathlib import Path

import numpy as np
from bench_beds import BEDS

REFERENCE = "spheres_10000"  # LAMMPS' rate beside which ellipsoids are put
QUICK_REFERENCE = "spheres_2000"
COLUMNS = (
    "code", "case", "grains", "cores", "grain_steps_per_s", "contacts_per_s", "max_rss_mb",
    "ratio_to_lammps", "ratio_to_ellipsoids", "ratio_to_copied", "grain_steps_per_cpu_s", "seconds",
    "ratio_to_calculix", "difference", "residual", "liquid_share",
)  # fmt: skip


def table(timings: list) -> list[dict]:
    """Return the rows of bench.csv, medians of the repeats.

    ratio_to_lammps: of the same bed with as many cores; for ellipsoids, which LAMMPS of Debian
    does not have, of LAMMPS' spheres_10000 (spheres_2000 in quick runs). Empty without LAMMPS.
    ratio_to_ellipsoids: of other shapes to the same bed of ellipsoids, by CPU time.
    ratio_to_copied: of a bed of copies to the one bed that was copied, per grain, by wall time.
    """
    rates = {(t.code, t.case, t.cores): statistics.median(t.wall) for t in timings}
    paces = {(t.code, t.case, t.cores): statistics.median(t.cpu) for t in timings}
    rows = []
    for t in timings:
        rate, pace = statistics.median(t.wall), statistics.median(t.cpu)
        sister = paces.get((t.code, BEDS[t.case].beside, t.cores)) if t.case in BEDS else None
        copied = rates.get((t.code, BEDS[t.case].source, t.cores)) if t.case in BEDS else None
        beside = (t.case, REFERENCE, QUICK_REFERENCE)
        found = [rates.get(("lammps", case, t.cores)) for case in beside]
        peer = next((value for value in found if value), None)
        rows.append({
            "code": t.code,
            "case": t.case,
            "grains": t.grains,
            "cores": t.cores,
            "grain_steps_per_s": round(rate),
            "contacts_per_s": round(rate * t.contacts / t.grains),
            "max_rss_mb": round(t.memory, 1),
            "ratio_to_lammps": round(rate / peer, 3) if peer else "",
            "ratio_to_ellipsoids": round(pace / sister, 3) if sister else "",
            "ratio_to_copied": round(rate / copied, 3) if copied else "",
            "grain_steps_per_cpu_s": round(pace),
        })  # fmt: skip
    return rows


def write(path: Path, rows: list[dict], head: dict) -> None:
    """Write the rows as CSV; comments above give what was run where."""
    with path.open("w", newline="") as file:
        for key, value in head.items():
            file.write(f"# {key}: {value}\n")
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def read(path: Path) -> tuple[list[dict], dict]:
    """Read what `write` wrote: rows (as text) and head."""
    lines = path.read_text().splitlines()
    head = dict(line[2:].split(": ", 1) for line in lines if line.startswith("# "))
    return list(csv.DictReader(line for line in lines if not line.startswith("#"))), head


def split(rows: list[dict]) -> tuple[list[dict], list[dict]]:
    """Return the rows of grains and those of solids."""
    solids = [row for row in rows if row.get("seconds")]
    return [row for row in rows if not row.get("seconds")], solids


def figure(path: Path, rows: list[dict], head: dict) -> None:
    """Draw grain-steps a second of every code, bed by bed (without grains: of solids)."""
    from talus.look import COLOURS, new_figure, save_figure

    rows = split(rows)[0] or rows
    unit = "grain" if split(rows)[0] else "element"
    cases = list(dict.fromkeys(row["case"] for row in rows))
    kinds = list(dict.fromkeys((row["code"], int(row["cores"])) for row in rows))
    codes = list(dict.fromkeys(code for code, _ in kinds))
    fig, ax = new_figure(figsize=(max(8.0, 1.05 * len(cases)), 4.2))
    width = 0.8 / len(kinds)
    for k, (code, cores) in enumerate(sorted(kinds, key=lambda kind: (kind[1], kind[0]))):
        values = [
            next((float(row["grain_steps_per_s"]) / 1e6 for row in rows
                  if (row["code"], int(row["cores"]), row["case"]) == (code, cores, case)), np.nan)
            for case in cases
        ]  # fmt: skip
        places = np.arange(len(cases)) + (k - 0.5 * (len(kinds) - 1)) * width
        label = f"{code}, {cores} core{'s' if cores > 1 else ''}"
        ax.bar(
            places, values, 0.92 * width, label=label, color=COLOURS[codes.index(code)],
            alpha=1.0 if cores == 1 else 0.55,
        )  # fmt: skip
    ax.set_xticks(np.arange(len(cases)), [case.replace("_", "\n") for case in cases], fontsize=8)
    ax.set_ylabel(f"speed [million {unit}-steps/s]")
    ax.grid(axis="x", visible=False)
    ax.set_title(f"{head['machine']}, {head['date']}", fontsize=8)
    ax.legend(fontsize=8, loc="upper right")
    save_figure(fig, path)


def solid_table(rows: list[dict]) -> list[str]:
    """Return the lines of the table of solids."""
    lines = [
        "",
        "| solid | cores | code | elements | seconds | million element-steps/s | by CPU time "
        "[million/s] | memory [MB] | ratio to CalculiX | corner off by | residual |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        rate, cpu = (float(row[k]) / 1e6 for k in ("grain_steps_per_s", "grain_steps_per_cpu_s"))
        lines.append(
            f"| {row['case']} | {row['cores']} | {row['code']} | {row['grains']} "
            f"| {row['seconds']} | {rate:.3g} | {cpu:.3g} | {float(row['max_rss_mb']):.0f} "
            f"| {row['ratio_to_calculix'] or '–'} | {row['difference'] or '–'} "
            f"| {row['residual'] or '–'} |"
        )
    return lines


def markdown(rows: list[dict], head: dict) -> str:
    """Return the table for the manual."""
    lines = [
        f"Machine: {head['machine']}; {head['date']}; Talus {head['version']}; medians of "
        f"{head['repeats']} repeats; load of the machine at the start {head['load']}.",
        "",
        "| case | cores | code | million grain-steps/s | million contacts/s | memory [MB] "
        "| ratio to LAMMPS | to ellipsoids | to what was copied | by CPU time [million/s] |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    grains, solids = split(rows)
    for row in grains:
        rate, contacts = (float(row[key]) / 1e6 for key in ("grain_steps_per_s", "contacts_per_s"))
        lines.append(
            f"| {row['case']} | {row['cores']} | {row['code']} | {rate:.3g} | {contacts:.3g} "
            f"| {float(row['max_rss_mb']):.0f} | {row['ratio_to_lammps'] or '–'} "
            f"| {row.get('ratio_to_ellipsoids') or '–'} | {row.get('ratio_to_copied') or '–'} "
            f"| {float(row['grain_steps_per_cpu_s']) / 1e6:.3g} |"
        )
    lines = lines if grains else lines[:2]
    return "\n".join(lines + (solid_table(solids) if solids else [])) + "\n"
