#!/bin/bash
# One run of talus-fem (or talus-dem) on several ranks, each with its threads, and a checkpoint before time is up.
#   sbatch slurm_ranks.sh DECK [PROGRAM]
#   sbatch --nodes=8 --ntasks=64 slurm_ranks.sh bed.nml talus-dem
#SBATCH --job-name=talus
#SBATCH --nodes=1
#SBATCH --ntasks=4
#SBATCH --cpus-per-task=4
#SBATCH --time=12:00:00
#SBATCH --signal=TERM@180
#SBATCH --output=%x-%j.out
set -u
here=${SLURM_SUBMIT_DIR:-$PWD}
source "${TALUS_ENV:-$here/talus.env}"
deck=${1:?usage: sbatch slurm_ranks.sh DECK [PROGRAM]}
program=${2:-talus-fem}
export OPENBLAS_NUM_THREADS=$SLURM_CPUS_PER_TASK
talus_run "$program" "$deck" --restart=auto --threads="$SLURM_CPUS_PER_TASK"
code=$?
[ $code -eq 3 ] && echo "stopped early with a checkpoint: submit the same line again"
exit $code
