#!/usr/bin/env bash
# Blades that are pushed through a bed, and a bucket that digs on an arc; beside them what textbooks give.
# Usage: run.sh OUT [PLACES, default 'a b']
source "$(dirname "$0")/../head.sh"
export OMP_WAIT_POLICY=passive
mkdir -p "${1:?usage: run.sh OUT}"
cd "$1"
places=${2:-a b}

# $1 stage, the rest its command: what has finished is not run again; seconds of the processors go to cost.csv
stage() {
  local name=$1
  shift
  if [ -e "$name.finished" ]; then return; fi
  say "$name"
  "$python" "$root/examples/08-moving-window/cost.py" "$name" "$@"
  touch "$name.finished"
}

stage tile "$talus" pack tile --count 850 --axes 2e-3 2e-3 2e-3 --spread 0.2 --seed 1 --stress 100 --young 1e7 \
  --making-friction 0.15 --edge 0.036 -o tile.h5
stage column "$talus" pack column tile.h5 --height 0.05 -o column.h5
stage plan "$python" "$here/prepare.py" test
stage test "$TALUS_BIN/talus-dem" test.nml --threads=1
stage beds "$python" "$here/prepare.py" beds
for place in $places; do
  stage "bucket_$place" "$TALUS_BIN/talus-dem" "bucket_$place.nml" --threads=1
  for depth in 10 15 20; do
    stage "blade_${depth}_$place" "$TALUS_BIN/talus-dem" "blade_${depth}_$place.nml" --threads=1
  done
done
[ -e bucket.png ] || "$talus" render bucket_${places%% *}.h5 --step 22 --color speed -o bucket.png
"$python" "$here/judge.py" $places
