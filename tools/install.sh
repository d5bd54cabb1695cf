#!/usr/bin/env bash
# What `make install`, `make uninstall` and `make tarball` do. An installed suite may be moved.
#   install.sh install ROOT BIN LIB        ROOT is DESTDIR and PREFIX in one
#   install.sh uninstall ROOT
#   install.sh tarball FILE BIN LIB        the same in an archive, with the libraries that it needs
# COMPRESS (default gzip) packs the archive. PYTHON (default python3) makes editor files; one that can import talus makes man pages and completion, too.
set -euo pipefail
source=$(cd "$(dirname "$0")/.." && pwd)
python=${PYTHON:-python3}
export PYTHONPATH=$source/prepost PYTHONDONTWRITEBYTECODE=1

# libraries that belong to the machine: the C library, its loader, drivers
OF_SYSTEM='^(linux-vdso|ld-linux|lib(c|m|mvec|dl|rt|pthread|resolv|util|nsl|anl)\.so|libnss_)'

# shell:file that completes the command `talus` in it, relative to the root
completions=(bash:share/bash-completion/completions/talus zsh:share/zsh/site-functions/_talus
  fish:share/fish/vendor_completions.d/talus.fish)

# $1 root of the suite, $2 programs, $3 libraries of the port
install_suite() {
  local root=$1 share=$1/share/talus folder name pair
  install -d "$root"/{bin,include,lib} "$share"
  install -m 755 "$2"/talus-{dem,fem,couple} "$root/bin"
  install -m 755 "$source/tools/talus.in" "$root/bin/talus"
  install -m 644 "$source"/libport/talus_port.h "$source"/common/port/talus_port_names.h "$root/include"
  install -m 644 "$source"/libport/talus_port_partner.f90 "$source"/common/base/talus_kinds.f90 \
    "$source"/common/port/talus_{verbs,port_names,scalars}.f90 "$root/include"
  install -m 644 "$3"/libtalus_port.a "$3"/libtalus_port.so "$root/lib"
  rm -rf "$share"/{talus,editors}
  cp -r "$source"/prepost/talus "$share"
  for folder in common dem fem couple prepost; do
    for name in deck errors; do
      [ ! -e "$source/$folder/$name.toml" ] ||
        install -D -m 644 "$source/$folder/$name.toml" "$share/talus/tables/$folder/$name.toml"
    done
  done
  install -m 644 "$source"/{VERSION,LICENSE,CITATION.cff} "$source"/prepost/requirements-{run,render}.txt "$share"
  "$python" -m talus.editor_files "$share/editors" > /dev/null
  if "$python" -c 'import talus.cli' 2> /dev/null; then
    "$python" "$source/tools/man_pages.py" "$root/share/man/man1" "$2"
    for pair in "${completions[@]}"; do
      install -d "$root/$(dirname "${pair#*:}")"
      "$python" -m talus completion "${pair%%:*}" > "$root/${pair#*:}"
    done
  else
    echo "no man pages and no completion: $python lacks packages of talus (make deps-run)" >&2
  fi
  find "$share" -name __pycache__ -prune -exec rm -r {} +
  # what uninstall removes, relative to the root
  (cd "$root" && find bin/talus bin/talus-{dem,fem,couple} include/talus_port*.h include/talus_*.f90 lib/libtalus_port.* lib/talus \
    libexec/talus share/talus share/man/man1/talus*.1 "${completions[@]#*:}" \
    ! -type d 2> /dev/null || true) | sort > "$share/manifest"
}

# $1 root: only files of the manifest go, and folders that are empty then
uninstall_suite() {
  local manifest=$1/share/talus/manifest file
  [ -r "$manifest" ] || { echo "error: no $manifest: nothing of Talus is installed in $1" >&2; exit 1; }
  cd "$1"
  find share/talus -name __pycache__ -prune -exec rm -r {} +
  while read -r file; do rm -f "./$file"; done < "share/talus/manifest"
  rm -f share/talus/manifest
  find share/talus lib/talus libexec/talus -depth -type d -empty -delete 2> /dev/null || true
  rmdir -p --ignore-fail-on-non-empty share/bash-completion/completions share/zsh/site-functions \
    share/fish/vendor_completions.d share/man/man1 2> /dev/null || true
  rmdir --ignore-fail-on-non-empty bin include lib libexec share 2> /dev/null || true
}

# $1 folder; libraries that the other files need go there, but for those of the machine
copy_libraries() {
  local folder=$1 name path
  shift
  while read -r name path; do
    [[ $name =~ $OF_SYSTEM ]] || install -m 644 "$path" "$folder/$name"
  done < <(ldd "$@" | awk '$2 == "=>" && $3 ~ /^\// {print $1, $3}' | sort -u)
}

# $1 root: libraries beside the programs, which go to libexec; in bin a wrapper each
bundle_libraries() {
  local program prefix plugins
  install -d "$1/lib/talus/openmpi" "$1/libexec/talus"
  for program in talus-dem talus-fem talus-couple; do
    mv "$1/bin/$program" "$1/libexec/talus"
    install -m 755 "$source/tools/program.in" "$1/bin/$program"
  done
  copy_libraries "$1/lib/talus" "$1"/libexec/talus/talus-*
  # plugins of OpenMPI, at the place that they have below its prefix
  command -v ompi_info > /dev/null || { echo "no plugins of OpenMPI: there is no ompi_info here" >&2; return; }
  prefix=$(ompi_info --parsable --path prefix | sed 's/.*://')
  plugins=$(ompi_info --parsable --path pkglibdir | sed 's/.*://')
  mkdir -p "$1/lib/talus/openmpi/${plugins#"$prefix"/}"
  cp -L "$plugins"/*.so "$1/lib/talus/openmpi/${plugins#"$prefix"/}"
  copy_libraries "$1/lib/talus" "$plugins"/*.so
}

case ${1:-} in
  install) install_suite "$2" "$3" "$4" ;;
  uninstall) uninstall_suite "$2" ;;
  tarball)
    scratch=$(mktemp -d)
    trap 'rm -rf "$scratch"' EXIT
    root=$scratch/talus-$(cat "$source/VERSION")
    install_suite "$root" "$3" "$4"
    bundle_libraries "$root"
    mkdir -p "$(dirname "$2")"
    tar -C "$scratch" --owner=0 --group=0 -I "${COMPRESS:-gzip}" -cf "$2" "$(basename "$root")"
    echo "$2" ;;
  *) sed -n 's/^#   //p' "$0"; exit 1 ;;
esac
