#!/bin/bash
# A coupled run on one node under PBS Pro or OpenPBS.
#   qsub -v DECK=coupled.nml pbs_coupled.sh
# PBS sends TERM and some seconds later KILL when time is up; kill_delay of the queue must leave
# time for a checkpoint, or set wall_limit in the deck a few minutes below the walltime.
#PBS -N talus-coupled
#PBS -l select=1:ncpus=16
#PBS -l walltime=12:00:00
#PBS -j oe
set -u
cd "${PBS_O_WORKDIR:-$PWD}"
source "${TALUS_ENV:-$PWD/talus.env}"
: "${DECK:?usage: qsub -v DECK=coupled.nml pbs_coupled.sh}"
talus-couple "$DECK" --restart=auto &
couple=$!
trap 'kill -TERM $couple' TERM
wait $couple
code=$?
if [ $code -gt 128 ]; then wait $couple; code=$?; fi
[ $code -eq 3 ] && echo "stopped early with a checkpoint: submit the same line again"
exit $code
