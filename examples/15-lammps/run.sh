#!/usr/bin/env bash
# LAMMPS in the place of talus-dem.
# Usage: run.sh OUT
source "$(dirname "$0")/../head.sh"
system=${LAMMPS_PYTHON:-/usr/bin/python3}
export PYTHONPATH=$root/prepost

if ! missing=$("$system" -c 'import h5py, scipy, lammps; lammps.lammps(cmdargs=["-screen", "none", "-log", "none"])' 2>&1); then
  printf 'LAMMPS example: %s has no lammps, h5py and scipy\n  %s\n' "$system" "${missing##*$'\n'}" >&2
  printf '  hint: apt-get install --no-install-recommends python3-lammps liblammps-dev python3-h5py python3-scipy,\n' >&2
  printf '        or name another Python by LAMMPS_PYTHON\n' >&2
  exit 4
fi

out=${1:?usage: run.sh OUT}
mkdir -p "$out"
cd "$out"
"$python" "$here/prepare.py" .
for run in ball bed friction; do
  for solver in talus-dem lammps; do
    say "$run: $solver"
    mkdir -p "$run/$solver"
    cp "$run"/*.h5 "$here"/*.nml "$here"/*.toml "$run/$solver"
    deck=grains.nml start="threads = 1"
    if [ "$solver" = lammps ]; then
      deck=grains.toml start="launch = 'command', command = '$system $here/grains.py'"
    fi
    [ "$run" = friction ] || sed -i 's/friction = 0.5/friction = 0.0/' "$run/$solver"/grains.*
    sed -i "s|@solver@|$solver|; s|@deck@|$deck|; s|@start@|$start|" "$run/$solver/coupled.nml"
    (cd "$run/$solver" && "$TALUS_BIN/talus-couple" coupled.nml)
  done
done
say "figure and comparison"
"$python" "$here/results.py" .
