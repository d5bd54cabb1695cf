#!/usr/bin/env bash
# The stiffness matrix of CalculiX in the place of talus-fem, in the penetration of example 14.
# Usage: run.sh OUT
source "$(dirname "$0")/../head.sh"
source "$here/../beside.sh"
own=${CALCULIX_PYTHON:-/usr/bin/python3}
export PYTHONPATH=$root/prepost

if ! command -v ccx >/dev/null || ! "$own" -c 'import scipy, h5py' 2>/dev/null; then
  printf 'CalculiX example: there is no ccx, or %s has no scipy and h5py\n' "$own" >&2
  printf '  hint: apt-get install --no-install-recommends calculix-ccx python3-scipy python3-h5py,\n' >&2
  printf '        or name another Python by CALCULIX_PYTHON\n' >&2
  exit 4
fi
penetration_beside "${1:?usage: run.sh OUT}" calculix "$own $here/solid.py"
