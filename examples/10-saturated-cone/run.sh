#!/usr/bin/env bash
# A cone goes into saturated grains, drained to undrained at one speed, dense and loose; beside it dry and sealed runs.
# Usage: run.sh OUT [SEEDS, default '1']
source "$(dirname "$0")/../head.sh"
mkdir -p "${1:?usage: run.sh OUT}"
cd "$1"
seeds=${2:-1}

# $1 stage, the rest its command: what has finished is not run again; seconds go to cost.csv
stage() {
  if [ -e "$1.finished" ]; then return; fi
  say "$1"
  "$python" "$root/examples/08-moving-window/cost.py" "$@"
  touch "$1.finished"
}

# $1 deck
alone() { stage "$1" "$TALUS_BIN/talus-dem" "$1.nml" --threads=1; }

for seed in $seeds; do
  stage "cloud_$seed" "$python" "$here/prepare.py" cloud "$seed"
  for name in "dense_$seed" "loose_$seed"; do
    alone "${name}_press"
    stage "${name}_deck" "$python" "$here/prepare.py" settle "$name"
    alone "${name}_settle"
    stage "${name}_decks" "$python" "$here/prepare.py" elements "$name"
    alone "${name}_oedometer"
    alone "${name}_shear"
    stage "${name}_pushes" "$python" "$here/prepare.py" pushes "$name"
  done
done
for seed in $seeds; do
  for kind in dry sealed cavitated v3 v0.01 v1000; do
    for density in dense loose; do alone "${density}_${seed}_$kind"; done
  done
done
"$python" "$here/judge.py" $seeds
