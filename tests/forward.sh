#!/usr/bin/env bash
# dynocar forward against a real broker (mosquitto), with a hundred trains of a real daemon, read by programs that
# we did not write: mosquitto_sub, and pysparkplug from PyPI. The broker is absent at first, killed, stopped, and back.
set -euo pipefail
cd "$(dirname "$0")/.."

# Debian keeps it where only root's search path leads.
export PATH=$PATH:/usr/sbin
tests/install_tool.sh mosquitto mosquitto
tests/install_tool.sh mosquitto-clients mosquitto_sub
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
if ! python3 -c 'import ensurepip, venv' 2>/dev/null; then
  # No program is called so: the package is installed.
  tests/install_tool.sh python3-venv python3-venv
fi
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet --disable-pip-version-check paho-mqtt==1.6.1 pysparkplug==0.6.1

cargo build --release --workspace --bin dynocar --bin dynocar-forward --bin dynocar-test-peer
programs=${CARGO_TARGET_DIR:-target}/release
"$place/venv/bin/python" tests/forward.py "$place" "$programs"
