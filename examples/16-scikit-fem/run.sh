#!/usr/bin/env bash
# scikit-fem in the place of talus-fem, in the penetration of example 14.
# Usage: run.sh OUT
source "$(dirname "$0")/../head.sh"
source "$here/../beside.sh"
own=${SKFEM_PYTHON:-$root/build/scikit-fem/bin/python}
export PYTHONPATH=$root/prepost

if ! missing=$("$own" -c 'import skfem, h5py' 2>&1); then
  printf 'scikit-fem example: %s has no scikit-fem and h5py\n  %s\n' "$own" "${missing##*$'\n'}" >&2
  printf '  hint: python3 -m venv build/scikit-fem && build/scikit-fem/bin/pip install scikit-fem h5py,\n' >&2
  printf '        or name another Python by SKFEM_PYTHON\n' >&2
  exit 4
fi
penetration_beside "${1:?usage: run.sh OUT}" scikit-fem "$own $here/solid.py"
