#!/usr/bin/env bash
# The penetration benchmark.
# Usage: run.sh demo OUT | deposit OUT [small|medium|large] | penetration OUT
# TALUS (default build/venv/bin/talus) and TALUS_BIN (default build/bin) name the tools.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
export TALUS_BIN=${TALUS_BIN:-$root/build/bin}
talus=${TALUS:-$root/build/venv/bin/talus}
threads=${OMP_NUM_THREADS:-$(nproc)}
mode="literal mode: mass scale 10, damping 2/dt, no gravity, 0.25 m/s"

say() { printf '\n== %s\n' "$*"; }

fresh() { mkdir -p "$1" && cp "$here"/*.nml "$1"; }

# $1 folder, $2 container: let the bed fall with E/100, restore E, bring it to rest
deposit() {
  fresh "$1"
  say "deposit of the $2 container (three runs)"
  (
    cd "$1"
    "$talus" pack penetration --container "$2" --seed "${SEED:-1}" --guard-rows 27 -o start.h5
    "$TALUS_BIN/talus-dem" deposit.nml --threads="$threads"
    "$talus" pack edit soft.h5 --drop-group guard --at-rest -o soft_open.h5
    "$TALUS_BIN/talus-dem" restore.nml --threads="$threads"
    "$TALUS_BIN/talus-dem" settle.nml --threads="$threads"
  )
}

# $1 folder, $2 deposit: the packings of the rigid and the coupled run
packings() {
  (
    cd "$1"
    "$talus" pack edit "$2" --at-rest --tool -o rigid_pack.h5
    "$talus" pack edit "$2" --at-rest --tool --drop-container-above 0.061 -o coupled_pack.h5
  )
}

rigid() { (cd "$1" && "$TALUS_BIN/talus-dem" rigid.nml --threads="$threads"); }

# $1 folder: threads of the grains as the machine has them
coupled() {
  sed -i "s/threads = 2/threads = $threads/" "$1/coupled.nml"
  (cd "$1" && "$TALUS_BIN/talus-couple" coupled.nml)
}

demo() {
  local out=$1
  fresh "$out"
  say "packings and mesh"
  packings "$out" "$here/deposit_small.txt"
  (cd "$out" && "$talus" mesh block -o block.h5)
  say "rigid container"
  rigid "$out"
  say "coupled: grains in an elastic block"
  coupled "$out"
  say "figures"
  (
    cd "$out"
    "$talus" plot force rigid_driven.csv=rigid grains_driven.csv="coupled, 50 MPa" \
      -o force_penetration.png --csv force_penetration.csv --title "Small container, $mode"
    "$talus" plot ghosts grains.h5 -o ghost_displacement.png
    "$talus" plot energy grains_energy.csv -o energy.png
    "$talus" plot audit coupled_audit.csv -o audit.png
    "$talus" render grains.h5 --solid solid.h5 -o view3d.png
    "$talus" report . -o report.html
  )
  say "results"
  printf '  %s\n' "$out/report.html" "$out/force_penetration.csv" "$out/force_penetration.png" \
    "$out/ghost_displacement.png" "$out/view3d.png" "$out/energy.png" "$out"/*_summary.json
}

# three containers rigid, then the small one in blocks of falling modulus on two meshes
penetration() {
  local out=$1 container young size folder curves=()
  for container in small medium large; do
    folder=$out/rigid_$container
    if [ "$container" = small ]; then
      fresh "$folder"
      packings "$folder" "$here/deposit_small.txt"
    else
      deposit "$folder" "$container"
      packings "$folder" deposit.h5
    fi
    say "rigid $container container"
    rigid "$folder"
    curves+=("$folder/rigid_driven.csv=$container")
  done
  "$talus" plot force "${curves[@]}" -o "$out/containers.png" --csv "$out/containers.csv" --title "Rigid, $mode"
  curves=("$out/rigid_small/rigid_driven.csv=rigid")
  for size in 0.010 0.007; do
    for young in 1.0e9 100.0e6 10.0e6 1.0e6; do
      folder=$out/coupled_${young}_$size
      fresh "$folder"
      packings "$folder" "$here/deposit_small.txt"
      (cd "$folder" && "$talus" mesh block --size "$size" -o block.h5)
      sed -i "s/young = 50.0e6/young = $young/" "$folder/solid.nml"
      say "coupled, E = $young Pa, elements of $size m"
      coupled "$folder"
      "$talus" plot ghosts "$folder/grains.h5" -o "$out/ghosts_${young}_$size.png"
      [ "$size" = 0.010 ] && curves+=("$folder/grains_driven.csv=$young Pa")
    done
  done
  "$talus" plot force "${curves[@]}" -o "$out/moduli.png" --csv "$out/moduli.csv" --title "Coupled, $mode"
  "$root/build/venv/bin/python" "$here/judge.py" "$out/containers.csv" "$out/moduli.csv"
}

out=${2:?usage: run.sh demo|deposit|penetration OUT}
mkdir -p "$out"
out=$(cd "$out" && pwd)
case "${1:-}" in
  demo) demo "$out" ;;
  deposit)
    deposit "$out" "${3:-small}"
    "$talus" compare "$here/deposit_small.txt" "$out/deposit.h5"
    ;;
  penetration) penetration "$out" ;;
  *)
    echo "usage: run.sh demo|deposit|penetration OUT" >&2
    exit 1
    ;;
esac
