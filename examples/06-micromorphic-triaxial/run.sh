#!/usr/bin/env bash
# Triaxial compression of a micromorphic solid: one element, and a specimen between rough plates.
# Usage: run.sh OUT
# TALUS (default build/venv/bin/talus) and TALUS_BIN (default build/bin) name the tools.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
export TALUS_BIN=${TALUS_BIN:-$root/build/bin}
talus=${TALUS:-$root/build/venv/bin/talus}
python=$root/build/venv/bin/python
export OMP_WAIT_POLICY=passive

out=${1:?usage: run.sh OUT}
mkdir -p "$out"
cp "$here"/*.nml "$out"
cd "$out"
"$talus" mesh box --upper 0.05 0.05 0.1 --cells 1 1 1 --kind hex20 -o one_mesh.h5
"$talus" mesh box --upper 0.05 0.05 0.1 --cells 2 2 4 --kind hex20 -o specimen_mesh.h5
"$TALUS_BIN/talus-fem" one.nml
"$TALUS_BIN/talus-fem" specimen.nml
"$talus" plot energy specimen_energy.csv -o energy.png
"$python" "$here/results.py" .
