#!/usr/bin/env bash
# The penetration benchmark.
# Usage: run.sh demo OUT | deposit OUT [small|medium|large|wide] | penetration OUT
source "$(dirname "$0")/../head.sh"
mode="literal mode: mass scale 10, damping 2/dt, no gravity, 0.25 m/s
(dt 5e-6 s; half of it multiplies the force by 1.6 to 1.9)"

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
  # the first 10 mm; `penetration` goes to 62 mm
  sed -i 's/t_end = 0.25/t_end = 0.04/; s/every_time = 0.025/every_time = 0.01/' "$out"/{rigid,coupled,grains,solid}.nml
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

# a piece of the benchmark that is finished is not run again
finished() { [ -e "$1/finished" ]; }

# $1 OUT, $2 container, $3 seed: the deposit; seed 1 of the small container ships with the example
make_deposit() {
  local folder=$1/deposit_$2_$3
  if finished "$folder" || [ "$2_$3" = small_1 ]; then return; fi
  SEED=$3 deposit "$folder" "$2" >"$folder.out" 2>&1
  touch "$folder/finished"
}

# $1 OUT, $2 container, $3 seed: its deposit's packing
deposit_of() {
  if [ "$2_$3" = small_1 ]; then
    echo "$here/deposit_small.txt"
  else
    echo "$1/deposit_$2_$3/deposit.h5"
  fi
}

# $1 OUT, $2 container, $3 seed: the rigid container
rigid_piece() {
  local folder=$1/rigid_$2_$3
  if finished "$folder"; then return; fi
  make_deposit "$1" "$2" "$3"
  fresh "$folder"
  packings "$folder" "$(deposit_of "$1" "$2" "$3")" >"$folder.out" 2>&1
  rigid "$folder" >>"$folder.out" 2>&1
  touch "$folder/finished"
}

# $1 OUT, $2 modulus [Pa], $3 element size [m]: the small container in an elastic block
coupled_piece() {
  local folder=$1/coupled_$2_$3
  if finished "$folder"; then return; fi
  fresh "$folder"
  packings "$folder" "$here/deposit_small.txt" >"$folder.out" 2>&1
  (cd "$folder" && "$talus" mesh block --size "$3" -o block.h5) >>"$folder.out" 2>&1
  sed -i "s/young = 50.0e6/young = $2/" "$folder/solid.nml"
  coupled "$folder" >>"$folder.out" 2>&1
  "$talus" plot ghosts "$folder/grains.h5" -o "$1/ghosts_$2_$3.png" >>"$folder.out" 2>&1
  touch "$folder/finished"
}

# one piece by its words, so that pieces can run beside each other
piece() {
  say "$*"
  case "$1" in
    rigid) rigid_piece "$out" "$2" "$3" ;;
    coupled) coupled_piece "$out" "$2" "$3" ;;
  esac
}

# three containers rigid, three seeds; the small one in blocks of falling modulus on two meshes. One
# thread a piece, as many pieces as there are cores. SEEDS, MODULI, FINE_MODULI ask for other sets.
penetration() {
  local container seed young
  {
    for young in ${MODULI:-1.0e9 100.0e6 10.0e6 1.0e6}; do echo "coupled $young 0.010"; done
    for seed in ${SEEDS:-1 2 3}; do
      for container in small medium large; do echo "rigid $container $seed"; done
    done
    for young in ${FINE_MODULI:-1.0e9 100.0e6 10.0e6 1.0e6}; do echo "coupled $young 0.007"; done
  } | OMP_NUM_THREADS=1 OMP_WAIT_POLICY=passive \
    xargs -P "$(nproc)" -L 1 "$here/run.sh" piece "$out" \
    || say "some pieces failed: see $out/*.out; the same command runs them again"
  "$root/build/venv/bin/python" "$here/judge.py" "$out"
}

out=${2:?usage: run.sh demo|deposit|penetration OUT}
mkdir -p "$out"
out=$(cd "$out" && pwd)
case "${1:-}" in
  demo) demo "$out" ;;
  deposit)
    deposit "$out" "${3:-small}"
    if [ "${3:-small}" = small ]; then
      "$talus" compare "$here/deposit_small.txt" "$out/deposit.h5"
    else
      "$talus" measure "$out/deposit.h5"
    fi
    ;;
  penetration) penetration ;;
  piece) piece "${@:3}" ;;
  *)
    echo "usage: run.sh demo|deposit|penetration OUT" >&2
    exit 1
    ;;
esac
