#!/usr/bin/env bash
# A bar is dragged through a bed that wakes before it and is left behind it; beside it the whole bed.
# Usage: run.sh OUT [WAY in m, default 1.0]
source "$(dirname "$0")/../head.sh"
export OMP_WAIT_POLICY=passive
mkdir -p "${1:?usage: run.sh OUT}"
cd "$1"
way=${2:-1.0}

# $1 stage, the rest its command: what has finished is not run again; seconds of the processors go to cost.csv
stage() {
  local name=$1
  shift
  if [ -e "$name.finished" ]; then return; fi
  say "$name"
  "$python" "$here/cost.py" "$name" "$@"
  touch "$name.finished"
}

stage tile "$python" "$here/prepare.py" cloud
stage settle "$TALUS_BIN/talus-dem" settle.nml --threads=1
stage rest "$TALUS_BIN/talus-dem" rest.nml --threads=1
stage bed "$python" "$here/prepare.py" bed "$way"
stage opened "$TALUS_BIN/talus-couple" coupled.nml
stage closed "$TALUS_BIN/talus-couple" closed.nml
stage held "$TALUS_BIN/talus-dem" held.nml --threads=1
stage whole "$TALUS_BIN/talus-dem" whole.nml --threads=1
"$python" "$here/judge.py" "$way"
