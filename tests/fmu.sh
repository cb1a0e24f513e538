#!/usr/bin/env bash
# The FMUs in a simulator: FMPy, from PyPI, validates them, simulates recorded runs with them and must
# get the numbers of `dynocar identify`, and the speeds that `dynocar explain` predicts.
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

cargo build --release --workspace --bin dynocar --bin dynocar-workshop
cargo build --release --workspace --lib
dynocar=${CARGO_TARGET_DIR:-target}/release/dynocar
"$dynocar" fmu -o "$place/dynocar.fmu" --dataset config/demo --inputs "$place/inputs"
"$dynocar" identify config/demo --all --per-run --json "$place/identified.json" >"$place/words"
"$place/venv/bin/python" tests/fmu.py "$place"

# The demo as a controller would have recorded it that reports a fifth too much traction; the last run
# is held out.
cp -r config/demo "$place/demo"
for run in "$place"/demo/runs/*.csv; do
  awk -F, -v OFS=, 'NR > 1 { $4 = 1.2 * $4 } 1' "$run" >"$place/run"
  mv "$place/run" "$run"
done
awk '/^file = "runs\/06.csv"/ { last = 1 } last && /^role/ { $3 = "\"holdout\"" } 1' \
  config/demo/dataset.toml >"$place/demo/dataset.toml"
"$dynocar" explain "$place/demo" --grown "$place/grown" --predictions "$place/predicted" >>"$place/words"
rm -r "$place/inputs"
"$dynocar" fmu --plant -o "$place/train.fmu" --grown "$place/grown" --dataset "$place/demo" \
  --inputs "$place/inputs"
"$place/venv/bin/python" tests/fmu_train.py "$place"
