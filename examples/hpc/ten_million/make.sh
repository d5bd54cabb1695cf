#!/usr/bin/env bash
# Packing of shear.nml: a cell of 1000 ellipsoids at rest under 100 kPa, laid side by side.
# Usage: make.sh OUT [NX NY NZ] (default 22 22 21: 10 164 000 grains, 1.4 GB)
here=$(cd "$(dirname "$0")" && pwd)
source "$here/../../../prepost/talus/templates/cluster/talus.env"
set -euo pipefail
out=${1:?usage: make.sh OUT [NX NY NZ]}
shift
mkdir -p "$out" && cp "$here"/*.nml "$out"
cd "$out"
talus pack cloud --count 1000 --box 0.066 0.066 0.066 --axes 2.5e-3 2.0e-3 1.5e-3 --periodic -o cloud.h5
talus-dem piece.nml --threads=1
if [ $# -eq 0 ]; then set -- 22 22 21; fi
talus pack edit rest.h5 --at-rest --repeat "$@" -o bed.h5
