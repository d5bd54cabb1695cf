#!/bin/bash
# A coupled run on one node: talus-couple starts both solvers (launch = 'fork'), shared memory.
#   sbatch slurm_coupled.sh COUPLED_DECK
# threads of the two &program rows together should be the cores of the job.
#SBATCH --job-name=talus-coupled
#SBATCH --nodes=1
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=16
#SBATCH --time=12:00:00
#SBATCH --signal=TERM@180
#SBATCH --output=%x-%j.out
set -u
here=${SLURM_SUBMIT_DIR:-$PWD}
source "${TALUS_ENV:-$here/talus.env}"
deck=${1:?usage: sbatch slurm_coupled.sh COUPLED_DECK}
# only talus-couple gets the signal; it lets both solvers write and exits with 3
srun --cpu-bind=none talus-couple "$deck" --restart=auto
code=$?
[ $code -eq 3 ] && echo "stopped early with a checkpoint: submit the same line again"
exit $code
