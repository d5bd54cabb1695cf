#!/usr/bin/env bash
# Triaxial compression of a micromorphic solid: one element, and a specimen between rough plates.
# Usage: run.sh OUT
source "$(dirname "$0")/../head.sh"
export OMP_WAIT_POLICY=passive

enter "${1:?usage: run.sh OUT}"
"$talus" mesh box --upper 0.05 0.05 0.1 --cells 1 1 1 --kind hex20 -o one_mesh.h5
"$talus" mesh box --upper 0.05 0.05 0.1 --cells 2 2 4 --kind hex20 -o specimen_mesh.h5
"$TALUS_BIN/talus-fem" one.nml
"$TALUS_BIN/talus-fem" specimen.nml
"$talus" plot energy specimen_energy.csv -o energy.png
"$python" "$here/results.py" .
