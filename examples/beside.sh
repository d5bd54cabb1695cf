# Sourced by run.sh of solids of another make: the penetration of example 14 with talus-fem and with them.

# $1 OUT, $2 name of the solver, $3 its command
penetration_beside() {
  local solver deck start decks=$here/../14-fenicsx
  mkdir -p "$1"/{talus-fem,"$2"}
  cd "$1"
  "$talus" mesh block -o block.h5
  "$talus" pack edit "$here/../01-penetration/deposit_small.txt" --at-rest --tool \
    --drop-container-above 0.061 -o pack.h5
  for solver in talus-fem "$2"; do
    say "$solver"
    cp block.h5 pack.h5 "$decks"/{coupled.nml,grains.nml,solid.nml,block.toml} "$solver"
    deck=solid.nml start="threads = 1"
    if [ "$solver" != talus-fem ]; then
      deck=block.toml start="launch = 'command', command = '$3'"
    fi
    sed -i "s|@solver@|$solver|; s|@deck@|$deck|; s|@start@|$start|" "$solver/coupled.nml"
    (cd "$solver" && "$TALUS_BIN/talus-couple" coupled.nml)
  done
  say "figure and comparison"
  "$python" "$here/../beside.py" . "$2"
}
