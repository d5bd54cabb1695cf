#!/usr/bin/env bash
# How large must the bed of grains be? A cone in beds of three widths, all of them grains; with grains
# that wake amid a continuum, in zones of three sizes; in rigid boxes of the same three sizes.
# Usage: run.sh OUT [PLACES, default 'a b c d']
source "$(dirname "$0")/../head.sh"
export OMP_WAIT_POLICY=passive
cone=$root/examples/19-deep-cone
mkdir -p "${1:?usage: run.sh OUT}"
cd "$1"
places=${2:-a b c d}

# $1 stage, $2 folder, $3 folder to run in, the rest its command: what has finished is not run again; seconds to cost.csv
stage() {
  local name=$1 top=$PWD
  if [ -e "$name.finished" ]; then return; fi
  say "$name"
  (cd "$2" && "$python" "$root/examples/08-moving-window/cost.py" "$name" "${@:3}")
  if [ "$2" != . ]; then
    cat "$2/cost.csv" >> cost.csv
    rm "$2/cost.csv"
  fi
  touch "$top/$name.finished"
}

# $1 bed, $2 zone, $3 place
opened() { stage "$1_$2_$3" "$1/$2_$3" "$TALUS_BIN/talus-couple" coupled.nml; }

# $1 bed, $2 deck
alone() { stage "$1_$2" "$1" "$TALUS_BIN/talus-dem" "$2.nml" --threads=1; }

stage tile . "$talus" pack tile --count 850 --axes 2e-3 2e-3 2e-3 --spread 0.2 --seed 1 --stress 100 --young 1e7 \
  --making-friction 0.15 --edge 0.036 -o tile.h5
stage column . "$talus" pack column tile.h5 --height 0.07 -o column.h5
echo bed4 > plan
stage tests . "$python" "$cone/prepare.py" tests
stage test . "$TALUS_BIN/talus-dem" test_1.nml --threads=1
for bed in bed4 bed8 bed13; do
  mkdir -p $bed
  echo $bed > $bed/plan
  cp column.h5 test_1_cell.csv $bed
  stage ${bed}_decks $bed "$python" "$cone/prepare.py" beds
done
for bed in bed4 bed8 bed13; do
  opened $bed mid a
  alone $bed whole_a
done
for place in $places; do
  alone bed8 "whole_$place"
  for zone in near mid far; do
    opened bed8 $zone "$place"
    alone bed8 "box_${zone}_$place"
  done
done
"$python" "$here/judge.py" $places
