#!/usr/bin/env bash
# A bed of 1000 stiff spheres under a slow plate, and with fragments that grow. Usage: slow.sh OUT
# Some twenty minutes of one core for all; the runs do not depend on each other.
source "$(dirname "$0")/../head.sh"
enter "${1:?usage: slow.sh OUT}"
stiff=("18.75e9=70.0e9" "50.0e-3, 50.0e-3=22.36e-3, 22.36e-3")
crush() { # NAME SPEED SEED CLOSING [MORE WORDS OF BREAKAGE]
  mkdir -p "$1"
  cp bed.h5 deposit_walls.csv "$1"
  cd "$1"
  "$python" "$here/beds.py" compress compress "@SEED@=$3" "@MODULUS@=3.0" "@SPEED@=$2" \
    "CLOSING=$4" "1.0e-5=5.0e-6" "'scaled'='scaled'${5:-}" "${stiff[@]}"
  "$TALUS_BIN/talus-dem" compress.nml --threads=1 > compress.out || true
  cd - > /dev/null
}
say "bed"
"$python" "$here/beds.py" loose spheres 1 narrow "${stiff[@]}" "2.5e-3=5.0e-4"
"$TALUS_BIN/talus-dem" deposit.nml --threads=1 > deposit.out
say "plate at 0.5 m/s, two seeds"
crush seed-1 0.5 1 0.337
crush seed-2 0.5 2 0.30
say "plate at 0.1 m/s"
crush slower 0.1 1 0.096
say "fragments that grow, in 0.1 and in 1 ms"
crush grow-0.1ms 0.5 1 0.060 ", regrow = 1.0e-4"
crush grow-1ms 0.5 1 0.042 ", regrow = 1.0e-3"
"$python" "$here/slow.py"
