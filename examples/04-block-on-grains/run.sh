#!/usr/bin/env bash
# A soft block pressed into a bed of free grains.
# Usage: run.sh OUT
source "$(dirname "$0")/../head.sh"
export OMP_WAIT_POLICY=passive

enter "${1:?usage: run.sh OUT}"
"$talus" pack cloud --count 1500 --box 0.14 0.14 0.22 --axes 5e-3 5e-3 5e-3 --spread 0.1 --seed "${SEED:-1}" -o cloud.h5
"$TALUS_BIN/talus-dem" settle.nml
"$python" "$here/prepare.py" .
"$TALUS_BIN/talus-couple" coupled.nml
"$python" "$here/results.py" .
"$talus" plot audit coupled_audit.csv -o audit.png
"$talus" render grains.h5 --solid solid.h5 -o picture.png
