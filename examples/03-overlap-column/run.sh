#!/usr/bin/env bash
# A wave from a column of grains through an overlap into continuum.
# Usage: run.sh OUT
source "$(dirname "$0")/../head.sh"

enter "${1:?usage: run.sh OUT}"
"$python" "$here/column.py" .
OMP_NUM_THREADS=1 OMP_WAIT_POLICY=passive "$TALUS_BIN/talus-couple" coupled.nml
"$talus" plot profile grains.h5 solid.h5 -o wave.png
"$talus" plot audit coupled_audit.csv -o audit.png
"$talus" render grains.h5 --solid solid.h5 --sets coupled_sets.h5 -o sets.png \
  || echo 'no picture of the sets: it needs pyvista (make deps-render)'
