#!/usr/bin/env bash
# Beds of 5000 spheres and ellipsoids are compressed, and met by a cone. Usage: study.sh OUT
# A quarter of an hour of one core for all; the runs of a shape do not depend on each other.
source "$(dirname "$0")/../head.sh"
enter "${1:?usage: study.sh OUT}"
crush() { # SHAPE SEED MODULUS
  local run="$1/s$2-m$3"
  mkdir -p "$run"
  cp "$1"/{bed.h5,deposit_walls.csv} "$run"
  cd "$run"
  "$python" "$here/beds.py" compress compress "@SEED@=$2" "@MODULUS@=$3"
  # an overlap beyond its limit ends a run early: what came before counts
  "$TALUS_BIN/talus-dem" compress.nml --threads=1 > compress.out || true
  cd - > /dev/null
}
for shape in spheres ellipsoids; do
  say "bed of $shape"
  mkdir -p "$shape"
  cd "$shape"
  "$python" "$here/beds.py" loose "$shape" 1
  "$TALUS_BIN/talus-dem" deposit.nml --threads=1 > deposit.out
  cd - > /dev/null
  say "crushing $shape, three seeds"
  for seed in 1 2 3; do crush "$shape" "$seed" 3.0; done
done
say "crushing spheres, two other moduli"
crush spheres 1 1.5
crush spheres 1 6.0
say "cone"
weak="&breakage material = 'sand', strength = 30.0e6, size = 2.0e-3, modulus = 3.0, smallest = 0.4e-3, fragment_mass = 'scaled', check_every = 50 /"
for kind in whole breaking; do
  mkdir -p "cone-$kind"
  cp spheres/{bed.h5,deposit_walls.csv} "cone-$kind"
  cd "cone-$kind"
  "$python" "$here/beds.py" penetrate penetrate "BREAKAGE=$([ "$kind" = breaking ] && echo "$weak")"
  "$TALUS_BIN/talus-dem" penetrate.nml --threads=1 > penetrate.out || true
  cd - > /dev/null
done
"$python" "$here/study.py"
