#!/usr/bin/env bash
# Penetration with overlap: a core of grains in a micropolar surround, beside all grains and a rigid box.
# Usage: run.sh OUT [LAST]
# LAST: the last stage, judge by default. SEED and PRESSURE (in pascals, 1.0e5) are those of the bed.
source "$(dirname "$0")/../head.sh"
out=${1:?usage: run.sh OUT [LAST]}
last=${2:-judge}
mkdir -p "$out"
out=$(cd "$out" && pwd)

# $1 stage, the rest its command, in OUT: what has finished is not run again
stage() {
  local name=$1
  shift
  if [ ! -e "$out/$name.finished" ]; then
    say "$name"
    (
      cd "$out"
      "$@"
    )
    touch "$out/$name.finished"
  fi
  if [ "$name" = "$last" ]; then exit 0; fi
}

fall() {
  "$talus" pack penetration --container wide --seed "${SEED:-1}" --guard-rows 27 -o start.h5
  sed "s/t_end = 0.65/t_end = 0.45/; s/, curve = 'fine'//" "$here/../01-penetration/deposit.nml" >deposit.nml
  "$TALUS_BIN/talus-dem" deposit.nml --threads="$threads" --restart=auto
  "$talus" pack edit soft.h5 --drop-group guard --at-rest -o fallen.h5
}

solver() { "$TALUS_BIN/talus-$1" "$2" --threads="$threads" --restart=auto; }

coupled() {
  sed -i "0,/threads = 1/s//threads = $threads/" coupled.nml
  "$TALUS_BIN/talus-couple" coupled.nml --restart=auto
}

# constants of the surround: a sample of the bed is shortened sideways
soil() {
  "$python" "$here/soil.py" sample .
  "$TALUS_BIN/talus-dem" sample.nml --threads="$threads"
  "$python" "$here/soil.py" shear .
  "$TALUS_BIN/talus-dem" shear.nml --threads="$threads" --restart=sample.chk.h5
  "$python" "$here/soil.py" fit .
}

# $1 chord or plastic: fewer ghosts in a surround of the element test's constants, in a folder of its own
tested() {
  cp grains.nml surround.h5 "$1"
  cp near_pack.h5 "$1/core_pack.h5"
  cd "$1"
  sed "0,/threads = 1/s//threads = $threads/" "../$1.nml" >"$1.nml"
  "$TALUS_BIN/talus-couple" "$1.nml" --restart=auto
}

# the chord with free grains to 30 mm
wide() {
  "$python" "$here/wide.py" .
  cd wide
  sed -i "0,/threads = 1/s//threads = $threads/" chord.nml
  "$TALUS_BIN/talus-couple" chord.nml --restart=auto
}

cp "$here"/*.nml "$out"
sed -i "s/1\.0e5/${PRESSURE:-1.0e5}/" "$out"/*.nml
stage fall fall
stage press solver dem press.nml
stage prepare "$python" "$here/prepare.py" pressed.h5 .
stage probe solver dem probe.nml
stage soil soil
stage coupled coupled
stage chord tested chord
stage plastic tested plastic
stage wide wide
stage rigid solver dem rigid.nml
stage truth solver dem truth.nml
stage motion "$python" "$here/motion.py" .
stage cost "$python" "$here/cost.py" .
stage judge "$python" "$here/judge.py" .
