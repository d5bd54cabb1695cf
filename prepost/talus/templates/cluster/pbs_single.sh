#!/bin/bash
# One run of talus-dem or talus-fem on one node under PBS Pro or OpenPBS.
#   qsub -v DECK=deck.nml,PROGRAM=talus-dem pbs_single.sh
#PBS -N talus
#PBS -l select=1:ncpus=16
#PBS -l walltime=12:00:00
#PBS -j oe
set -u
cd "${PBS_O_WORKDIR:-$PWD}"
source "${TALUS_ENV:-$PWD/talus.env}"
: "${DECK:?usage: qsub -v DECK=deck.nml pbs_single.sh}"
"${PROGRAM:-talus-dem}" "$DECK" --restart=auto --threads="${NCPUS:-1}" &
child=$!
trap 'kill -TERM $child' TERM
wait $child
code=$?
if [ $code -gt 128 ]; then wait $child; code=$?; fi
[ $code -eq 3 ] && echo "stopped early with a checkpoint: submit the same line again"
exit $code
