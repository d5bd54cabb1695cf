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

# $1 density, $2 friction while it is compressed, $3 strain at constant volume: a specimen and its tests
tests() {
  test_run "$1" specimen none "s/@FRICTION@/$2/"
  test_run "$1-isotropic" isotropic "$1" 's/x/x/'
  test_run "$1-drained" triaxial "$1" 's/@RATE@/-1.0/' 's/@STRESS@/100.0e3/'
  test_run "$1-volume" volume "$1" "s/0.03/$3/"
}

# the paths that are kept out of the fits, of the dense specimen
kept_out() {
  test_run dense-extension triaxial dense 's/@RATE@/1.0/' 's/@STRESS@/100.0e3/'
  test_run dense-300 isotropic dense 's/0.06/0.03/g' 's/4.0, 1.0/3.0, 3.0/' \
    's/+0.0, +0.03, +0.03/+0.0, +0.02, +0.03/'
  test_run dense-pressure triaxial dense-300 's/@RATE@/-1.0/' 's/@STRESS@/300.0e3/'
}

# $1 test, $2... constants of this test: the word of `talus fit`, with its void ratio in the place of %
named() {
  local file=$1/$1_cell.csv e
  e=$("$python" "$here/voids.py" "$file")
  local own=${2//1%/1${e#0}}
  echo "$file${own:+:${own//%/$e}}"
}

# $1 density, $2 constants of each test, rest: law, name of the fit, words of `talus fit`
fit_density() {
  local kind tests=() out=() density=$1 own=$2 law=$3 name=$4
  shift 4
  for kind in isotropic drained volume; do tests+=("$(named "$density-$kind" "$own")"); done
  if [ "$density" = dense ]; then
    for kind in extension pressure; do out+=("$(named "dense-$kind" "$own")"); done
    out=(--left-out "${out[@]}")
  fi
  "$talus" fit "$here/$law.nml" "${tests[@]}" "$@" "${out[@]}" --out "$name.json" --points "$name" \
    >"$name.txt"
}

# one set of constants for both densities
fit_sanisand() {
  local density kind tests=() out=()
  for density in dense loose; do
    for kind in isotropic drained volume; do
      tests+=("$(named "$density-$kind" void_ratio=%)")
    done
  done
  for kind in extension pressure; do out+=("$(named "dense-$kind" void_ratio=%)"); done
  "$talus" fit "$here/sanisand.nml" "${tests[@]}" --left-out "${out[@]}" --free \
    stiffness_number poisson critical_slope critical_void_ratio critical_line_slope \
    plastic_hardening hardening_void bounding_rate dilatancy dilatancy_rate \
    --bounds poisson=0:0.45 critical_line_slope=0:0.2 hardening_void=0:1.3 bounding_rate=0:20 \
    dilatancy=0:10 dilatancy_rate=0:20 \
    --out sanisand.json --points sanisand >sanisand.txt
}

# one law, by its words; Drucker-Prager and Cam-clay have a set of constants for each density
fit_law() {
  if [ -e "$1.json" ]; then return; fi
  local density=${1#*-}
  case $1 in
    sanisand) fit_sanisand ;;
    drucker-*)
      fit_density "$density" '' drucker "$1" --free young poisson friction_deg dilation_deg \
        --bounds poisson=0:0.45 friction_deg=1:60
      ;;
    clay-*)
      local start=1.0e6
      if [ "$density" = loose ]; then start=1.1e5; fi
      fit_density "$density" specific_volume=1%,preconsolidation=pc clay "$1" --free critical_slope \
        compression_index swelling_index poisson "pc=$start" --bounds poisson=0:0.45
      ;;
  esac
}

everything() {
  if [ ! -e cloud.h5 ]; then
    "$talus" pack cloud --count 500 --box 0.051 0.051 0.051 --axes 2.5e-3 2.0e-3 1.5e-3 --seed 1 \
      --periodic -o cloud.h5
  fi
  printf '%s\n' 'tests dense 0.1 0.03' 'tests loose 0.5 0.008' |
    xargs -P "${JOBS:-$(nproc)}" -L 1 "$here/run.sh" "$out"
  kept_out
  for law in sanisand drucker-dense drucker-loose clay-dense clay-loose; do fit_law "$law"; done
  "$python" "$here/laws.py"
}

out=${1:?usage: run.sh OUT}
mkdir -p "$out"
out=$(cd "$out" && pwd)
cd "$out"
export OMP_NUM_THREADS=1
if [ $# -gt 1 ]; then "${@:2}"; else everything; fi
