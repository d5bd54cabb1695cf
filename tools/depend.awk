# Dependency scan of the Fortran sources: prints make rules `object: objects it uses` and refuses a
# forbidden `use` (dem, fem and couple may use only themselves and common; common only itself).
# Usage: awk -v obj=build/obj -f tools/depend.awk */*.f90
function folder(path) { sub(/\/[^\/]*$/, "", path); return path }
function object(path) { gsub(/\//, "-", path); sub(/\.f90$/, ".o", path); return obj "/" path }
FNR == 1 { n++; file[n] = FILENAME }
{
  line = tolower($0)
  sub(/^[ \t]+/, "", line)
}
line ~ /^module +[a-z]/ && line !~ /^module +(procedure|subroutine|function)/ {
  split(line, w, /[ \t!]+/)
  owner[w[2]] = FILENAME
  base = FILENAME; sub(/^.*\//, "", base); sub(/\.f90$/, "", base)
  if (base != w[2]) { print FILENAME ": module " w[2] " must stand in " w[2] ".f90" > "/dev/stderr"; bad = 1 }
}
line ~ /^use[ ,]/ {
  sub(/^use *(, *(non_)?intrinsic *)?(:: *)?/, "", line)
  match(line, /^[a-z0-9_]+/)
  name = substr(line, 1, RLENGTH)
  uses[FILENAME] = uses[FILENAME] " " name
}
END {
  for (i = 1; i <= n; i++) {
    f = file[i]; rule = ""
    count = split(uses[f], w, " ")
    delete seen
    for (j = 1; j <= count; j++) {
      if (!(w[j] in owner) || owner[w[j]] == f || (owner[w[j]] in seen)) continue
      g = owner[w[j]]; seen[g] = 1
      a = folder(f); b = folder(g)
      if (a != b && b != "common" && a != "tests/unit") {
        print f ": `use " w[j] "` is forbidden: " a " may use only itself and common" > "/dev/stderr"
        bad = 1
      }
      rule = rule " " object(g)
    }
    print object(f) ":" rule
  }
  exit bad
}
