#!/usr/bin/env bash
# Install what Talus needs: apt packages (with sudo where not root) and a Python environment.
# Usage: tools/deps.sh apt | installed | bench | run | render | dev     (each costs nothing when already done)
# installed: what an installed suite runs with, without compilers (Debian 12). bench: other codes
# beside which make bench puts Talus.
set -euo pipefail
cd "$(dirname "$0")/.."
venv=build/venv
stamps=build/deps

compilers="gcc gfortran make libc6-dev libopenblas-dev libmumps-dev libmetis-dev libhypre-dev libhdf5-dev openmpi-bin libopenmpi-dev python3 python3-venv"
installed="libgfortran5 libopenblas0-pthread libmumps-5.5 libmetis5 libhypre-2.26.0 libhdf5-103-1 libhdf5-fortran-102 openmpi-bin libopenmpi3 python3"
gmsh_libraries="libglu1-mesa libgl1 libxrender1 libxcursor1 libxfixes3 libxext6 libxft2 libfontconfig1 libxinerama1 libx11-6 libgomp1"
drawing_libraries="libegl1"  # VTK draws through it where there is no screen
peers="lammps liggghts calculix-ccx openmpi-bin util-linux"

fail() { printf 'deps: %s\n' "$*" >&2; exit 4; }

apt_packages() {  # $1: names of packages
  local missing=() package
  if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
    command -v mpifort >/dev/null || fail "no apt on this machine: load a Fortran compiler, MPI, MUMPS, METIS, hypre, HDF5 and OpenBLAS (README, 'Without apt')"
    return 0
  fi
  for package in $1; do
    dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing+=("$package")
  done
  [ ${#missing[@]} -eq 0 ] && return 0
  local sudo=""
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || fail "not root and no sudo; ask an administrator to install: ${missing[*]}"
    sudo=sudo
  fi
  printf 'deps: installing %s\n' "${missing[*]}"
  $sudo apt-get update -qq || printf 'deps: package lists could not be refreshed, going on with the old ones\n' >&2
  $sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null \
    || fail "apt-get could not install: ${missing[*]}"
}

python_environment() {  # $1: name of the requirements list
  local list="prepost/requirements-$1.txt" stamp="$stamps/python-$1" python
  mkdir -p "$stamps"
  if [ -f "$stamp" ] && cmp -s "$list" "$stamp" && [ -x "$venv/bin/python" ]; then return 0; fi
  if [ ! -x "$venv/bin/python" ]; then
    for python in "${PYTHON:-}" /usr/bin/python3 python3; do
      [ -n "$python" ] && command -v "$python" >/dev/null &&
        "$python" -c 'import sys, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && break
      python=""
    done
    [ -n "$python" ] || fail "Python 3.11 or newer with venv is needed (apt: python3-venv; or set PYTHON=…)"
    "$python" -m venv "$venv" || fail "could not make a Python environment in $venv"
  fi
  printf 'deps: Python packages (%s)\n' "$1"
  "$venv/bin/python" -m pip install --quiet --disable-pip-version-check -r "$list" ||
    fail "pip could not install $list"
  if [ "$1" = run ]; then
    "$venv/bin/python" tools/link_package.py || fail "could not link the package talus into $venv"
  fi
  cp "$list" "$stamp"
}

case "${1:-}" in
  apt) apt_packages "$compilers $gmsh_libraries $drawing_libraries" ;;
  installed) apt_packages "$installed $gmsh_libraries $drawing_libraries" ;;
  bench) apt_packages "$peers" ;;
  run | render | dev) python_environment "$1" ;;
  *) fail "usage: tools/deps.sh apt | installed | bench | run | render | dev" ;;
esac
