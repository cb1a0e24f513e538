#!/usr/bin/env bash
# The FMU in a simulator: FMPy, from PyPI, validates it, simulates a recorded run with it and must get
# the numbers of `dynocar identify`.
set -euo pipefail
cd "$(dirname "$0")/.."

place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
if ! python3 -c 'import ensurepip, venv' 2>/dev/null; then
  # No program is called so: the package is installed.
  tests/install_tool.sh python3-venv python3-venv
fi
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet --disable-pip-version-check fmpy==0.3.32

cargo build --release
dynocar=${CARGO_TARGET_DIR:-target}/release/dynocar
"$dynocar" fmu -o "$place/dynocar.fmu" --dataset config/demo --inputs "$place/inputs"
"$dynocar" identify config/demo --per-run --json "$place/identified.json" >"$place/words"
"$place/venv/bin/python" tests/fmu.py "$place"
