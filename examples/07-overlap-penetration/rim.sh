#!/usr/bin/env bash
# A yielding surround with a free rim beside all grains at four places of a bed that nothing was chosen in.
# Usage: [SEED=4] [PRESSURE=1.5e5] rim.sh OUT
source "$(dirname "$0")/../head.sh"
out=${1:?usage: rim.sh OUT}
"$here/run.sh" "$out" soil
out=$(cd "$out" && pwd)
number=0
for place in "0 0" "7 0" "-7 0" "0 7"; do
  number=$((number + 1))
  folder=place-$number
  if [ -e "$out/$folder/finished" ]; then continue; fi
  say "$folder: $place mm"
  # shellcheck disable=SC2086
  "$python" "$here/rim.py" "$out" "$folder" $place
  (
    cd "$out/$folder"
    rm -f cost.csv
    cost="$here/../08-moving-window/cost.py"
    "$python" "$cost" overlap "$TALUS_BIN/talus-couple" plastic.nml >overlap.out
    "$python" "$cost" truth "$TALUS_BIN/talus-dem" truth.nml --threads=1 >truth.out
    touch finished
  )
done
"$python" "$here/rim_judge.py" "$out"
