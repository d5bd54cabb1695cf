#!/usr/bin/env bash
# Penetration under gravity alone: all grains, grains in a continuum that overlaps them, a rigid box.
# Usage: run.sh OUT | run.sh OUT piece | run.sh OUT soil
source "$(dirname "$0")/../head.sh"
usage="usage: run.sh OUT [piece|soil]"
out=${1:?$usage}
mkdir -p "$out"
out=$(cd "$out" && pwd)

dem() { "$TALUS_BIN/talus-dem" "$1.nml" --threads="${2:-1}" >"$1.log" 2>&1; }

# the piece as it was shipped, brought to rest, laid side by side and cut
bed() {
  "$python" "$here/prepare.py" start .
  dem settle
  "$python" "$here/prepare.py" cut .
}

# all grains beside the two small runs, one thread each
runs() {
  dem all_grains &
  local all=$!
  "$TALUS_BIN/talus-couple" overlap.nml >overlap.log 2>&1
  dem box
  wait "$all"
}

figures() {
  "$python" "$here/judge.py" .
  "$talus" render all_grains.h5 -o bed_all_grains.png
  "$talus" render core.h5 --solid surround.h5 --sets overlap_sets.h5 -o bed_overlap.png
  "$talus" report . -o report.html --title "Penetration of a bed under gravity"
}

enter "$out"
case "${2:-}" in
  "")
    say "bed"
    bed
    say "all grains, overlap, rigid box"
    runs
    grep -h '^warning' ./*.log | sort -u || true
    say "figures"
    figures
    say "results"
    printf '  %s\n' "$out"/report.html "$out"/*.png "$out/judge.csv"
    ;;
  piece)
    "$python" "$here/prepare.py" cloud .
    dem fall
    sed -i 's/unbalanced = 1.0e-2, energy_ratio = 1.0e-3/unbalanced = 1.0e-3, energy_ratio = 1.0e-8/' settle.nml
    dem settle
    "$python" "$here/prepare.py" ship .
    ;;
  soil)
    bed
    "$python" "$here/soil.py" .
    ;;
  *)
    echo "$usage" >&2
    exit 1
    ;;
esac
