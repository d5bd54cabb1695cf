"""The table of a study: a row a point with values, results, exit code; CSV and HDF5."""

import csv
import io
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

import talus
from talus.checksum import created
from talus.faults import FaultError
from talus.files import replaced, write_text_file
from talus.study.definition import Study
from talus.study.folders import Store
from talus.study.results import collect_point

FAILED = "failed"


@dataclass
class Table:
    """Rows of all points; results are NaN where a point has none."""

    numbers: np.ndarray
    values: dict[str, list]
    results: dict[str, np.ndarray]
    state: list[str]  # finished, failed, waiting
    exit_code: list[int | None]
    seconds: np.ndarray
    message: list[str]
    provenance: dict[str, str] = field(default_factory=dict)

    def count(self, state: str) -> int:
        """Return the number of points in a state."""
        return self.state.count(state)


def collect(study: Study, store: Store) -> Table:
    """Return the table of what there is; E590 if a result is missing at every finished point."""
    rows, ends = store.plan["rows"], [store.end_of(n) for n in store.numbers()]
    count = len(rows)
    table = Table(
        np.arange(1, count + 1), {p.name: [row[p.name] for row in rows] for p in study.parameters},
        {one.name: np.full(count, np.nan) for one in study.results}, [], [],
        np.full(count, np.nan), [],
        {"talus": talus.version(), "begun_with": store.plan["talus"], "begun": store.plan["begun"],
         "identity": store.plan["identity"], "plan": store.plan["plan"],
         "seed": str(store.plan["seed"])} | {f"sha256 {k}": v
                                             for k, v in store.plan["files"].items()},
    )  # fmt: skip
    faults = []
    for k, end in enumerate(ends):
        state, message = "waiting", ""
        if end is not None:
            table.seconds[k] = end["end"] - end["begin"]
            state, message = "finished", ""
            if end["exit_code"]:
                state, message = FAILED, store.message(k + 1)
            else:
                try:
                    found = collect_point(store.point(k + 1), study.results, rows[k])
                    for name, value in found.items():
                        table.results[name][k] = value
                except FaultError as fault:
                    state, message = FAILED, str(fault).splitlines()[0]
                    faults.append(fault)
        table.state.append(state)
        table.exit_code.append(None if end is None else end["exit_code"])
        table.message.append(message)
    if faults and not table.count("finished"):
        raise faults[0]
    return table


def write_csv(path: Path, table: Table) -> None:
    """Write the table as CSV; lines with # before it say where it comes from."""
    out = io.StringIO()
    for name, value in table.provenance.items():
        out.write(f"# {name}: {value}\n")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["point", *table.values, *table.results, "state", "exit_code", "seconds",
                     "message"])  # fmt: skip
    for k, number in enumerate(table.numbers):
        numbers = [repr(float(x[k])) for x in table.results.values()]
        values = [x[k] for x in table.values.values()]
        code = "" if table.exit_code[k] is None else table.exit_code[k]
        writer.writerow([number, *values, *numbers, table.state[k], code,
                         f"{table.seconds[k]:.3f}", table.message[k]])  # fmt: skip
    write_text_file(path, out.getvalue())


def write_h5(path: Path, table: Table) -> None:
    """Write the table as HDF5: groups parameters and results, datasets of the states."""
    text = h5py.string_dtype()
    with replaced(path) as temporary, created(temporary) as file:
        file.attrs["format"] = "talus-study"
        for name, value in table.provenance.items():
            file.attrs[name] = value
        for name, column in table.values.items():
            numbers = all(isinstance(v, int | float) for v in column)
            data = np.array(column) if numbers else np.array([str(v) for v in column], dtype=text)
            file.create_dataset(f"parameters/{name}", data=data)
        for name, column in table.results.items():
            file.create_dataset(f"results/{name}", data=column)
        file.create_group("results") if not table.results else None
        file["point"], file["seconds"] = table.numbers, table.seconds
        codes = [-1 if code is None else code for code in table.exit_code]
        file["exit_code"] = np.array(codes, dtype=np.int32)
        file.create_dataset("state", data=np.array(table.state, dtype=text))
        file.create_dataset("message", data=np.array(table.message, dtype=text))
