#!/usr/bin/env bash
# A bed of 1000 spheres that crush (example 13), and the law `breakage` that is fitted to it. Usage:
# crushing.sh OUT. Two seeds of the strengths: one is fitted, the other is left out.
source "$(dirname "$0")/../head.sh"
crushing=$here/../13-crushing
mkdir -p "${1:?usage: crushing.sh OUT}"
cd "$1"
export OMP_NUM_THREADS=1
stiff=("18.75e9=70.0e9" "50.0e-3, 50.0e-3=22.36e-3, 22.36e-3")
if [ ! -e bed.h5 ]; then
  "$python" "$crushing/beds.py" loose spheres 1 narrow "${stiff[@]}" "2.5e-3=5.0e-4"
  "$TALUS_BIN/talus-dem" deposit.nml --threads=1 >deposit.out
fi

# $1 seed of the strengths: the plate closes a fifth of the height
crush() {
  local folder=seed-$1
  if [ -e "$folder/bed-$1.csv" ]; then return; fi
  mkdir -p "$folder"
  cp bed.h5 deposit_walls.csv "$folder"
  (
    cd "$folder"
    "$python" "$crushing/beds.py" compress compress "@SEED@=$1" "@MODULUS@=3.0" "@SPEED@=0.5" \
      "CLOSING=0.2" "1.0e-5=2.0e-5" "${stiff[@]}"
    "$TALUS_BIN/talus-dem" compress.nml --threads=1 >compress.out
    "$python" "$here/crushed.py" "bed-$1.csv"
  )
}
crush 1 &
crush 2
wait
common=("$here/breakage.nml" seed-1/bed-1.csv --grading seed-1/compress_grading.csv
  --bounds breakage_angle_deg=0:89.9 --left-out seed-2/bed-2.csv)
"$talus" fit "${common[@]}" --free breakage_angle_deg --out angle.json --points angle >angle.txt
"$talus" fit "${common[@]}" --free breakage_energy breakage_angle_deg --out both.json \
  --points both --deck fitted.nml >both.txt
"$python" "$here/crushing.py" "$here/breakage.nml"
