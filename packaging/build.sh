#!/usr/bin/env bash
# Build and install Talus, with a Python environment of its own, on a bare Debian 12 as root: what
# the container recipes of this folder call.
# Usage: packaging/build.sh PREFIX      ARCH (default x86-64-v3) is the oldest processor it runs on
set -euo pipefail
prefix=${1:?usage: packaging/build.sh PREFIX}
cd "$(dirname "$0")/.."
options=(ARCH="${ARCH:-x86-64-v3}" BUILD=/tmp/talus-build VENV="$prefix/python" PREFIX="$prefix")

tools/deps.sh apt
make -j"$(nproc)" all "${options[@]}"
python3 -m venv "$prefix/python"
"$prefix/python/bin/pip" install --quiet --disable-pip-version-check -r prepost/requirements-run.txt
make install "${options[@]}"
rm -rf /tmp/talus-build
