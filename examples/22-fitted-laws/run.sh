#!/usr/bin/env bash
# Element tests of one pack at two densities, and three laws that are fitted to them. Usage: run.sh OUT
# JOBS pieces at a time (default: as many as there are processors); what has finished is not run again.
source "$(dirname "$0")/../head.sh"
later=$here/../02-element-tests/later.py

# $1 folder, $2 deck, $3 what it goes on from (a folder beside it) or none, $4... words of sed
test_run() {
  local folder=$1 deck=$2 from=$3 word words=() start=()
  shift 3
  if [ -e "$folder/finished" ]; then return; fi
  mkdir -p "$folder"
  cp cloud.h5 "$folder"
  for word in "$@"; do words+=(-e "$word"); done
  (
    sed "${words[@]}" "$here/$deck.nml" >"$folder/$folder.nml"
    cd "$folder"
    if [ "$from" != none ]; then
      "$python" "$later" "$folder.nml" "../$from/${from}_summary.json" >later.nml
      mv later.nml "$folder.nml"
      start=("--restart=../$from/$from.chk.h5")
    fi
    "$TALUS_BIN/talus-dem" "$folder.nml" --threads=1 "${start[@]}"
  ) >"$folder.out" 2>&1
  touch "$folder/finished"
}

# $1 density, $2 friction while it is compressed: the specimen, and the tests of both densities
tests() {
  test_run "$1" specimen none "s/@FRICTION@/$2/"
  test_run "$1-isotropic" isotropic "$1" 's/x/x/'
  test_run "$1-drained" triaxial "$1" 's/@RATE@/-1.0/' 's/@STRESS@/100.0e3/'
  test_run "$1-volume" volume "$1" 's/x/x/'
}

# the paths that are kept out of the fits, of the dense specimen
kept_out() {
  test_run dense-extension triaxial dense 's/@RATE@/1.0/' 's/@STRESS@/100.0e3/'
  test_run dense-300 isotropic dense 's/0.06/0.03/g' 's/4.0, 1.0/3.0, 3.0/' 's/+0.0, +0.03, +0.03/+0.0, +0.02, +0.03/'
  test_run dense-pressure triaxial dense-300 's/@RATE@/-1.0/' 's/@STRESS@/300.0e3/'
}

everything() {
  if [ ! -e cloud.h5 ]; then
    "$talus" pack cloud --count 500 --box 0.051 0.051 0.051 --axes 2.5e-3 2.0e-3 1.5e-3 --seed 1 \
      --periodic -o cloud.h5
  fi
  printf '%s\n' 'tests dense 0.1' 'tests loose 0.5' |
    xargs -P "${JOBS:-$(nproc)}" -L 1 "$here/run.sh" "$out"
  kept_out
  "$python" "$here/laws.py" "$here"
}

out=${1:?usage: run.sh OUT}
mkdir -p "$out"
out=$(cd "$out" && pwd)
cd "$out"
export OMP_NUM_THREADS=1
if [ $# -gt 1 ]; then "${@:2}"; else everything; fi
