#!/usr/bin/env bash
# A wave from a column of grains through an overlap into continuum.
# Usage: run.sh OUT
# TALUS (default build/venv/bin/talus) and TALUS_BIN (default build/bin) name the tools.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
export TALUS_BIN=${TALUS_BIN:-$root/build/bin}
talus=${TALUS:-$root/build/venv/bin/talus}
python=$root/build/venv/bin/python

out=${1:?usage: run.sh OUT}
mkdir -p "$out"
cd "$out"
cp "$here"/*.nml .
"$python" "$here/column.py" .
OMP_NUM_THREADS=1 OMP_WAIT_POLICY=passive "$TALUS_BIN/talus-couple" coupled.nml
"$talus" plot profile grains.h5 solid.h5 -o wave.png
"$talus" plot audit coupled_audit.csv -o audit.png
"$talus" render grains.h5 --solid solid.h5 --sets coupled_sets.h5 -o sets.png \
  || echo 'no picture of the sets: it needs pyvista (make deps-render)'
