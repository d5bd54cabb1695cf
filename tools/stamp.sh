#!/bin/sh
# Write version and git hash into a C file, only when they have changed: making twice rebuilds nothing.
# Usage: stamp.sh FILE VERSION HASH
set -e
mkdir -p "$(dirname "$1")"
cat > "$1.tmp.$$" <<END
const char *talus_build_version(void);
const char *talus_build_git_hash(void);
const char *talus_build_version(void) { return "$2"; }
const char *talus_build_git_hash(void) { return "$3"; }
END
if cmp -s "$1.tmp.$$" "$1"; then rm "$1.tmp.$$"; else mv "$1.tmp.$$" "$1"; fi
