#!/bin/bash
# An array of seeds: one packing and one run each, in folders seed_1, seed_2, ...
#   sbatch --array=1-5 slurm_seeds.sh DECK 'PACK COMMAND'
# The command makes the packing; SEED stands for the seed, for example
#   sbatch --array=1-5 slurm_seeds.sh deposit.nml 'talus pack penetration --seed SEED -o start.h5'
#SBATCH --job-name=talus-seeds
#SBATCH --nodes=1
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=4
#SBATCH --time=12:00:00
#SBATCH --signal=TERM@180
#SBATCH --output=%x-%A_%a.out
set -eu
here=${SLURM_SUBMIT_DIR:-$PWD}
source "${TALUS_ENV:-$here/talus.env}"
deck=${1:?usage: sbatch --array=1-5 slurm_seeds.sh DECK 'PACK COMMAND'}
seed=$SLURM_ARRAY_TASK_ID
mkdir -p "$here/seed_$seed"
cd "$here/seed_$seed"
cp "$here/$deck" .
if [ -n "${2:-}" ] && [ ! -e packed ]; then
  eval "${2//SEED/$seed}"
  touch packed  # a restarted run keeps its packing
fi
talus_run talus-dem "$(basename "$deck")" --restart=auto --threads="$SLURM_CPUS_PER_TASK"
