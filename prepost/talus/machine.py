"""What a machine must have to build and run Talus, each thing with what is wrong and a cure."""

import ctypes
import importlib.metadata
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

from talus import version
from talus.faults import FaultError
from talus.programs import find_program

OLDEST_GFORTRAN = 12
SHARED_BYTES = 64 * 2**20
DISK_BYTES = 2**30
#: OpenBLAS names these where it does not know the CPU; they do without AVX.
SLOW_KERNELS = ("prescott", "core2", "nehalem", "generic")
PROGRAMS = ("talus-dem", "talus-fem", "talus-couple")
PACKAGES = ("numpy", "h5py", "meshio", "gmsh", "matplotlib")


class Finding(NamedTuple):
    """One thing: its name, what was seen, and what to do, empty where it is well."""

    name: str
    seen: str
    cure: str = ""


def first_line(command: list[str]) -> str:
    """Return the first line that a command prints, empty if it does not run."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip().split("\n")[0] if done.returncode == 0 else ""


def of_compiler(text: str, installed: bool = False) -> Finding:
    """Judge the first line of `gfortran --version`; programs that are installed need none."""
    if installed and not text:
        return Finding("compiler", "none, and none is needed: the programs are there")
    number = re.search(r"\b(\d+)\.\d+", text)
    old = number is not None and int(number[1]) < OLDEST_GFORTRAN
    cure = f"install gfortran {OLDEST_GFORTRAN} or newer" if old or not text else ""
    return Finding("compiler", text or "gfortran was not found", cure)


def of_mpi(text: str) -> Finding:
    """Judge the first line of `mpirun --version`."""
    return Finding("MPI", text or "mpirun was not found", "" if text else "install openmpi-bin")


def of_kernel(core: str, flags: set[str], chosen: str) -> Finding:
    """Judge the kernel of OpenBLAS by the CPU's flags and OPENBLAS_CORETYPE (`chosen`)."""
    if core.lower() not in SLOW_KERNELS or "avx2" not in flags:
        return Finding("BLAS", f"OpenBLAS with kernel {core}" if core else "OpenBLAS not loaded")
    best = "SkylakeX" if "avx512f" in flags else "Haswell"
    if not chosen:  # the programs set it themselves when they start
        return Finding("BLAS", f"OpenBLAS would take {core}; the programs set {best}")
    return Finding("BLAS", f"OPENBLAS_CORETYPE={chosen} is slow here", f"unset it, or set {best}")


def of_threads(asked: str, cores: int) -> Finding:
    """Judge OMP_NUM_THREADS (`asked`) by the cores that this process may use."""
    if not asked:
        return Finding("threads", f"{cores} cores")
    seen = f"OMP_NUM_THREADS={asked} on {cores} cores"
    first = asked.split(",")[0].strip()
    good = first.isdigit() and 1 <= int(first) <= cores
    return Finding("threads", seen, "" if good else f"set OMP_NUM_THREADS to 1..{cores}")


def of_space(name: str, folder: Path, least: int) -> Finding:
    """Judge a folder by its free space, of which `least` bytes are needed, and by its rights."""
    if not folder.is_dir() or not os.access(folder, os.W_OK):
        return Finding(name, f"{folder} cannot be written", "make it, or give the right to write")
    free = shutil.disk_usage(folder).free
    cure = "" if free >= least else f"free {least / 2**20:.0f} MiB"
    return Finding(name, f"{free / 2**20:.0f} MiB free in {folder}", cure)


def of_program(name: str) -> Finding:
    """Judge a program by whether it is there, starts, and has the version of this package."""
    try:
        text = first_line([str(find_program(name)), "--version"])
    except FaultError:
        return Finding(name, "was not found", "build it with make, or set TALUS_BIN")
    if not text:
        return Finding(name, "does not start", f"run {name} --version: it names what is missing")
    same = f" {version()}," in f"{text},"
    return Finding(name, text, "" if same else f"build it anew: this package is {version()}")


def of_package(name: str) -> Finding:
    """Judge a Python package by its version."""
    try:
        return Finding(name, importlib.metadata.version(name))
    except importlib.metadata.PackageNotFoundError:
        return Finding(name, "is not installed", f"pip install {name}")


def of_hdf5() -> Finding:
    """Judge the HDF5 library of h5py by whether it loads."""
    try:
        import h5py
    except ImportError as fault:
        return Finding("HDF5", f"h5py does not load: {fault}", "pip install --force-reinstall h5py")
    return Finding("HDF5", h5py.version.hdf5_version)


def core_name() -> str:
    """Return the kernel that OpenBLAS takes in this process, empty without the library."""
    try:
        ask = ctypes.CDLL("libopenblas.so.0").openblas_get_corename
    except (OSError, AttributeError):
        return ""
    ask.restype = ctypes.c_char_p
    return ask().decode()


def cpu_flags() -> set[str]:
    """Return the flags of the CPU in /proc/cpuinfo."""
    try:
        found = re.search(r"^flags\s*:(.*)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    except OSError:
        return set()
    return set(found[1].split()) if found else set()


def look_at(folder: Path) -> list[Finding]:
    """Return what this machine has, and the disk of `folder`."""
    programs = [of_program(name) for name in PROGRAMS]
    installed = not any(finding.cure for finding in programs)
    return [
        of_compiler(first_line(["gfortran", "--version"]), installed),
        of_mpi(first_line(["mpirun", "--version"])),
        of_kernel(core_name(), cpu_flags(), os.environ.get("OPENBLAS_CORETYPE", "")),
        of_threads(os.environ.get("OMP_NUM_THREADS", ""), len(os.sched_getaffinity(0))),
        of_space("shared memory", Path("/dev/shm"), SHARED_BYTES),
        of_space("disk", folder, DISK_BYTES),
        *programs,
        *(of_package(name) for name in PACKAGES),
        of_hdf5(),
    ]
