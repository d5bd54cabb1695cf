#!/bin/bash
# A coupled run on nodes of two kinds (heterogeneous job): grains on the first component, solid on
# the second, exchange through files of a folder that both see (transport = 'hdf5').
#   sbatch slurm_coupled_two_nodes.sh COUPLED_DECK
# The deck has, and needs, these rows:
#   &program side = 'grains', deck = 'grains.nml', launch = 'command', command = './on_grains.sh' /
#   &program side = 'solid',  deck = 'solid.nml',  launch = 'command', command = './on_solid.sh' /
#   &port    transport = 'hdf5' /
#SBATCH --job-name=talus-two
#SBATCH --nodes=1 --ntasks=1 --cpus-per-task=16
#SBATCH --time=12:00:00
#SBATCH --signal=B:TERM@180
#SBATCH --output=%x-%j.out
#SBATCH hetjob
#SBATCH --nodes=1 --ntasks=1 --cpus-per-task=8
set -u
here=${SLURM_SUBMIT_DIR:-$PWD}
source "${TALUS_ENV:-$here/talus.env}"
deck=${1:?usage: sbatch slurm_coupled_two_nodes.sh COUPLED_DECK}
cd "$(dirname "$deck")"
# talus-couple appends deck and port to these
printf '#!/bin/bash\nexec srun --het-group=0 --cpu-bind=none talus-dem "$@"\n' > on_grains.sh
printf '#!/bin/bash\nexec srun --het-group=1 --cpu-bind=none talus-fem "$@"\n' > on_solid.sh
chmod +x on_grains.sh on_solid.sh
# talus-couple itself waits most of the time: it runs in the batch step, and gets the signal there
talus-couple "$(basename "$deck")" --restart=auto &
couple=$!
trap 'kill -TERM $couple' TERM
wait $couple
code=$?
if [ $code -gt 128 ]; then wait $couple; code=$?; fi  # the signal ended the first wait
[ $code -eq 3 ] && echo "stopped early with a checkpoint: submit the same line again"
exit $code
