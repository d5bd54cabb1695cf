# Head of the examples' run.sh, which source it: the example's folder, the root, and the tools.
# TALUS (default build/venv/bin/talus) and TALUS_BIN (default build/bin) name the tools.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
export TALUS_BIN=${TALUS_BIN:-$root/build/bin}
talus=${TALUS:-$root/build/venv/bin/talus}
python=$root/build/venv/bin/python
threads=${OMP_NUM_THREADS:-$(nproc)}

say() { printf '\n== %s\n' "$*"; }

# $1 folder: made, with the decks of the example
fresh() { mkdir -p "$1" && cp "$here"/*.nml "$1"; }

# the same, and the run goes on there
enter() {
  fresh "$1"
  cd "$1"
}
