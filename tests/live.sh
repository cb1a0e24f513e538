#!/usr/bin/env bash
# The live view, seen by a client that we did not write: the packages @foxglove/ws-protocol, protobufjs and @mcap/core
# from npm. Daemon, replay, recorder and live view are real; what viewers get is compared with what was recorded.
set -euo pipefail
cd "$(dirname "$0")/.."

tests/install_tool.sh nodejs node
tests/install_tool.sh npm npm
place=$(mktemp -d)
declare -A jobs
cleanup() {
  for job in "${jobs[@]}"; do kill -9 "$job" 2>/dev/null || true; done
  rm -rf "$place"
}
trap cleanup EXIT
npm install --loglevel error --no-audit --no-fund --prefix "$place" \
  @foxglove/ws-protocol@0.8.0 ws@8.23.0 protobufjs@8.8.1 @mcap/core@2.2.2
cp tests/live.mjs "$place/live.mjs"

cargo build --release --workspace --bin dynocar --bin dynocar-recording --bin dynocar-live
dynocar=${CARGO_TARGET_DIR:-target}/release/dynocar
export DYNOCAR_ROOT=$place/root STATE_DIRECTORY=$place/state

. tests/await.sh
begin() { # NAME COMMAND...: in the background, its words in a file of that name
  local name=$1
  shift
  "$@" >"$place/$name" 2>&1 &
  jobs[$name]=$!
}
end() { # NAME SIGNAL
  kill "-$2" "${jobs[$1]}"
  wait "${jobs[$1]}"
}

# The shipped configuration, with its metrics on a port that is free.
metrics=$(node -e 'const s = require("net").createServer().listen(0, "127.0.0.1", () => { console.log(s.address().port); s.close() })')
sed "s|\"demo/|\"$PWD/config/demo/|" config/daemon.toml >"$place/daemon.toml"
printf '\n[metrics]\nlisten = "127.0.0.1:%s"\n' "$metrics" >>"$place/daemon.toml"

begin live "$dynocar" live --port 0 --samples-hz 0 --snapshots-ms 50
await "$place/live" "serving ws://"
url=$(grep -o -m1 'ws://127.0.0.1:[0-9]*' "$place/live")
begin record "$dynocar" record -o "$place/run.mcap" --train 1 --snapshots-ms 1
await "$place/record" "recording into"
begin viewer node "$place/live.mjs" view "$url" "$place/seen.json"
begin other node "$place/live.mjs" view "$url" "$place/other.json"
await "$place/viewer" "advertised /events"
await "$place/other" "advertised /events"
begin daemon "$dynocar" run --config "$place/daemon.toml"
await "$place/daemon" serving
"$dynocar" replay config/demo --run 1 --rate 50 2>"$place/replay" &
await "$place/other" "first message of /train/1/samples"
kill -9 "${jobs[other]}"
wait "$!"
await "$place/live" "a viewer has gone: 1 now"
await "$place/viewer" "unadvertised /train/1/samples"
node "$place/live.mjs" dashboard config/live/grafana_dashboard.json "http://127.0.0.1:$metrics/metrics"
end daemon TERM
await "$place/viewer" "unadvertised /train/1/2_residual_monitor"
end viewer INT
end record INT
end live INT
node "$place/live.mjs" compare "$place/seen.json" "$place/run.mcap"
