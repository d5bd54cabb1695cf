#!/usr/bin/env bash
# `make demo`: the penetration of the source chapter as far as 10 mm, and a cone in sand under gravity. Two runs go on side by
# side: the cone in all grains, the longest, beside the others.
# Usage: demo.sh OUT
source "$(dirname "$0")/head.sh"
out=${1:?usage: demo.sh OUT}
mkdir -p "$out"
out=$(cd "$out" && pwd)
sand="$root/examples/19-deep-cone/demo.sh $out/cone"
export OMP_NUM_THREADS=$(((threads + 1) / 2)) OMP_WAIT_POLICY=passive

$sand bed
say "sand, all grains: in the background, $out/cone/whole_a.out"
$sand whole >"$out/cone/whole_a.out" 2>&1 &
whole=$!
trap 'kill "$whole" 2>/dev/null || true' EXIT
$sand coupled
"$root/examples/01-penetration/run.sh" demo "$out"
say "sand, all grains: to its end"
wait "$whole"
trap - EXIT
$sand show
say "results"
printf '  %s\n' "$out/cone/cone.png" "$out/report.html" "$out/force_penetration.png" "$out/view3d.png"
