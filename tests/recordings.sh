#!/usr/bin/env bash
# Recordings, read by readers that we did not write: the packages mcap and mcap-protobuf-support from PyPI. One
# recorder is killed with kill -9, one is asked to end; the daemon, the demo's runs and a replay are real.
set -euo pipefail
cd "$(dirname "$0")/.."

place=$(mktemp -d)
jobs=()
cleanup() {
  for job in "${jobs[@]}"; do kill -9 "$job" 2>/dev/null || true; done
  rm -rf "$place"
}
trap cleanup EXIT
if ! python3 -c 'import ensurepip, venv' 2>/dev/null; then
  # No program is called so: the package is installed.
  tests/install_tool.sh python3-venv python3-venv
fi
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet --disable-pip-version-check mcap==1.6.0 mcap-protobuf-support==0.6.0

cargo build --release --workspace --bin dynocar --bin dynocar-recording
dynocar=${CARGO_TARGET_DIR:-target}/release/dynocar
export DYNOCAR_ROOT=$place/root

await() { # FILE WORDS
  for _ in $(seq 600); do
    if grep -q "$2" "$1"; then return; fi
    sleep 0.1
  done
  echo "waited in vain for '$2' in $1:" >&2
  cat "$1" >&2
  return 1
}

"$dynocar" run --config config/daemon.toml 2>"$place/daemon" &
jobs+=($!)
await "$place/daemon" serving
for name in killed ended; do
  "$dynocar" record -o "$place/$name.mcap" --train 1 2>"$place/$name" &
  jobs+=($!)
  await "$place/$name" "recording into"
done
"$dynocar" replay config/demo --run 1 --rate 50 2>"$place/replay"
# The recorders have a second to take what the replay left in the buffer and to flush it.
sleep 1
kill -9 "${jobs[1]}"
kill -INT "${jobs[2]}"
wait "${jobs[2]}"
"$dynocar" recover "$place/killed.mcap" -o "$place/recovered.mcap"
for command in check "identify --estimator mass_kalman" "replay --verify"; do
  # shellcheck disable=SC2086
  "$dynocar" $command "$place/recovered.mcap" >"$place/words"
done
"$place/venv/bin/python" tests/recordings.py "$place"
