#!/bin/bash
# One run of talus-dem (or talus-fem) on the cores of one node, with a checkpoint before time is up.
#   sbatch slurm_single.sh DECK [PROGRAM]
#SBATCH --job-name=talus
#SBATCH --nodes=1
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=16
#SBATCH --time=12:00:00
#SBATCH --signal=TERM@180
#SBATCH --output=%x-%j.out
set -u
here=${SLURM_SUBMIT_DIR:-$PWD}
source "${TALUS_ENV:-$here/talus.env}"
deck=${1:?usage: sbatch slurm_single.sh DECK [PROGRAM]}
program=${2:-talus-dem}
# srun passes the signal of --signal on to the program, which writes a checkpoint and exits with 3
srun --cpu-bind=cores "$program" "$deck" --restart=auto --threads="$SLURM_CPUS_PER_TASK"
code=$?
[ $code -eq 3 ] && echo "stopped early with a checkpoint: submit the same line again"
exit $code
