#!/usr/bin/env bash
# scikit-fem in the place of talus-fem, in the penetration of example 14.
# Usage: run.sh OUT
source "$(dirname "$0")/../head.sh"
own=${SKFEM_PYTHON:-$root/build/scikit-fem/bin/python}
decks=$here/../14-fenicsx
export PYTHONPATH=$root/prepost

if ! missing=$("$own" -c 'import skfem, h5py' 2>&1); then
  printf 'scikit-fem example: %s has no scikit-fem and h5py\n  %s\n' "$own" "${missing##*$'\n'}" >&2
  printf '  hint: python3 -m venv build/scikit-fem && build/scikit-fem/bin/pip install scikit-fem h5py,\n' >&2
  printf '        or name another Python by SKFEM_PYTHON\n' >&2
  exit 4
fi

out=${1:?usage: run.sh OUT}
mkdir -p "$out"/{talus-fem,scikit-fem}
cd "$out"
"$talus" mesh block -o block.h5
"$talus" pack edit "$here/../01-penetration/deposit_small.txt" --at-rest --tool \
  --drop-container-above 0.061 -o pack.h5
for solver in talus-fem scikit-fem; do
  say "$solver"
  cp block.h5 pack.h5 "$decks"/{coupled.nml,grains.nml,solid.nml,block.toml} "$solver"
  deck=solid.nml start="threads = 1"
  if [ "$solver" = scikit-fem ]; then
    deck=block.toml start="launch = 'command', command = '$own $here/solid.py'"
  fi
  sed -i "s|@solver@|$solver|; s|@deck@|$deck|; s|@start@|$start|" "$solver/coupled.nml"
  (cd "$solver" && "$TALUS_BIN/talus-couple" coupled.nml)
done
say "figure and comparison"
"$python" "$here/results.py" .
