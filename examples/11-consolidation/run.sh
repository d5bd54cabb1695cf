#!/usr/bin/env bash
# A saturated column consolidates: of grains, of elements, and half of each, grains below or above.
# Usage: run.sh OUT
source "$(dirname "$0")/../head.sh"
mkdir -p "${1:?usage: run.sh OUT}"
cd "$1"
say "packings, meshes, decks"
"$python" "$here/prepare.py"
say "grains"
"$TALUS_BIN/talus-dem" grains_grains.nml --threads=1
say "elements"
"$TALUS_BIN/talus-fem" elements_solid.nml
for name in below above; do
  say "half and half, grains $name"
  "$TALUS_BIN/talus-couple" "$name.nml"
done
"$python" "$here/show.py"
