"""Points as arrays of jobs: scripts for Slurm and PBS, submitted where the command is there."""

import json
import re
import shutil
import subprocess
from pathlib import Path

from talus.faults import FaultError
from talus.files import make_folder, write_text_file
from talus.study.definition import Study
from talus.study.folders import Store

LARGEST = 1000  # jobs of an array; MaxArraySize of Slurm is 1001 unless changed
SUBMIT = {"slurm": "sbatch", "pbs": "qsub"}
ASK = {"slurm": ["squeue", "-h", "-j"], "pbs": ["qstat"]}
BODY = """cd '{folder}' || exit 4
name=$(sed -n "${{{index}:-1}}p" '{points}')
exec sh "points/$name/point.sh"
"""


def header(study: Study, count: int, log: Path) -> list[str]:
    """Return the lines that the scheduler reads."""
    run = study.run
    if run["scheduler"] == "slurm":
        lines = [f"--job-name={study.path.stem}", f"--array=1-{count}%{run['at_once']}",
                 "--ntasks=1", f"--cpus-per-task={run['threads']}",
                 f"--output={log}/%A_%a.out"]  # fmt: skip
        mark = "#SBATCH"
    else:
        array = [f"-J 1-{count}%{run['at_once']}"] if count > 1 else []  # PBS refuses 1-1
        lines = [f"-N {study.path.stem[:15]}", *array,
                 f"-l select=1:ncpus={run['threads']}", "-j oe", f"-o {log}/"]  # fmt: skip
        mark = "#PBS"
    return [f"{mark} {line}" for line in [*lines, *map(str, run["options"])]]


def write_array(study: Study, store: Store, numbers: list[int]) -> Path:
    """Write script and list of one array; return the script."""
    folder = (store.folder / "jobs").resolve()
    make_folder(folder)
    stem = f"array_{len(list(folder.glob('array_*.sh'))) + 1:03d}"
    points = folder / f"{stem}.points"
    write_text_file(points, "".join(f"{number:04d}\n" for number in numbers))
    index = "SLURM_ARRAY_TASK_ID" if study.run["scheduler"] == "slurm" else "PBS_ARRAY_INDEX"
    body = BODY.format(folder=store.folder.resolve(), index=index, points=points)
    script = folder / f"{stem}.sh"
    text = "\n".join(["#!/bin/sh", *header(study, len(numbers), folder), body])
    write_text_file(script, text)
    return script


def in_queue(scheduler: str, jobs: list[str]) -> list[str]:
    """Return the jobs that the scheduler still has."""
    if not shutil.which(ASK[scheduler][0]):
        return []
    left = []
    for job in jobs:
        done = subprocess.run([*ASK[scheduler], job], capture_output=True, text=True)
        left += [job] if done.returncode == 0 and done.stdout.strip() else []
    return left


def submit(study: Study, store: Store) -> list[str]:
    """Write arrays of all points that have not finished and submit them; return what was done."""
    scheduler, record = study.run["scheduler"], store.folder / "jobs/submitted.json"
    jobs = json.loads(record.read_text()) if record.is_file() else []
    if left := in_queue(scheduler, jobs):
        text = f"jobs of this study are in the queue: {', '.join(left)}"
        raise FaultError("E593", text, "wait for them, or cancel them first", str(study.path))
    numbers = [n for n in store.numbers() if store.end_of(n) is None]
    for number in numbers:
        store.prepare(study, number)
    said = []
    for first in range(0, len(numbers), LARGEST):
        script = write_array(study, store, numbers[first : first + LARGEST])
        if not shutil.which(SUBMIT[scheduler]):
            said.append(f"{SUBMIT[scheduler]} is not here; submit: {SUBMIT[scheduler]} {script}")
            continue
        done = subprocess.run([SUBMIT[scheduler], str(script)], capture_output=True, text=True)
        if done.returncode:
            text = f"{SUBMIT[scheduler]} refused {script.name}: {done.stderr.strip()[-200:]}"
            raise FaultError("E593", text, "[run] options", str(study.path), exit_code=4)
        found = re.search(r"\d+(\[\])?", done.stdout)
        jobs.append(found[0] if found else done.stdout.strip())
        write_text_file(record, json.dumps(jobs))
        said.append(f"{script}: {done.stdout.strip()}")
    return said or ["every point has finished: talus study --collect"]
