#!/bin/bash
# One run of talus-fem or talus-dem on several ranks of one node under PBS Pro or OpenPBS. Give the deck a wall_limit
# below the walltime: mpirun leaves its ranks a second to write a checkpoint.
#   qsub -v DECK=deck.nml,PROGRAM=talus-dem pbs_ranks.sh
#PBS -N talus-fem
#PBS -l select=1:ncpus=16:mpiprocs=4:ompthreads=4
#PBS -l walltime=12:00:00
#PBS -j oe
set -u
cd "${PBS_O_WORKDIR:-$PWD}"
source "${TALUS_ENV:-$PWD/talus.env}"
: "${DECK:?usage: qsub -v DECK=deck.nml,PROGRAM=talus-dem pbs_ranks.sh}"
threads=${OMP_NUM_THREADS:-1}
export OPENBLAS_NUM_THREADS=$threads
mpirun -n "$(wc -l < "$PBS_NODEFILE")" --map-by "slot:PE=$threads" \
  "${PROGRAM:-talus-fem}" "$DECK" --restart=auto --threads="$threads"
code=$?
[ $code -eq 3 ] && echo "stopped early with a checkpoint: submit the same line again"
exit $code
