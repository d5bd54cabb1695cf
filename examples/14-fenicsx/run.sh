#!/usr/bin/env bash
# FEniCSx in the place of talus-fem.
# Usage: run.sh OUT
source "$(dirname "$0")/../head.sh"
system=${FENICSX_PYTHON:-/usr/bin/python3}
export PYTHONPATH=$root/prepost FENICSX_PYTHON=$system

if ! missing=$("$system" -c 'import dolfinx, h5py, scipy' 2>&1); then
  printf 'FEniCSx example: %s has no dolfinx, h5py and scipy\n  %s\n' "$system" "${missing##*$'\n'}" >&2
  printf '  hint: apt-get install --no-install-recommends python3-dolfinx python3-h5py python3-scipy,\n' >&2
  printf '        or name another Python by FENICSX_PYTHON\n' >&2
  exit 4
fi

# $1 folder $2 coupled deck $3 deck of talus-fem, $4 of FEniCSx: the run with both solvers
both() {
  local solver start deck
  for solver in talus-fem fenicsx; do
    say "$1: $solver"
    mkdir -p "$1/$solver"
    cp "$1"/*.* "$1/$solver"
    deck=$3 start="threads = $threads"
    if [ "$solver" = fenicsx ]; then
      deck=$4 start="launch = 'command', command = '$system $here/solid.py'"
    fi
    sed -i "s|@solver@|$solver|; s|@deck@|$deck|; s|@start@|$start|" "$1/$solver/$2"
    (cd "$1/$solver" && "$TALUS_BIN/talus-couple" "$2")
  done
}

out=${1:?usage: run.sh OUT}
mkdir -p "$out"/{penetration,hookean,bed}
cp "$here"/{coupled.nml,grains.nml,solid.nml,block.toml} "$out/penetration"
cp "$here"/{coupled.nml,grains.nml,solid.nml,block.toml} "$out/hookean"
cp "$here"/bed_* "$out/bed"
cd "$out"
"$talus" mesh block -o penetration/block.h5
"$talus" mesh block --size 20e-3 -o hookean/block.h5
for run in penetration hookean; do
  "$talus" pack edit "$here/../01-penetration/deposit_small.txt" --at-rest --tool \
    --drop-container-above 0.061 -o $run/pack.h5
done
sed -i 's/linear_elastic/neo_hookean/' hookean/solid.nml
sed -i 's/"elastic"  /"neo_hookean"/' hookean/block.toml
sed -i 's/t_end = 0.1/t_end = 0.02/' hookean/coupled.nml
"$python" "$here/prepare.py" bed

say "the same load on both solvers"
"$python" "$here/same_load.py" penetration
both penetration coupled.nml solid.nml block.toml
both hookean coupled.nml solid.nml block.toml
both bed bed_coupled.nml bed_solid.nml bed_block.toml
say "figures and comparison"
"$python" "$here/results.py" .
