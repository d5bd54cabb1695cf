# Dependency scan of the Fortran sources: prints make rules and refuses a forbidden `use`.
# dem, fem and couple use only themselves and common; inside a part a module uses its own floor and
# lower ones (tools/floors.txt). An object waits for the .mod files of what it uses: a compiler leaves
# a .mod alone when the interface is unchanged, and then nothing above is compiled anew.
# Usage: awk -v obj=build/obj -v mod=build/mod -f tools/depend.awk tools/floors.txt SOURCES
function object(path) { sub(/.*\//, "", path); sub(/\.f90$/, ".o", path); return obj "/" path }
function part(path) { sub(/\/.*/, "", path); return path }
function floor_of(path,  w, n) { n = split(path, w, "/"); return n == 3 ? w[2] : "" }
function refuse(text) { print text > "/dev/stderr"; bad = 1 }
function check(f, g, name,  a, b) {
  a = part(f); b = part(g)
  if (a == "tests") return
  if (a != b) {
    if (b != "common") refuse(f ": `use " name "` is forbidden: " a " may use only itself and common")
    return
  }
  if (floor_of(f) == "") return
  if (floor_of(g) == "" || height[b, floor_of(g)] > height[a, floor_of(f)])
    refuse(f ": `use " name "` is forbidden: " g " stands on a higher floor (tools/floors.txt)")
}
FILENAME ~ /floors\.txt$/ {
  if ($0 !~ /^#/ && NF > 1) { p = $1; sub(/:/, "", p); for (i = 2; i <= NF; i++) height[p, $i] = i }
  next
}
FNR == 1 {
  file[++n] = FILENAME
  base = FILENAME; sub(/^.*\//, "", base)
  if (base in seen_file) refuse(FILENAME ": " seen_file[base] " has the same name")
  seen_file[base] = FILENAME
  p = part(FILENAME)
  if (p != "tests" && floor_of(FILENAME) != "" && !((p, floor_of(FILENAME)) in height))
    refuse(FILENAME ": its folder is no floor of " p " (tools/floors.txt)")
}
{
  line = tolower($0)
  sub(/^[ \t]+/, "", line)
}
line ~ /^module +[a-z]/ && line !~ /^module +(procedure|subroutine|function)/ {
  split(line, w, /[ \t!]+/)
  owner[w[2]] = FILENAME
  base = FILENAME; sub(/^.*\//, "", base); sub(/\.f90$/, "", base)
  if (base != w[2]) refuse(FILENAME ": module " w[2] " must stand in " w[2] ".f90")
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
      if (!(w[j] in owner) || owner[w[j]] == f || (w[j] in seen)) continue
      seen[w[j]] = 1
      check(f, owner[w[j]], w[j])
      rule = rule " " mod "/" w[j] ".mod"
    }
    print object(f) ":" rule
  }
  for (name in owner) print mod "/" name ".mod: " object(owner[name])
  exit bad
}
