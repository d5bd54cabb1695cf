#!/usr/bin/env bash
# A bed of spheres goes quick under a block that stands on it; a film of it.
# Usage: run.sh OUT
source "$(dirname "$0")/../head.sh"
mkdir -p "${1:?usage: run.sh OUT}"
cd "$1"
cp "$here/settle.nml" .
say "bed"
"$python" "$here/prepare.py" cloud
"$TALUS_BIN/talus-dem" settle.nml --threads=1
"$python" "$here/prepare.py" deck
say "flow"
"$TALUS_BIN/talus-dem" quick.nml --threads=1
say "film"
"$talus" render quick.h5 --every 2 --size 480 560 -o film.gif
"$talus" render quick.h5 --every 10 --size 480 560 -o film.png
"$python" "$here/show.py"
