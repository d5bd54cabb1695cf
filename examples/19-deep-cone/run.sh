#!/usr/bin/env bash
# A cone is pushed into a bed that wakes around it; beside it the whole bed and a rigid box.
# Usage: run.sh OUT [PLACES, default 'a b']
source "$(dirname "$0")/../head.sh"
export OMP_WAIT_POLICY=passive
mkdir -p "${1:?usage: run.sh OUT}"
cd "$1"
places=${2:-a b}

# $1 stage, $2 folder, the rest its command: what has finished is not run again; seconds go to cost.csv
stage() {
  local name=$1 folder=$2 top=$PWD
  shift 2
  if [ -e "$name.finished" ]; then return; fi
  say "$name"
  (cd "$folder" && "$python" "$root/examples/08-moving-window/cost.py" "$name" "$@")
  if [ "$folder" != . ]; then
    cat "$folder/cost.csv" >> cost.csv
    rm "$folder/cost.csv"
  fi
  touch "$top/$name.finished"
}

stage tile . "$talus" pack tile --count 850 --axes 2e-3 2e-3 2e-3 --spread 0.2 --seed 1 --stress 200 --young 1e7 \
  --making-friction 0.15 --edge 0.036 -o tile.h5
stage column . "$talus" pack column tile.h5 --height 0.13 -o column.h5
stage tests . "$python" "$here/prepare.py" tests
for layer in 1 2 3; do stage "test_$layer" . "$TALUS_BIN/talus-dem" "test_$layer.nml" --threads=1; done
stage beds . "$python" "$here/prepare.py" beds
for place in $places; do
  for zone in narrow wide; do
    stage "${zone}_$place" "${zone}_$place" "$TALUS_BIN/talus-couple" coupled.nml
  done
  stage "box_wide_$place" . "$TALUS_BIN/talus-dem" "box_wide_$place.nml" --threads=1
  stage "whole_$place" . "$TALUS_BIN/talus-dem" "whole_$place.nml" --threads=1
done
"$python" "$here/judge.py" $places
