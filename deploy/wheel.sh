#!/usr/bin/env bash
# Build the boat's wheel (runtime and configuration: no simulator, no torch) into dist/boat, install
# it into a bare virtual environment, and try it there: bash deploy/wheel.sh
set -euo pipefail
cd "$(dirname "$0")/.."
python=${PYTHON:-.venv/bin/python}
dist=dist/boat
bare=build/boat-venv

rm -rf "$dist" "$bare"
TWINSCREW_BOAT=1 "$python" -m pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation \
  --wheel-dir "$dist" .
wheel=$(ls "$dist"/*.whl)

PYTHON=$("$python" -c 'import sys; print(sys._base_executable)') bash deploy/bootstrap.sh "$bare"
"$bare/bin/pip" install --quiet --disable-pip-version-check "$wheel"
(cd / && "$OLDPWD/$bare/bin/python" "$OLDPWD/deploy/smoke.py")

echo "wheel        $(du -h --apparent-size "$wheel" | cut -f1)  $wheel"
echo "installed    $(du -sh --apparent-size "$bare"/lib/python3*/site-packages/twinscrew | cut -f1)  twinscrew alone"
echo "environment  $(du -sh --apparent-size "$bare" | cut -f1)  with everything it needs"
