#!/usr/bin/env bash
# Make a virtual environment: bash deploy/bootstrap.sh FOLDER
# Finds a Python that is new enough; installs what Debian and Ubuntu leave out of theirs.
set -euo pipefail
venv=${1:?usage: bootstrap.sh FOLDER}

find_python() {
  local candidate
  for candidate in ${PYTHON:-} python3 python3.13 python3.12 python3.11; do
    if command -v "$candidate" >/dev/null &&
      "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
      echo "$candidate"
      return
    fi
  done
  echo "twinscrew needs Python 3.11 or newer; found none on the PATH (set PYTHON=...)" >&2
  exit 2
}

is_complete() {
  "$1" - <<'PY'
import importlib.util, pathlib, sys, sysconfig
headers = pathlib.Path(sysconfig.get_path("include"), "Python.h").is_file()
sys.exit(not (headers and importlib.util.find_spec("ensurepip") and importlib.util.find_spec("venv")))
PY
}

need_compiler() { ! command -v c++ >/dev/null && ! command -v g++ >/dev/null; }

install() {
  if ! command -v apt-get >/dev/null; then
    echo "please install: $* (no apt-get here to do it)" >&2
    exit 2
  fi
  local sudo=()
  [ "$(id -u)" -eq 0 ] || sudo=(sudo)
  echo "installing $*" >&2
  "${sudo[@]}" apt-get update -qq
  DEBIAN_FRONTEND=noninteractive "${sudo[@]}" apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

python=$(find_python)
if ! is_complete "$python"; then
  version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
  install "python$version-venv" "python$version-dev"
fi
if need_compiler; then install g++; fi
"$python" -m venv "$venv"
