#!/usr/bin/env bash
# Penetration with a micromorphic surround that yields, in a folder that run.sh has made.
# Usage: micro.sh OUT STRENGTH [END]
# STRENGTH: strength.json of element tests of the same grains (../02-element-tests); END: 0.02 s.
source "$(dirname "$0")/../head.sh"
out=${1:?usage: micro.sh OUT STRENGTH [END]}
strength=${2:?usage: micro.sh OUT STRENGTH [END]}
out=$(cd "$out" && pwd)
mkdir -p "$out/micro"
cp "$out/grains.nml" "$out/micro"
"$python" "$here/prepare.py" "$out/pressed.h5" "$out/micro" 0 0 deep
"$python" "$here/micro.py" "$out" "$strength" "${3:-0.02}"
(
  cd "$out/micro"
  "$TALUS_BIN/talus-couple" micro.nml --restart=auto
)
"$python" "$here/micro_judge.py" "$out"
