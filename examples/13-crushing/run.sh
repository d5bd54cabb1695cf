#!/usr/bin/env bash
# A bed of breaking spheres is compressed between two plates. Usage: run.sh OUT
source "$(dirname "$0")/../head.sh"
enter "${1:?usage: run.sh OUT}"
say "bed"
"$python" "$here/prepare.py" loose
"$TALUS_BIN/talus-dem" settle.nml --threads=1 > settle.out
say "crushing (two minutes)"
"$python" "$here/prepare.py" crush
"$TALUS_BIN/talus-dem" crush.nml --threads=1 > crush.out
"$python" "$here/judge.py"
"$talus" render crush.h5 --color generation --size 1000 800 -o bed.png
