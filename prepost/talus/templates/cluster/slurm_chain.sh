#!/bin/bash
# A run longer than the longest job: each link goes on from the checkpoint of the one before, as
# long as the program ends with exit code 3 (stopped early, checkpoint written).
#   sbatch slurm_chain.sh DECK [PROGRAM]; on ranks with --ntasks, and --nodes where one is not enough
#SBATCH --job-name=talus-chain
#SBATCH --nodes=1
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=16
#SBATCH --time=12:00:00
#SBATCH --signal=TERM@180
#SBATCH --output=%x-%j.out
set -u
here=${SLURM_SUBMIT_DIR:-$PWD}
source "${TALUS_ENV:-$here/talus.env}"
deck=${1:?usage: sbatch slurm_chain.sh DECK [PROGRAM]}
program=${2:-talus-dem}
links=${TALUS_LINKS:-20}  # an end for chains that get nowhere
talus_run "$program" "$deck" --restart=auto --threads="$SLURM_CPUS_PER_TASK"
code=$?
if [ $code -eq 3 ]; then
  if [ "$links" -gt 1 ]; then
    cd "$here" && TALUS_LINKS=$((links - 1)) sbatch --export=ALL --nodes="$SLURM_JOB_NUM_NODES" \
      --ntasks="$SLURM_NTASKS" --cpus-per-task="$SLURM_CPUS_PER_TASK" slurm_chain.sh "$deck" "$program"
    exit 0
  fi
  echo "the chain has no links left: submit it again to go on"
fi
exit $code
