#!/usr/bin/env bash
# Penetration with overlap: a core of grains in a micropolar surround, beside all grains and a rigid box.
# Usage: run.sh OUT
source "$(dirname "$0")/../head.sh"
out=${1:?usage: run.sh OUT}
mkdir -p "$out"
out=$(cd "$out" && pwd)

# $1 stage, the rest its command, in OUT: what has finished is not run again
stage() {
  local name=$1
  shift
  if [ -e "$out/$name.finished" ]; then return; fi
  say "$name"
  (
    cd "$out"
    "$@"
  )
  touch "$out/$name.finished"
}

fall() {
  "$talus" pack penetration --container wide --seed "${SEED:-1}" --guard-rows 27 -o start.h5
  sed "s/t_end = 0.65/t_end = 0.45/; s/, curve = 'fine'//" "$here/../01-penetration/deposit.nml" >deposit.nml
  "$TALUS_BIN/talus-dem" deposit.nml --threads="$threads" --restart=auto
  "$talus" pack edit soft.h5 --drop-group guard --at-rest -o fallen.h5
}

solver() { "$TALUS_BIN/talus-$1" "$2" --threads="$threads" --restart=auto; }

coupled() {
  sed "0,/threads = 1/s//threads = $threads/" "$here/coupled.nml" >coupled.nml
  "$TALUS_BIN/talus-couple" coupled.nml --restart=auto
}

# the same core in a surround that yields, in a folder of its own
plastic() {
  mkdir -p plastic
  cp "$here"/grains.nml "$here"/plastic*.nml core_pack.h5 surround.h5 plastic
  cd plastic
  sed "0,/threads = 1/s//threads = $threads/" "$here/plastic.nml" >plastic.nml
  "$TALUS_BIN/talus-couple" plastic.nml --restart=auto
}

cp "$here"/*.nml "$out"
stage fall fall
stage press solver dem press.nml
stage prepare "$python" "$here/prepare.py" pressed.h5 .
stage probe solver dem probe.nml
stage coupled coupled
stage plastic plastic
stage rigid solver dem rigid.nml
stage truth solver dem truth.nml
stage cost "$python" "$here/cost.py" .
stage judge "$python" "$here/judge.py" .
