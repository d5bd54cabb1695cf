#!/usr/bin/env bash
# A soft block pressed into a bed of free grains.
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
"$talus" pack cloud --count 1500 --box 0.14 0.14 0.22 --axes 5e-3 5e-3 5e-3 --spread 0.1 --seed "${SEED:-1}" -o cloud.h5
"$TALUS_BIN/talus-dem" settle.nml
"$python" "$here/prepare.py" .
"$TALUS_BIN/talus-couple" coupled.nml
"$python" "$here/results.py" .
"$talus" plot audit coupled_audit.csv -o audit.png
"$talus" render grains.h5 --solid solid.h5 -o picture.png
