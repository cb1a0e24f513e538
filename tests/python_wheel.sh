#!/usr/bin/env bash
# Builds the Python wheel, installs it into an empty environment and runs its tests there, against the
# programs that cargo builds; the tutorial's notebook is one of them. Everything else is made in a folder
# that goes afterwards. Installs Debian's or Ubuntu's python3-venv where there is none.
# usage: python_wheel.sh [FOLDER]   keeps the wheel in FOLDER
set -euo pipefail
cd "$(dirname "$0")/.."

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
wheels=${1:-$folder/wheels}

tests/install_tool.sh python3 python3
python3 -c 'import ensurepip, venv' 2>/dev/null || tests/install_tool.sh python3-venv no-such-program
environment() { # NAME PACKAGE...
  python3 -m venv "$folder/$1"
  "$folder/$1/bin/pip" install --quiet --disable-pip-version-check "${@:2}"
}

environment builder maturin==1.16.0
"$folder/builder/bin/maturin" build --release --quiet --manifest-path client/python/Cargo.toml --out "$wheels"
wheel=$(ls -t "$wheels"/dynocar-*.whl | head -n 1)

cargo build --release --workspace --bin dynocar --bin dynocar-workshop --bin dynocar-played-daemon
environment empty "$wheel[fleet]" iceoryx2==0.10.0 ipykernel mypy nbclient pandas polars pyarrow pytest
# In another folder, so that nothing but the wheel is imported.
project=$PWD
# The daemons of the tests keep their states where everything else goes.
export STATE_DIRECTORY=$folder/state
(cd "$folder" && "$folder/empty/bin/python" -m pytest --quiet -p no:cacheprovider "$project/client/python/tests")
