#!/usr/bin/env bash
# The shallow plan of this example: a cone goes 20 mm into sand, with all grains, with grains that wake amid a continuum,
# and with the same grains in a rigid box. Part of `make demo`.
# Usage: demo.sh OUT [bed|coupled|whole|show]; without a word all of them. demo.sh OUT column: the sand, made anew (three minutes)
source "$(dirname "$0")/../head.sh"
usage="usage: demo.sh OUT [bed|coupled|whole|show|column]"
export OMP_WAIT_POLICY=passive
mkdir -p "${1:?$usage}"
cd "$1"

# $1 name, the rest its command: seconds go to cost.csv
costed() { "$python" "$root/examples/08-moving-window/cost.py" "$@"; }

# the sand that is shipped: a periodic pack, a column of it at rest under gravity and its middle layer
column() {
  "$talus" pack tile --count 850 --axes 2e-3 2e-3 2e-3 --spread 0.2 --seed 1 --stress 100 --young 1e7 \
    --making-friction 0.15 --edge 0.036 -o tile.h5
  "$talus" pack column tile.h5 --height 0.07 -o column.h5
}

bed() {
  echo shallow > plan
  if [ ! -e column.h5 ]; then
    mkdir -p column_stages
    cp "$here/sand/column.h5" .
    cp "$here/sand/border_001_end.h5" column_stages
  fi
  say "element test of the sand, modulus of the surround"
  "$python" "$here/prepare.py" tests
  "$TALUS_BIN/talus-dem" test_1.nml --threads="$threads"
  "$python" "$here/prepare.py" beds
}

coupled() {
  say "coupled: grains wake around the cone, a continuum carries the rest"
  (cd wide_a && costed wide_a "$TALUS_BIN/talus-couple" coupled.nml)
  say "the same grains in a rigid box"
  costed box_wide_a "$TALUS_BIN/talus-dem" box_wide_a.nml --threads="$threads"
}

whole() {
  say "all grains"
  costed whole_a "$TALUS_BIN/talus-dem" whole_a.nml --threads="$threads"
}

show() {
  cat wide_a/cost.csv >>cost.csv
  "$python" "$here/show.py"
}

case "${2:-all}" in
  bed | coupled | whole | show | column) "$2" ;;
  all)
    bed
    coupled
    whole
    show
    ;;
  *)
    echo "$usage" >&2
    exit 1
    ;;
esac
