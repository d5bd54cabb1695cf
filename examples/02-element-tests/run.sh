#!/usr/bin/env bash
# Element tests of a pack of ellipsoids, between six walls and in a periodic cell.
# Usage: run.sh OUT
# SEEDS (default 1 2 3 4 5) asks for other specimens of the drained test, JOBS for pieces at a time.
source "$(dirname "$0")/../head.sh"

finished() { [[ -e $1/finished ]]; }

# $1 folder, $2 seed, $3 friction while it is compressed, $4 deck: the specimen at 100 kPa
specimen() {
  if finished "$1"; then return; fi
  mkdir -p "$1"
  (
    cd "$1"
    local periodic=()
    if [ "$4" = cell_isotropic ]; then periodic=(--periodic); fi
    "$talus" pack cloud --count 1000 --box 0.066 0.066 0.066 --axes 2.5e-3 2.0e-3 1.5e-3 \
      --seed "$2" "${periodic[@]}" -o cloud.h5
    sed "s/friction = 0.1/friction = $3/" "$here/$4.nml" >"$4.nml"
    "$TALUS_BIN/talus-dem" "$4.nml" --threads=1
  ) >"$1.out" 2>&1
  touch "$1/finished"
}

# $1 folder of the specimen, $2 deck, $3 deck of the specimen: a test that goes on from its checkpoint
go_on() {
  if finished "$1/$2"; then return; fi
  mkdir -p "$1/$2"
  (
    cp "$1/cloud.h5" "$1/$2"
    cd "$1/$2"
    "$python" "$here/later.py" "$here/$2.nml" "../$3_summary.json" >"$2.nml"
    "$TALUS_BIN/talus-dem" "$2.nml" --threads=1 --restart="../$3.chk.h5"
  ) >"$1/$2.out" 2>&1
  touch "$1/$2/finished"
}

# one piece by its words, so that pieces can run beside each other: seed, friction, deck of the
# specimen, decks
piece() {
  local folder=$out/seed$2_mu$3 deck
  if [ "$4" = cell_isotropic ]; then folder=$out/cell_seed$2_mu$3; fi
  printf '\n== %s\n' "$*"
  specimen "$folder" "$2" "$3" "$4"
  for deck in "${@:5}"; do go_on "$folder" "$deck" "$4"; done
}

everything() {
  local seed more=' undrained compression k0' still=' cell_probe cell_undrained cell_compression cell_k0 cell_shear'
  {
    for seed in ${SEEDS:-1 2 3 4 5}; do
      echo "$seed 0.1 isotropic drained$more"
      echo "$seed 0.1 cell_isotropic cell_drained$still"
      more=''
      still=''
    done
    echo "${SEEDS:-1}" | awk '{print $1, "0.5 isotropic drained undrained"}'
  } | OMP_NUM_THREADS=1 OMP_WAIT_POLICY=passive \
    xargs -P "${JOBS:-$(nproc)}" -L 1 "$here/run.sh" "$out" piece \
    || echo "some pieces failed: see $out/*.out; the same command runs them again"
  "$python" "$here/judge.py" "$out"
}

out=${1:?usage: run.sh OUT}
mkdir -p "$out"
out=$(cd "$out" && pwd)
case "${2:-}" in
  '') everything ;;
  piece) piece "${@:2}" ;;
  *)
    echo "usage: run.sh OUT" >&2
    exit 1
    ;;
esac
